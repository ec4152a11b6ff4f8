"""Depth from a light field.

- `from_focus`: a map of refocus factors with a confidence, from the sharpness of a focal stack; `point_alpha`
  for a picture of one point, and `BiasCurve`, which corrects what diffraction does to either

Refocus factors α' = F/F' become distances by `lumigraph.design.plenoptic1.defocus`.
"""

from lumigraph.depth.from_focus import BiasCurve, FocusMap, from_focus, point_alpha, sharpness

__all__ = ["BiasCurve", "FocusMap", "from_focus", "point_alpha", "sharpness"]
