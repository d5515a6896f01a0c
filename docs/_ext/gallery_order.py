"""Order of the examples in the gallery: what a newcomer wants first."""

from sphinx_gallery.sorting import FileNameSortKey

_ORDER = (
    "quickstart",
    "day_ahead_load",
    "planned_day",
    "three_optimisers",
    "two_zones",
    "several_zones",
    "fleet",
    "paper_identification",
    "design_matrix",
)


class NewcomersOrder(FileNameSortKey):
    """Place of an example; one that is not named comes last, by its name."""

    def __call__(self, filename: str) -> str:
        """A text to sort by."""
        name = filename.removeprefix("plot_").removesuffix(".py")
        return f"{_ORDER.index(name) if name in _ORDER else len(_ORDER):02d} {name}"
