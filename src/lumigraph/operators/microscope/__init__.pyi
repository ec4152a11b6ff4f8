"""Public names and where they come from; `lazy_loader` reads this file, and so do type checkers."""

from .building import (
    SampledLenslets as SampledLenslets,
    microscope_operator as microscope_operator,
    require_accuracy as require_accuracy,
)
from .cell import CellSampling as CellSampling, Lenslet as Lenslet
from .fourier_microscope import Mosaic as Mosaic, fourier_operator as fourier_operator
from .fourier_plane import FourierPlane as FourierPlane
from .fourier_points import FourierPoints as FourierPoints
from .layout import (
    SensorLayout as SensorLayout,
    cell_sampling as cell_sampling,
    interpolated as interpolated,
    laid_out as laid_out,
)
from .pixels import narrowed as narrowed
from .pupil import PupilImages as PupilImages, require_phase as require_phase
from .pupil_plane import PupilPlane as PupilPlane
