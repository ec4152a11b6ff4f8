"""Metric calibration of cameras from boards of known size, and positions of points that they see.

- `Board`, `Corners`, `find_corners` (`chessboard`, `views`): the board, and its corners on raw images
- `MetricCamera`, `board` (`geometry`, `start`, `adjustment`, `noise`): the camera by bundle adjustment
- `plan`, `chart` (`printed`): poses for the pictures of a board; boards and other charts to print
- `load_camera`, `save_camera`: files of COMPOTE (`compote`) and LFToolbox (`lftoolbox`)
- `triangulate`: positions of points from their micro-images
- `datasheet`, `read_charts`, `simulate_charts`, `simulated`: measured properties of a camera, on charts
- `twin`, `Bench`, `corrected`: misalignment of a bench from white images, and the corrected camera file
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
