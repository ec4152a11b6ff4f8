"""Closed forms of geometrical optics and diffraction: floats in, floats out, one equation each.

- `thin_lens`: object and image distances, magnification
- `resolution`: f-number, numerical aperture, cut-offs, Airy pattern, depth of field
- `plenoptic1`, `plenoptic2`: cameras with lenslets at the main-lens image; focused ones, that relay it
- `matching`: main-lens diameters, matched, full and touching
- `ray_matrices`: rays and light fields of a plane through lenses, by matrices
- `illumination`: Köhler's, its aperture and its coherence
- `microscope`: the light-field microscope, by depth
- `layout`: the lengths that a ray diagram shows

The module itself can be called: `lumigraph.design(camera)` gives all that follows from a camera, as
`lumigraph design` prints it. Distances are positive along the light unless a function says otherwise.
"The thesis" in a source is the PhD thesis that this project started from; equations that are misprinted
there are given corrected here.
"""

from lumigraph.core import upper_floors
from lumigraph.core.verb_module import make_callable
from lumigraph.design import (
    illumination,
    matching,
    microscope,
    plenoptic1,
    plenoptic2,
    ray_matrices,
    resolution,
    thin_lens,
)

__all__ = [
    "illumination",
    "matching",
    "microscope",
    "plenoptic1",
    "plenoptic2",
    "ray_matrices",
    "resolution",
    "thin_lens",
]

make_callable(__name__, upper_floors.design)
del make_callable, upper_floors


def __dir__() -> list[str]:
    return __all__
