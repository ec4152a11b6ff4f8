"""The everyday names and where they come from; `lazy_loader` reads this file, and so do type checkers."""

from . import (
    analysis as analysis,
    calibration as calibration,
    cluster as cluster,
    deconvolution as deconvolution,
    depth as depth,
    design as design,
    elements as elements,
    instruments as instruments,
    io as io,
    metrology as metrology,
    operators as operators,
    plots as plots,
    preparation as preparation,
    propagation as propagation,
    rendering as rendering,
    samples as samples,
    scene as scene,
    sensor as sensor,
    simulation as simulation,
    studies as studies,
    testing as testing,
    torch as torch,
    units as units,
    viewer as viewer,
)
from .calibration import calibrate as calibrate, devignette as devignette
from .core.calibration import Calibration as Calibration
from .core.cloud import PointCloud as PointCloud
from .core.depth_map import DepthMap as DepthMap
from .core.field import Field as Field
from .core.grid import Grid as Grid
from .core.lattice import Lattice as Lattice
from .core.lightfield import LightField as LightField
from .core.modes import CoherentModes as CoherentModes
from .core.raw import RawImage as RawImage
from .core.stack import Stack as Stack
from .core.volume import Volume as Volume
from .deconvolution import deconvolve as deconvolve, deconvolve_series as deconvolve_series
from .elements import (
    CircularAperture as CircularAperture,
    LensletArray as LensletArray,
    RectangularAperture as RectangularAperture,
    ThinLens as ThinLens,
    Train as Train,
    ZernikePlate as ZernikePlate,
)
from .errors import (
    CalibrationError as CalibrationError,
    FormatError as FormatError,
    GeometryError as GeometryError,
    LumigraphError as LumigraphError,
    ParaxialWarning as ParaxialWarning,
    SamplingError as SamplingError,
    SamplingWarning as SamplingWarning,
)
from .instruments import (
    FocusedPlenopticCamera as FocusedPlenopticCamera,
    LightFieldMicroscope as LightFieldMicroscope,
    PlenopticCamera as PlenopticCamera,
    SingleLensCamera as SingleLensCamera,
    catalogue as catalogue,
    load_camera as load_camera,
)
from .metrology.scanning import find_shifts as find_shifts, joint_operator as joint_operator, scan as scan
from .io import contents as contents, open as open, save as save
from .studies import (
    adaptive as adaptive,
    information as information,
    optimisation as optimisation,
    tolerance as tolerance,
)
from .studies.optimisation import Goal as Goal, optimise as optimise
from .preparation import (
    PreparedImage as PreparedImage,
    decode as decode,
    prepare as prepare,
    render as render,
    render_stack as render_stack,
    super_resolve as super_resolve,
)
from .processing import process as process
from .propagation import (
    METHODS as METHODS,
    Propagate as Propagate,
    choose_method as choose_method,
    propagate as propagate,
)
from .rendering import (
    all_in_focus as all_in_focus,
    encode as encode,
    hot_pixels as hot_pixels,
    reduce_aperture as reduce_aperture,
    refocus as refocus,
    refocus_fourier as refocus_fourier,
    refocus_stack as refocus_stack,
    sub_aperture as sub_aperture,
    view_path as view_path,
)
from .scene import (
    ExtendedSource as ExtendedSource,
    GaussianSchell as GaussianSchell,
    Medium as Medium,
    Points as Points,
    Scene as Scene,
    Slice as Slice,
    SpectralLine as SpectralLine,
    targets as targets,
)
from .sensor import Sensor as Sensor, demosaic as demosaic
from .simulation import (
    Coherent as Coherent,
    Incoherent as Incoherent,
    PartiallyCoherent as PartiallyCoherent,
    Snapshots as Snapshots,
    Spectrum as Spectrum,
    TiltedWaves as TiltedWaves,
    simulate as simulate,
)
from .viewer import show as show, view_inline as view_inline

__version__: str
