"""Errors and warnings of lumigraph: one base class, children only where a caller would act differently.

Every message says what is wrong, with both values and their units, then what to do.
"""

_LONGEST, _END = 400, 120  # characters of a message, and those of its end that are kept in any case


class LumigraphError(ValueError):
    """Base of everything lumigraph raises on purpose; a message of over 400 characters loses its middle."""

    def __init__(self, message: object = "") -> None:
        text = str(message)
        if len(text) > _LONGEST:  # what a file or a command line says is part of it
            text = f"{text[: _LONGEST - _END - 5]} ... {text[-_END:]}"
        super().__init__(text)


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


class ParaxialWarning(UserWarning):
    """Parabolic lenses or Fresnel propagation miss the accuracy asked for; the message says by how much."""
