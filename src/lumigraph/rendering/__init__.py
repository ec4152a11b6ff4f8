"""From raw images to pictures.

- `decode`: a plenoptic 1.0 raw image to a `LightField`, on its true micro-image lattice; `encode` back
- `views`: single views, points of view, a smaller aperture, mosaics of views and of micro-images
- `refocus`: shear and sum, for one depth or a stack
- `fourier_slice`: the same by a slice through the four-dimensional spectrum
- `focused`: plenoptic 2.0: turned patches tiled without seams, of one size or one for each lenslet
- `geometry`: lengths in metres, which lenslets form a rectangle
- `interpolate`: values between samples, by gathering and weights, for every array library
"""

from lumigraph.rendering.decode import decode
from lumigraph.rendering.encode import encode
from lumigraph.rendering.focused import render, render_stack, rendered_grid
from lumigraph.rendering.fourier_slice import refocus_fourier
from lumigraph.rendering.patches import lenslet_indices
from lumigraph.rendering.pixels import hot_pixels
from lumigraph.rendering.refocus import refocus, refocus_stack
from lumigraph.rendering.views import (
    lenslet_mosaic,
    point_of_view,
    reduce_aperture,
    view,
    views_from_mosaic,
    views_mosaic,
)

__all__ = [
    "decode",
    "encode",
    "hot_pixels",
    "lenslet_indices",
    "lenslet_mosaic",
    "point_of_view",
    "reduce_aperture",
    "refocus",
    "refocus_fourier",
    "refocus_stack",
    "render",
    "render_stack",
    "rendered_grid",
    "view",
    "views_from_mosaic",
    "views_mosaic",
]
