"""Warnings, which fail the build, for a page without a title and for a picture without words."""

from typing import Any

from docutils import nodes
from sphinx.util import logging

logger = logging.getLogger(__name__)


def _check(app: Any, page: nodes.document) -> None:
    name = app.env.current_document.docname
    if not any(isinstance(child, nodes.section) for child in page.children):
        logger.warning("the page has no title; underline its first line.", location=name)
    for picture in page.findall(nodes.image):
        if "alt" not in picture:  # an empty one is a decoration
            logger.warning("the picture %s has no :alt: text.", picture["uri"], location=picture)


def setup(app: Any) -> dict[str, bool]:
    """Look at every page that was read."""
    app.connect("doctree-read", _check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
