"""From raw images to pictures.

- `decode`: a plenoptic 1.0 raw image to a `LightField`, on its true micro-image lattice; `encode` back;
  `squared`: hexagonal lattices onto a square grid, and finer; `pixels`: hot pixels found and filled;
  `kind_check`: recognises a raw image of a camera 2.0
- `views`: single views, points of view, a smaller aperture, mosaics of views and of micro-images;
  `paths`: a point of view that moves; `arrangement`: whether views stand where their numbers say
- `focus_range`: refocus factors worth looking at
- `refocus`: shear and sum, for one depth or a stack; `sharp`: one picture focused everywhere
- `fourier_slice`: the same by a slice through the four-dimensional spectrum
- `focused`: plenoptic 2.0: turned patches tiled without seams, of one size or one for each lenslet;
  `patches`: their sizes; `kinds`: which lenslets are sharp; `super_resolution`: finer than one of them
- `geometry`: lengths in metres, which lenslets form a rectangle
- `interpolate`: values between samples, by gathering and weights, for every array library
"""

from lumigraph.rendering.arrangement import check_arrangement
from lumigraph.rendering.decode import decode
from lumigraph.rendering.encode import encode
from lumigraph.rendering.focus_range import focus_range, focus_span
from lumigraph.rendering.focused import render, render_stack, rendered_grid, sight_grid
from lumigraph.rendering.fourier_slice import refocus_fourier
from lumigraph.rendering.kinds import match_kinds
from lumigraph.rendering.patches import lenslet_indices, sharp_patches
from lumigraph.rendering.paths import view_path
from lumigraph.rendering.pixels import hot_pixels
from lumigraph.rendering.refocus import refocus, refocus_stack
from lumigraph.rendering.sharp import AllInFocus, all_in_focus
from lumigraph.rendering.super_resolution import super_resolve
from lumigraph.rendering.views import (
    arranged,
    lenslet_mosaic,
    point_of_view,
    reduce_aperture,
    view,
    views_from_mosaic,
    views_mosaic,
)

__all__ = [
    "AllInFocus",
    "all_in_focus",
    "arranged",
    "check_arrangement",
    "decode",
    "encode",
    "focus_range",
    "focus_span",
    "hot_pixels",
    "lenslet_indices",
    "lenslet_mosaic",
    "match_kinds",
    "point_of_view",
    "reduce_aperture",
    "refocus",
    "refocus_fourier",
    "refocus_stack",
    "render",
    "render_stack",
    "rendered_grid",
    "sharp_patches",
    "sight_grid",
    "super_resolve",
    "view",
    "view_path",
    "views_from_mosaic",
    "views_mosaic",
]
