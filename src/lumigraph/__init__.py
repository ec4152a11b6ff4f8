"""Light-field cameras and microscopes: design them, simulate their raw images, process raw images.

The everyday names, listed one by one; each is imported when it is first used, so that ``import lumigraph``
stays quick. Nothing inside the package imports this module.

>>> import lumigraph as lg
>>> camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
>>> round(camera.lenslet_distance * 1e3, 3)
7.8
"""

from importlib import import_module

from lumigraph.core import drawing

__version__ = "0.1.0"

TYPE_CHECKING = False  # `typing` takes ten times as long as all of this
if TYPE_CHECKING:
    from typing import Any

    from lumigraph import analysis, depth, design, metric, plots, samples, units
    from lumigraph.calibration import calibrate, devignette
    from lumigraph.core.calibration import Calibration
    from lumigraph.core.cloud import PointCloud
    from lumigraph.core.depth_map import DepthMap
    from lumigraph.core.field import Field
    from lumigraph.core.grid import Grid
    from lumigraph.core.lattice import Lattice
    from lumigraph.core.lightfield import LightField
    from lumigraph.core.raw import RawImage
    from lumigraph.core.stack import Stack
    from lumigraph.core.volume import Volume
    from lumigraph.deconvolution import deconvolve, deconvolve_series
    from lumigraph.elements import (
        CircularAperture,
        LensletArray,
        RectangularAperture,
        ThinLens,
        Train,
        ZernikePlate,
    )
    from lumigraph.errors import (
        CalibrationError,
        FormatError,
        GeometryError,
        LumigraphError,
        SamplingError,
        SamplingWarning,
    )
    from lumigraph.instruments import (
        FocusedPlenopticCamera,
        LightFieldMicroscope,
        PlenopticCamera,
        SingleLensCamera,
        catalogue,
        load_camera,
    )
    from lumigraph.io import contents, open, save  # noqa: A004
    from lumigraph.preparation import PreparedImage, decode, prepare, render, render_stack, super_resolve
    from lumigraph.propagation import METHODS, Propagate, choose_method, propagate
    from lumigraph.rendering import (
        all_in_focus,
        encode,
        hot_pixels,
        reduce_aperture,
        refocus,
        refocus_fourier,
        refocus_stack,
        view,
        view_path,
    )
    from lumigraph.scene import Points, Scene, Slice, targets
    from lumigraph.sensor import Sensor, demosaic
    from lumigraph.simulation import Coherent, Incoherent, Snapshots, Spectrum, TiltedWaves, simulate
    from lumigraph.viewer import view_inline

_HOMES = {
    "lumigraph": ("analysis", "depth", "design", "metric", "plots", "samples", "units"),
    "lumigraph.calibration": ("calibrate", "devignette"),
    "lumigraph.core.calibration": ("Calibration",),
    "lumigraph.core.cloud": ("PointCloud",),
    "lumigraph.core.depth_map": ("DepthMap",),
    "lumigraph.core.field": ("Field",),
    "lumigraph.core.grid": ("Grid",),
    "lumigraph.core.lattice": ("Lattice",),
    "lumigraph.core.lightfield": ("LightField",),
    "lumigraph.core.raw": ("RawImage",),
    "lumigraph.core.stack": ("Stack",),
    "lumigraph.core.volume": ("Volume",),
    "lumigraph.deconvolution": ("deconvolve", "deconvolve_series"),
    "lumigraph.elements": (
        "CircularAperture",
        "LensletArray",
        "RectangularAperture",
        "ThinLens",
        "Train",
        "ZernikePlate",
    ),
    "lumigraph.errors": (
        "CalibrationError",
        "FormatError",
        "GeometryError",
        "LumigraphError",
        "SamplingError",
        "SamplingWarning",
    ),
    "lumigraph.instruments": (
        "FocusedPlenopticCamera",
        "LightFieldMicroscope",
        "PlenopticCamera",
        "SingleLensCamera",
        "catalogue",
        "load_camera",
    ),
    "lumigraph.io": ("contents", "open", "save"),
    "lumigraph.preparation": (
        "PreparedImage",
        "decode",
        "prepare",
        "render",
        "render_stack",
        "super_resolve",
    ),
    "lumigraph.propagation": ("METHODS", "Propagate", "choose_method", "propagate"),
    "lumigraph.rendering": (
        "all_in_focus",
        "encode",
        "hot_pixels",
        "reduce_aperture",
        "refocus",
        "refocus_fourier",
        "refocus_stack",
        "view",
        "view_path",
    ),
    "lumigraph.scene": ("Points", "Scene", "Slice", "targets"),
    "lumigraph.sensor": ("Sensor", "demosaic"),
    "lumigraph.simulation": ("Coherent", "Incoherent", "Snapshots", "Spectrum", "TiltedWaves", "simulate"),
    "lumigraph.viewer": ("view_inline",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "METHODS",
    "Calibration",
    "CalibrationError",
    "CircularAperture",
    "Coherent",
    "DepthMap",
    "Field",
    "FocusedPlenopticCamera",
    "FormatError",
    "GeometryError",
    "Grid",
    "Incoherent",
    "Lattice",
    "LensletArray",
    "LightField",
    "LightFieldMicroscope",
    "LumigraphError",
    "PlenopticCamera",
    "PointCloud",
    "Points",
    "PreparedImage",
    "Propagate",
    "RawImage",
    "RectangularAperture",
    "SamplingError",
    "SamplingWarning",
    "Scene",
    "Sensor",
    "SingleLensCamera",
    "Slice",
    "Snapshots",
    "Spectrum",
    "Stack",
    "ThinLens",
    "TiltedWaves",
    "Train",
    "Volume",
    "ZernikePlate",
    "all_in_focus",
    "analysis",
    "calibrate",
    "catalogue",
    "choose_method",
    "contents",
    "decode",
    "deconvolve",
    "deconvolve_series",
    "demosaic",
    "depth",
    "design",
    "devignette",
    "encode",
    "hot_pixels",
    "load_camera",
    "metric",
    "open",
    "plots",
    "prepare",
    "propagate",
    "reduce_aperture",
    "refocus",
    "refocus_fourier",
    "refocus_stack",
    "render",
    "render_stack",
    "samples",
    "save",
    "simulate",
    "super_resolve",
    "targets",
    "units",
    "view",
    "view_inline",
    "view_path",
]


def __getattr__(name: str) -> "Any":
    if name not in _HOME:
        raise AttributeError(f"module 'lumigraph' has no attribute {name!r}")
    home = _HOME[name]
    value = import_module(f"{home}.{name}") if home == "lumigraph" else getattr(import_module(home), name)
    globals()[name] = value
    return value


drawing.done_by(lambda: __getattr__("plots"))


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
