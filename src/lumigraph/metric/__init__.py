"""Cameras with lengths: calibrated from boards of known size, and distances of what they see.

- `Board`: the known object; `Corners`: where its corners show on raw images.
- `find_corners`: the same from raw images of a chessboard (`chessboard`).
- `MetricCamera`: main lens, lenslets, sensor, as a geometry of rays (`geometry`).
- `board`: the camera from corners, by bundle adjustment (`adjustment`) from a coarse search (`start`),
  with the noise of corners that are seen many times (`noise`). `Measured` holds it, its errors, the poses.
- `plan`: how to take pictures of the board, and how well they will tell the camera.
- `triangulate`: positions of points from their micro-images.

T. Georgiev and A. Lumsdaine, "Focused plenoptic camera and rendering", J. Electron. Imaging 19 (2010),
has the geometry; M. Labussiere et al., "Leveraging blur information for plenoptic camera calibration",
IJCV 130 (2022), calibrate multi-focus cameras from such boards.
"""

from lumigraph.metric.calibration import Measured, Pose, board
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import Board, Corners
from lumigraph.metric.files import load, load_compote, load_corners, save, save_corners
from lumigraph.metric.finding import find_corners
from lumigraph.metric.planning import Plan, plan
from lumigraph.metric.triangulation import Triangulated, triangulate

__all__ = [
    "Board",
    "Corners",
    "Measured",
    "MetricCamera",
    "Nominal",
    "Plan",
    "Pose",
    "Triangulated",
    "board",
    "find_corners",
    "load",
    "load_compote",
    "load_corners",
    "plan",
    "save",
    "save_corners",
    "triangulate",
]
