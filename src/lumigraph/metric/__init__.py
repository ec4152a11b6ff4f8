"""Cameras with lengths: calibrated from boards of known size, and distances of what they see.

- `Board`: the known object; `Corners`: where its corners show on raw images.
- `find_corners`: the same from raw images of a chessboard (`chessboard`), or from their `views`.
- `MetricCamera`: main lens, lenslets, sensor, as a geometry of rays (`geometry`).
- `board`: the camera from corners, by bundle adjustment (`adjustment`) from a coarse search (`start`),
  with the noise of corners that are seen many times (`noise`). `Measured` holds it, its errors, the poses.
- `chart`: boards and other charts to print, in true size (`printed`).
- `plan`: how to take pictures of the board, and how well they will tell the camera.
- `load_camera`, `save_camera`: cameras in files of COMPOTE (`compote`) and LFToolbox (`lftoolbox`).
- `triangulate`: positions of points from their micro-images.
- `datasheet`: what a camera does, on `Charts` that `read_charts` finds in a folder or `simulate_charts` takes
  by wave optics (`planes`: a picture of the charts; `Sheet`: the lines).
- `twin`: what is out of place on a bench, from white images; a `Bench` simulates one, `corrected` gives the
  camera file as it stands.
- `simulated`: some of these of a camera as it is described, as sweeps measure them.

T. Georgiev and A. Lumsdaine, "Focused plenoptic camera and rendering", J. Electron. Imaging 19 (2010),
has the geometry; M. Labussiere et al., "Leveraging blur information for plenoptic camera calibration",
IJCV 130 (2022), calibrate multi-focus cameras from such boards.
"""

from lumigraph.metric.calibration import Measured, Pose, board
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.charts import Charts, Seen, read_charts, save_charts
from lumigraph.metric.corners import Board, Corners
from lumigraph.metric.datasheet import datasheet
from lumigraph.metric.exchange import load_camera, save_camera
from lumigraph.metric.files import is_measured, load, load_compote, load_corners, save, save_corners
from lumigraph.metric.finding import find_corners
from lumigraph.metric.lights import simulate_charts
from lumigraph.metric.planning import Plan, plan
from lumigraph.metric.printed import chart
from lumigraph.metric.sheet import Entry, Plane, Sheet
from lumigraph.metric.simulated import MEASURES, is_measure, simulated
from lumigraph.metric.triangulation import Triangulated, triangulate
from lumigraph.metric.twin import Bench, Twin, corrected, twin

__all__ = [
    "MEASURES",
    "Bench",
    "Board",
    "Charts",
    "Corners",
    "Entry",
    "Measured",
    "MetricCamera",
    "Nominal",
    "Plan",
    "Plane",
    "Pose",
    "Seen",
    "Sheet",
    "Triangulated",
    "Twin",
    "board",
    "chart",
    "corrected",
    "datasheet",
    "find_corners",
    "is_measure",
    "is_measured",
    "load",
    "load_camera",
    "load_compote",
    "load_corners",
    "plan",
    "read_charts",
    "save",
    "save_camera",
    "save_charts",
    "save_corners",
    "simulate_charts",
    "simulated",
    "triangulate",
    "twin",
]
