"""Deconvolution: objects from raw images and a model of the camera, a `core.linear.Linear`.

- `deconvolve`: `deconvolve`; for time series `deconvolve_series`, `Deconvolver`
- `run`: `RunStep`, `Interrupted`
- `exposure`, `problem`: what is known of the raw image; model, sensitivity and deviance
- `methods`, `richardson_lucy`, `least_squares`: `Stop`, `RichardsonLucy`, `LeastSquares`
- `total_variation`, `wavelets`, `filters`: priors, and `LowPass`, against artefacts of the lenslets
- `together`, `side_by_side`: several raw images of one object; runs that share products of the operator
- `beyond`, `coarse`: objects that reach beyond the picture; a warning of too coarse samples
- `checkpoint`: `Checkpoint`, a file from which an interrupted run resumes
"""

from lumigraph.deconvolution.deconvolve import Deconvolver, deconvolve, deconvolve_series
from lumigraph.deconvolution.exposure import Exposure
from lumigraph.deconvolution.filters import LowPass
from lumigraph.deconvolution.least_squares import LeastSquares
from lumigraph.deconvolution.methods import Stop
from lumigraph.deconvolution.richardson_lucy import RichardsonLucy
from lumigraph.deconvolution.run import Interrupted
from lumigraph.deconvolution.total_variation import TotalVariation
from lumigraph.deconvolution.wavelets import Wavelets

__all__ = [
    "Deconvolver",
    "Exposure",
    "Interrupted",
    "LeastSquares",
    "LowPass",
    "RichardsonLucy",
    "Stop",
    "TotalVariation",
    "Wavelets",
    "deconvolve",
    "deconvolve_series",
]


def __dir__() -> list[str]:
    return __all__
