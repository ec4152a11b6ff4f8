"""What stands in front of the camera, in object space.

- `volumes`: `Scene` and its parts: `Slice`, `Points`, `Diffuser`
- `targets`: test charts as scenes: pinhole, edge, USAF-1951, gratings, star, chessboard, photo
- `usaf`: the chart USAF-1951
- `sources`: waves: `plane_wave`, `point_source`, `gaussian_beam`
"""

from lumigraph.scene import sources, targets
from lumigraph.scene.volumes import Diffuser, Part, Points, Scene, Slice

__all__ = ["Diffuser", "Part", "Points", "Scene", "Slice", "sources", "targets"]
