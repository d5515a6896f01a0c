"""Settings of the documentation; build it with `make docs`."""

import logging
import re
import sys
import warnings
from pathlib import Path
from typing import Any

import skhybrid

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))

from used_on import pages_by_name  # noqa: E402

project = "skhybrid"
author = "skhybrid developers"
project_copyright = "skhybrid developers"
release = version = skhybrid.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "commands",
    "frames",
    "mathml",
    "whole_pages",
]
templates_path = ["_templates"]
exclude_patterns = ["_build", "_templates"]
# a link to a name of this package that no page has is an error
nitpicky = True
nitpick_ignore_regex = [(r"py:.*", r"(?!skhybrid\b).*")]

# ------------------------------------------------------------------------------------------------------- reference
autosummary_generate = True
autosummary_ignore_module_all = False
autosummary_context = {"pages": pages_by_name(HERE)}  # for the page of a class
autodoc_typehints = "none"  # numpydoc's Parameters section says it
numpydoc_show_class_members = False  # the class template lists them
numpydoc_use_plots = False
html_math_renderer = "mathml"

# ---------------------------------------------------------------------------------------------------- other projects
intersphinx_mapping = {
    "python": ("https://docs.python.org/3", None),
    "numpy": ("https://numpy.org/doc/stable", None),
    "scipy": ("https://docs.scipy.org/doc/scipy", None),
    "pandas": ("https://pandas.pydata.org/docs", None),
    "sklearn": ("https://scikit-learn.org/stable", None),
}
intersphinx_timeout = 5


class _Offline(logging.Filter):
    """Without a network there are no links to other projects, and the build goes on."""

    def filter(self, record: logging.LogRecord) -> bool:
        return "failed to reach any of the inventories" not in str(record.msg)


logging.getLogger("sphinx.sphinx.ext.intersphinx").addFilter(_Offline())

# --------------------------------------------------------------------------------------------------------- gallery
# a warning that an example prints, without the path of the machine that built the page
warnings.formatwarning = lambda message, category, *_, **__: f"{category.__name__}: {message}\n"
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "auto_examples",
    "filename_pattern": r"/plot_",
    "within_subsection_order": "gallery_order.NewcomersOrder",
    # each class links to the examples that use it
    "backreferences_dir": "generated/backreferences",
    "doc_module": ("skhybrid",),
    "abort_on_example_error": True,
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_memory": False,
    # a page that no other leads to, and that needs the network
    "write_computation_times": False,
    # a line that draws shows its figure, not what it returns
    "ignore_repr_types": r"matplotlib[.]",
    # neither the date nor the machine belongs on the page
    "show_signature": False,
}

# ------------------------------------------------------------------------------------------------------------ look
# tables of results and the code of examples need the width
_FOLDERS = ("start", "how_to", "explanation", "reference", "generated")
_WITH_CONTENTS = [*(f"{folder}/**" for folder in _FOLDERS), "api", "citation", "glossary", "index", "whats_new"]
html_theme = "pydata_sphinx_theme"
html_title = f"skhybrid {release}"
html_static_path = ["_static"]
html_css_files = ["skhybrid.css"]
html_js_files = ["skhybrid.js"]
html_theme_options = {
    "navigation_with_keys": False,
    "show_prev_next": False,
    "secondary_sidebar_items": {page: ["page-toc"] for page in _WITH_CONTENTS},
    "header_links_before_dropdown": 6,
    "logo": {"text": "skhybrid"},
}
html_sidebars = {"index": [], "start/index": [], "whats_new": [], "citation": []}


def _changelog_as_rst() -> str:
    """CHANGELOG.md (headings, lists, links, code) as reStructuredText."""
    text = (HERE.parent / "CHANGELOG.md").read_text(encoding="utf-8")
    text = re.sub(r"\A# .*\n", "", text)
    text = re.sub(r"(?<!`)`([^`\n]+)`(?!`)", r"``\1``", text)
    text = re.sub(r"\[([^\]]+)\]\((http[^)]+)\)", r"`\1 <\2>`__", text)
    text = re.sub(r"^## \[?([^\]\n]+?)\]?( - .*)?$", lambda m: _heading(m[1] + (m[2] or ""), "-"), text, flags=re.M)
    return re.sub(r"^### (.*)$", lambda m: _heading(m[1], "~"), text, flags=re.M)


def _heading(title: str, line: str) -> str:
    return f"{title}\n{line * len(title)}"


def _insert_what_is_written_elsewhere(app: Any, name: str, source: list[str]) -> None:
    if name == "whats_new":
        source[0] += _changelog_as_rst()
    if name == "citation":
        source[0] = source[0].replace("|release|", release)


def _skip_what_is_not_ours(app: Any, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out members that a class has from scikit-learn or Python: they are documented there."""
    if what == "class" and not isinstance(obj, property):
        return skip or not str(getattr(obj, "__module__", None)).startswith("skhybrid") or None
    return None


#: names that another module documents too
_WITHOUT_SOURCE = {("skhybrid.datasets", "read_zone_csv"), ("skhybrid.logs", "regularize")}


def _source_on_one_page(app: Any, module: str, name: str) -> str | None:
    """Leave out the second link to a source: viewcode links back to the module of one page and the file of another."""
    return module if (module, name) in _WITHOUT_SOURCE else None


def setup(app: Any) -> None:
    """Connect the hooks."""
    app.connect("viewcode-follow-imported", _source_on_one_page)
    app.connect("source-read", _insert_what_is_written_elsewhere)
    app.connect("autodoc-skip-member", _skip_what_is_not_ours)
