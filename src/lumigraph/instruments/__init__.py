"""Cameras: what is given is checked, what is left out computed, and simulations get their grids and trains.

- `single_lens`: `SingleLensCamera`
- `plenoptic1`: `PlenopticCamera`, lenslets at the main-lens image
- `plenoptic2`: `FocusedPlenopticCamera`, lenslets that relay the main-lens image
- `microscope`: `LightFieldMicroscope` and its operator; `microscope_objective`: its `MicroscopeObjective`
- `with_parts`, `scope_with_parts`: derivatives of images by what differs between two cameras, or microscopes;
  `sees_volumes`: of volumes
- `parts`: `MainLens`, `Pixels`, and `lenslets`: `Lenslets`: the tables of a camera file
- `built`: `Built`, distances as built; `tolerances`: `Tolerance`, how far values may be off
- `joint`: `joint_operator` of several raw images of one object, `scan`, shifts between them
- `shifts`: `find_shifts`, from the raw images themselves; `lenslet_light`: what they show of the object;
  `texture`: how likely that is
- `loading`: `load_camera` for every kind
- `instrument`, `camera`, `lenslet_camera`: what the kinds share; `capabilities`: what some of them can do
- `parameters`: what a designer can change; `point_view`: a point's image at once
- `grids`: how finely and widely planes are sampled
- `describe`, `describe_microscope`: the table of everything that follows from a description, a `Description`
  of rows (`row`); `trade_offs`: those that change with the magnification
- `quantities`, `problems`, `files`: numbers with units, errors in one line, TOML and the `catalogue`
"""

from lumigraph.instruments.built import Built
from lumigraph.instruments.camera import Camera
from lumigraph.instruments.description import Description
from lumigraph.instruments.files import catalogue
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.instruments.lenslets import Lenslets
from lumigraph.instruments.loading import load_camera
from lumigraph.instruments.microscope import LightFieldMicroscope
from lumigraph.instruments.microscope_objective import MicroscopeObjective
from lumigraph.instruments.over_field import OverField
from lumigraph.instruments.parts import MainLens, Pixels
from lumigraph.instruments.plenoptic1 import PlenopticCamera
from lumigraph.instruments.plenoptic2 import FocusedPlenopticCamera
from lumigraph.instruments.row import Row
from lumigraph.instruments.single_lens import SingleLensCamera
from lumigraph.instruments.tolerances import Tolerance
from lumigraph.metrology.scanning.joint import joint_operator, scan
from lumigraph.metrology.scanning.shifts import FoundShifts, find_shifts

__all__ = [
    "Built",
    "Camera",
    "Description",
    "FocusedPlenopticCamera",
    "FoundShifts",
    "Instrument",
    "LensletCamera",
    "Lenslets",
    "LightFieldMicroscope",
    "MainLens",
    "MicroscopeObjective",
    "OverField",
    "Pixels",
    "PlenopticCamera",
    "Row",
    "SingleLensCamera",
    "Tolerance",
    "catalogue",
    "find_shifts",
    "joint_operator",
    "load_camera",
    "scan",
]


def __dir__() -> list[str]:
    return __all__
