"""Objects from raw images: what a camera must have seen, from a model of how it sees, a `core.linear.Linear`.

- `deconvolve`: `deconvolve`; for time series `deconvolve_series`, `Deconvolver`
- `run`: from the first state to the last; `Step`, `Interrupted`
- `side_by_side`: runs of several raw images that share each product of the operator
- `together`: several raw images of one object
- `beyond`: objects that reach beyond the picture, as far as light comes from
- `coarse`: a warning where samples are too coarse to explain a raw image
- `exposure`: `Exposure`, what is known of the raw image besides its values
- `problem`: the three put together: model, sensitivity, deviance
- `methods`: `Stop`, and what methods share
- `richardson_lucy`: `RichardsonLucy`
- `least_squares`: `LeastSquares`
- `total_variation`, `wavelets`: priors `TotalVariation` and `Wavelets`
- `filters`: `LowPass`, against artefacts of the lenslets
- `checkpoint`: `Checkpoint`, a file from which a killed run goes on
"""

from lumigraph.deconvolution.checkpoint import Checkpoint
from lumigraph.deconvolution.deconvolve import Deconvolver, deconvolve, deconvolve_series
from lumigraph.deconvolution.exposure import Exposure
from lumigraph.deconvolution.filters import LowPass
from lumigraph.deconvolution.least_squares import LeastSquares
from lumigraph.deconvolution.methods import Stop
from lumigraph.deconvolution.richardson_lucy import RichardsonLucy
from lumigraph.deconvolution.run import Interrupted, Step
from lumigraph.deconvolution.total_variation import TotalVariation
from lumigraph.deconvolution.wavelets import Wavelets

__all__ = [
    "Checkpoint",
    "Deconvolver",
    "Exposure",
    "Interrupted",
    "LeastSquares",
    "LowPass",
    "RichardsonLucy",
    "Step",
    "Stop",
    "TotalVariation",
    "Wavelets",
    "deconvolve",
    "deconvolve_series",
]
