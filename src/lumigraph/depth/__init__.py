"""Depth from a light field.

- `quantities`: disparities as refocus factors; every estimate returns a `core.depth_map.DepthMap`
- `epi`: disparities from the slopes of the lines of epipolar-plane images
- `from_focus`: refocus factors from the sharpness of a focal stack; `point_alpha` for a picture of one
  point, and `BiasCurve`, which corrects what diffraction does to either
- `correlation`: patch sizes of a plenoptic 2.0 camera's lenslets, from neighbouring micro-images;
  `dense`: of each sample of its picture, by `sightings`, what all micro-images show of it; `flat`: raw images
  without the shading of micro-images; `of_pixels` is all of it, from a raw image to its picture's patches,
  `of_lenslets` the same for lenslets
- `bias`: `unbiased`, a map corrected by planes of known depth
- `fuse`: several maps as one, smooth but for kinks and jumps
- `metric`: distances through the camera's geometry: metres, virtual depths, points in space
- `pictures`, `sweep`, `lines`: the steps of `epi`: even views, a plane sweep, least squares on all views;
  `visible`: which views see a place; `vote`: which of two maps they agree with;
  `shading`: how a place's brightness changes from view to view
- `expected`: the error to expect; `chance`: matches no better than by chance; `repeats`: pictures that repeat
- `volume`: costs of many labels: guided filter, semi-global matching, the best label
- `smooth`: surfaces through uncertain values that may be slanted, bent and torn
"""

from lumigraph.core.depth_map import DepthMap
from lumigraph.depth.bias import unbiased
from lumigraph.depth.correlation import correlation
from lumigraph.depth.dense import dense
from lumigraph.depth.epi import epi
from lumigraph.depth.from_focus import BiasCurve, from_focus, point_alpha, sharpness
from lumigraph.depth.fuse import fuse
from lumigraph.depth.metric import cloud, defocus, metric, virtual_depth
from lumigraph.depth.of_pixels import PixelDepth, of_lenslets, of_pixels
from lumigraph.depth.pictures import measurable
from lumigraph.depth.quantities import alpha_of, disparity_of

__all__ = [
    "BiasCurve",
    "DepthMap",
    "PixelDepth",
    "alpha_of",
    "cloud",
    "correlation",
    "defocus",
    "dense",
    "disparity_of",
    "epi",
    "from_focus",
    "fuse",
    "measurable",
    "metric",
    "of_lenslets",
    "of_pixels",
    "point_alpha",
    "sharpness",
    "unbiased",
    "virtual_depth",
]
