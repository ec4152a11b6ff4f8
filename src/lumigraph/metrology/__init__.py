"""Metric calibration of cameras from boards of known size, and positions of points that they see.

- `Board`, `Corners`, `find_corners` (`chessboard`, `views`): the board, and its corners on raw images
- `MetricCamera`, `board` (`geometry`, `start`, `adjustment`, `noise`): the camera by bundle adjustment
- `plan`, `chart` (`printed`): poses for the pictures of a board; boards and other charts to print
- `load_camera`, `save_camera`: files of COMPOTE (`compote`) and LFToolbox (`lftoolbox`)
- `triangulate`: positions of points from their micro-images
- `datasheet`, `read_charts`, `simulate_charts`, `simulated`: measured properties of a camera, on charts
- `align`, `watch` (`alignment`): a motorised bench aligned in a closed loop, and kept so; `white_camera`
  of a microscope's
- `twin`, `BenchModel`, `corrected`: misalignment of a bench from white images, and the corrected camera file
"""

from lumigraph.instruments.telecentric import white_camera
from lumigraph.metrology.alignment.align import AlignmentGoal, AlignmentStep, align, watch
from lumigraph.metrology.alignment.devices import Bench
from lumigraph.metrology.alignment.drift import drift_rates, drift_table
from lumigraph.metrology.alignment.log import AlignmentLog
from lumigraph.metrology.alignment.moves import BenchError
from lumigraph.metrology.alignment.opening import open_bench
from lumigraph.metrology.alignment.reading import WhiteReader
from lumigraph.metrology.alignment.setup import BenchSetup, Motor, read_setup
from lumigraph.metrology.alignment.simulated import SimulatedBench
from lumigraph.metrology.boards.calibration import Measured, Pose, board
from lumigraph.metrology.boards.camera import MetricCamera, Nominal
from lumigraph.metrology.boards.corners import Board, Corners
from lumigraph.metrology.boards.exchange import load_camera, save_camera
from lumigraph.metrology.boards.files import is_measured, load, load_compote, load_corners, save, save_corners
from lumigraph.metrology.boards.finding import find_corners
from lumigraph.metrology.boards.planning import Plan, plan
from lumigraph.metrology.boards.printed import chart
from lumigraph.metrology.boards.triangulation import Triangulated, triangulate
from lumigraph.metrology.datasheet.charts import ChartExposures, Charts, read_charts, save_charts
from lumigraph.metrology.datasheet.lights import simulate_charts
from lumigraph.metrology.datasheet.measure import datasheet
from lumigraph.metrology.datasheet.sheet import SheetEntry
from lumigraph.metrology.datasheet.simulated import MEASURES, is_measure, simulated
from lumigraph.metrology.twin import BenchModel, Twin, corrected, twin

__all__ = [
    "MEASURES",
    "AlignmentGoal",
    "AlignmentLog",
    "AlignmentStep",
    "Bench",
    "BenchError",
    "BenchModel",
    "BenchSetup",
    "Board",
    "ChartExposures",
    "Charts",
    "Corners",
    "Measured",
    "MetricCamera",
    "Motor",
    "Nominal",
    "Plan",
    "Pose",
    "SheetEntry",
    "SimulatedBench",
    "Triangulated",
    "Twin",
    "WhiteReader",
    "align",
    "board",
    "chart",
    "corrected",
    "datasheet",
    "drift_rates",
    "drift_table",
    "find_corners",
    "is_measure",
    "is_measured",
    "load",
    "load_camera",
    "load_compote",
    "load_corners",
    "open_bench",
    "plan",
    "read_charts",
    "read_setup",
    "save",
    "save_camera",
    "save_charts",
    "save_corners",
    "simulate_charts",
    "simulated",
    "triangulate",
    "twin",
    "watch",
    "white_camera",
]


def __dir__() -> list[str]:
    return __all__
