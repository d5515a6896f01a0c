"""Warnings and errors that a user can catch by name."""


class SkhybridWarning(UserWarning):
    """Base of every warning of this package."""


class UnitWarning(SkhybridWarning):
    """A column's range suggests another unit than its role has (degF, W/m2, percent)."""


class RoleWarning(SkhybridWarning):
    """Columns were given roles by position because no name matched a role."""


class ScaleNotIdentifiableWarning(SkhybridWarning):
    """No parameter or measured heat fixes the scale of the network (design ruling 3)."""


class ExcitationWarning(SkhybridWarning):
    """The table does not move a parameter, so that the fit cannot know it."""


class ModelFileError(ValueError):
    """A saved model is truncated, altered, of another version, or not a model at all."""
