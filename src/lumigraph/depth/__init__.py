"""Depth from a light field.

- `estimate`: one call for views, which `lumigraph.depth(views)` runs: the module itself can be called
- `epi` (`pictures`, `sweep`, `lines`, `visible`, `vote`, `shading`): disparities by epipolar-plane images
- `from_focus`: refocus factors by a focal stack; `BiasCurve` and `bias.unbiased` correct for diffraction
- `correlation`, `dense`, `of_pixels` (`sightings`, `flat`): patch sizes of a plenoptic 2.0 camera
- `fuse`: several maps as one; `metric`: metres, virtual depths; `mesh`: surfaces; `drawn`: pictures of maps
- `quantities`: disparities as refocus factors; all estimates return a `core.depth_map.DepthMap`
- `expected`, `chance`, `repeats`: the error to expect; chance matches; repeating textures
- `volume`, `smooth`: costs of labels; surfaces through uncertain values
"""

from lumigraph.core.depth_map import DepthMap
from lumigraph.core.verb_module import make_callable
from lumigraph.depth.bias import unbiased
from lumigraph.depth.correlation import correlation
from lumigraph.depth.dense import dense
from lumigraph.depth.drawn import drawn
from lumigraph.depth.epi import epi
from lumigraph.depth.estimate import estimate
from lumigraph.depth.from_focus import BiasCurve, from_focus
from lumigraph.depth.fuse import fuse
from lumigraph.depth.metric import cloud, defocus, metric, virtual_depth
from lumigraph.depth.of_pixels import of_lenslets, of_pixels
from lumigraph.depth.quantities import alpha_of, disparity_of

__all__ = [
    "BiasCurve",
    "DepthMap",
    "alpha_of",
    "cloud",
    "correlation",
    "defocus",
    "dense",
    "disparity_of",
    "drawn",
    "epi",
    "estimate",
    "from_focus",
    "fuse",
    "metric",
    "of_lenslets",
    "of_pixels",
    "unbiased",
    "virtual_depth",
]

make_callable(__name__, estimate)
del make_callable


def __dir__() -> list[str]:
    return __all__
