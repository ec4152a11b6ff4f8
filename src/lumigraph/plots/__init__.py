"""Drawings: every function returns a matplotlib Figure and opens no window.

- `pictures`: `show` an image, or any noun that holds one; nouns' `plot` comes here
- `trains`: `planes` of a train of elements
- `lattices`: `lattice`, a calibration over its white image
- `sheets`: `sheet`, a page of true size to print
- `layout`: rays through a camera; `microscope_layout`: through an objective
- `curves`: `curves` over one axis, or `over_depth`; several `images` side by side
- `volumes`: `projections` and `slices` of a volume
- `alignments`: steps of a bench's alignment
- `axes`: axes with lengths in readable units, colour bars
"""

from lumigraph.plots.alignments import alignment, alignment_picture
from lumigraph.plots.curves import curves, images, over_depth
from lumigraph.plots.lattices import lattice
from lumigraph.plots.layout import layout
from lumigraph.plots.pictures import show
from lumigraph.plots.sheets import sheet
from lumigraph.plots.trains import planes
from lumigraph.plots.volumes import projections, slices

__all__ = [
    "alignment",
    "alignment_picture",
    "curves",
    "images",
    "lattice",
    "layout",
    "over_depth",
    "planes",
    "projections",
    "sheet",
    "show",
    "slices",
]


def __dir__() -> list[str]:
    return __all__
