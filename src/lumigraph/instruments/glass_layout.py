"""Ray diagram of a main lens of glass: its surfaces, and rays through them."""

import hashlib
from functools import lru_cache
from pathlib import Path

import numpy as np

from lumigraph.design.layout import GlassLayout
from lumigraph.instruments.glass import Wanted, glass
from lumigraph.io.prescription import Prescription, content

FIELD = 0.75
"""Part of the farthest field, from which the second bundle comes."""

_PUPIL = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])


def glass_layout(path: Path, wanted: Wanted) -> GlassLayout:
    """Layout of a prescription as a camera uses it.

    Raises
    ------
    FormatError, GeometryError, LumigraphError
        As `glass`.
    """
    return _layout(path, hashlib.sha256(content(path)).hexdigest(), wanted)


@lru_cache(16)
def _layout(path: Path, _: str, wanted: Wanted) -> GlassLayout:
    known, lens = glass(path, wanted), Prescription(path)
    first = lens.first_order(wanted.wavelength)
    lens.focus(wanted.object_distance, wanted.image_distance + known.defocus, known.entrance_pupil)
    heights = np.array([0.0, FIELD * wanted.reach]) * wanted.object_distance
    drawn = lens.drawn(wanted.wavelength, heights, _PUPIL)
    last = float(drawn["surfaces"][-1, 0, drawn["surfaces"].shape[2] // 2])
    return GlassLayout(
        drawn["surfaces"], tuple(drawn["is_glass"].tolist()), drawn["rays"], int(drawn["stop"][0]),
        (first.front, last + first.back),
    )  # fmt: skip
