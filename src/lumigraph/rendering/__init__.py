"""Pictures and light fields from raw images.

- `decode`, `encode`: plenoptic 1.0 raw images to a `LightField` on their lattice, and back; `squared`,
  `pixels`, `kind_check`: hexagonal lattices onto a square grid, hot pixels, raw images of a camera 2.0
- `views`, `paths`: views, points of view, apertures, mosaics; a point of view that moves
- `refocus`, `fourier_slice`, `sharp`, `focus_range`, `detail`: refocused pictures; one that is focused
  everywhere; how finely they are sampled
- `low_pass`: a picture without the seams of its patches
- `focused`, `patches`, `kinds`, `super_resolution`: plenoptic 2.0 pictures, of patches of one size or many
- `geometry`, `interpolate`: lengths in metres, rectangles of lenslets; values between samples
"""

from lumigraph.rendering.decode import decode
from lumigraph.rendering.detail import detail, finer
from lumigraph.rendering.encode import encode
from lumigraph.rendering.focused import render, render_stack, sight_grid
from lumigraph.rendering.fourier_slice import refocus_fourier
from lumigraph.rendering.kinds import match_kinds
from lumigraph.rendering.low_pass import low_pass
from lumigraph.rendering.patches import lenslet_indices, sharp_patches
from lumigraph.rendering.paths import view_path
from lumigraph.rendering.pixels import hot_pixels
from lumigraph.rendering.refocus import refocus, refocus_stack
from lumigraph.rendering.sharp import all_in_focus
from lumigraph.rendering.super_resolution import super_resolve
from lumigraph.rendering.views import (
    arranged,
    point_of_view,
    reduce_aperture,
    sub_aperture,
    views_from_mosaic,
)

__all__ = [
    "all_in_focus",
    "arranged",
    "decode",
    "detail",
    "encode",
    "finer",
    "hot_pixels",
    "lenslet_indices",
    "low_pass",
    "match_kinds",
    "point_of_view",
    "reduce_aperture",
    "refocus",
    "refocus_fourier",
    "refocus_stack",
    "render",
    "render_stack",
    "sharp_patches",
    "sight_grid",
    "sub_aperture",
    "super_resolve",
    "view_path",
    "views_from_mosaic",
]


def __dir__() -> list[str]:
    return __all__
