"""What lumigraph raises and warns: one base class, children only where a caller would act differently.

Every message says what is wrong, with both values and their units, then what to do.
"""


class LumigraphError(ValueError):
    """Base of everything lumigraph raises on purpose."""


class SamplingError(LumigraphError):
    """A grid is too coarse, too small or too large for what is asked of it."""


class GeometryError(LumigraphError):
    """Distances, sizes or shapes that no instrument can have together."""


class CalibrationError(LumigraphError):
    """A white image, a raw image and a lattice that do not belong together."""


class FormatError(LumigraphError):
    """A file or a quantity that cannot be read: wrong kind, damaged, or larger than allowed."""


class SamplingWarning(UserWarning):
    """Legal but suspicious sampling: the result may alias; the message gives the numbers."""
