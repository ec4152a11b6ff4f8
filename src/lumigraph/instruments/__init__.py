"""Cameras: what is given is checked, what is left out computed, and simulations get their grids and trains.

- `single_lens`: `SingleLensCamera`
- `plenoptic1`: `PlenopticCamera`, lenslets at the main-lens image
- `plenoptic2`: `FocusedPlenopticCamera`, lenslets that relay the main-lens image
- `microscope`: `LightFieldMicroscope` and its operator; `microscope_objective`: its `MicroscopeObjective`
- `with_parts`, `scope_with_parts`: derivatives of images by what differs between two cameras, or microscopes;
  `sees_volumes`: of volumes
- `parts`: `MainLens`, `Pixels`, and `lenslets`: `Lenslets`: the tables of a camera file
- `built`: `Built`, distances as built; `tolerances`: `Tolerance`, how far values may be off
- `loading`: `load_camera` for every kind
- `instrument`, `camera`, `lenslet_camera`: what the kinds share; `capabilities`: what some of them can do
- `parameters`: what a designer can change; `point_view`: a point's image at once
- `grids`: how finely and widely planes are sampled
- `description`: `Description`, rows of quantities (`Row`), which `lumigraph.describe` makes
- `quantities`, `problems`, `files`: numbers with units, errors in one line, TOML and the `catalogue`
"""

from lumigraph.instruments.built import Built
from lumigraph.instruments.camera import Camera
from lumigraph.instruments.description import Description, Row
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
from lumigraph.instruments.single_lens import SingleLensCamera
from lumigraph.instruments.tolerances import Tolerance

__all__ = [
    "Built",
    "Camera",
    "Description",
    "FocusedPlenopticCamera",
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
    "load_camera",
]
