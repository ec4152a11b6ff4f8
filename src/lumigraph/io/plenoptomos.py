"""plenoptomos `.ini`: the nominal geometry of a bench plenoptic 1.0 camera; lengths in millimetres."""

import math
from pathlib import Path

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import FormatError
from lumigraph.io import source
from lumigraph.io.views import numbers

_MM = 1e-3
_NOTE = "the lattice is nominal, from lengths, not measured on a picture"


def load(
    path: Path, *, shape: tuple[int, int] | None = None, max_pixels: int = source.MAX_PIXELS
) -> Calibration:
    """The lengths of a camera, and the square lattice that they would give, its middle lenslet in the middle.

    The lengths are what matters: put them into a calibration that was measured,
    ``dataclasses.replace(calibration, pixel_pitch=..., separation=..., lenslet_distance=...)``.

    Parameters
    ----------
    path
        The file.
    shape
        Rows and columns of the raw image; those of the whole sensor if left out.
    max_pixels
        Larger shapes are refused.

    Raises
    ------
    FormatError
        Another file, or a length that is missing or not above zero.
    """
    path = source.regular_file(path)
    found = numbers(path)
    pixel = _length(path, found, "sensor.pixel_size_x")
    separation = _length(path, found, "micro_lenses_array.z")
    distance = _length(path, found, "sensor.z") - separation
    if distance <= 0:
        distance = _length(path, found, "micro_lens.f2")
    pitch = _length(path, found, "micro_lens.physical_size_s")
    if shape is None:
        shape = (
            round(_length(path, found, "sensor.size_y") / _MM),
            round(_length(path, found, "sensor.size_x") / _MM),
        )
    shape = checks.shape("shape", shape)
    source.check_size(path, shape, max_pixels)
    lattice = Lattice.square(
        pitch * (1 + distance / separation) / pixel, 0.0, ((shape[0] - 1) / 2, (shape[1] - 1) / 2)
    )
    indices = source.nominal_indices(path, lattice, shape)
    return Calibration(
        lattice,
        shape,
        indices,
        lattice.position(indices),
        0.0,
        pixel,
        separation,
        distance,
        notes=(_NOTE,),
        by_maker=True,
    )


def _length(path: Path, found: dict[str, float], name: str) -> float:
    value = found.get(name, math.nan)
    if not 1e-12 < value < 1e9:
        section, _, key = name.partition(".")
        raise FormatError(f"{path} has no {key} above 0 in [{section}]. Is it plenoptomos' geometry file?")
    return value * _MM
