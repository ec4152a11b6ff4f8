"""A warning where a deconvolution leaves far more than noise, and its samples may be too coarse."""

import warnings

from lumigraph.core import arrays, picture
from lumigraph.deconvolution.methods import State
from lumigraph.deconvolution.run import Run
from lumigraph.errors import SamplingWarning

FAR = 2.0
"""Limit of the deviance, over what noise and the operator's error leave, above which something is wrong.

Before a 20x/0.5 microscope with 7 x 7 lenslets, textures of 0.27 to 1.2 lenslets at 300 electrons a pixel are
explained with 15 samples a lenslet: the limit is at most 1.6 after 5 to 100 iterations, with and without
momentum. In focus it is 6 to 8 with 5 samples, 2.1 to 4.6 with 9; 8 um out of focus at most 1.5 with 5.
"""

SLOW = 2.0
"""Deviances fall as 1/k, or as slowly as 1/√k, towards their limit: what the kth step took off, times k and
this, is still to go."""


def warn_of_coarse_samples(run: Run, state: State) -> None:
    """Warn where more iterations would not explain the raw image, and finer samples might.

    Warns
    -----
    SamplingWarning
        What is left exceeds `FAR` times what noise explains, and samples are coarser than the instrument
        resolves. Only where the gain is known, and the operator knows its samples.
    """
    operator = run.wanted[0]
    grid, resolved = operator.object_grid, operator.resolved_pitch
    if not run.counted or grid is None or resolved is None or max(grid.pitch) <= resolved:
        return
    limit, noise = state.deviance - SLOW * state.done * max(run.fall, 0.0), _expected(run, state)
    if limit > FAR * noise:
        warnings.warn(
            f"the object found leaves a deviance of {state.deviance:.3g} per pixel, where noise leaves "
            f"{noise:.2g}, and more iterations would leave {limit:.3g} or more: it does not explain the raw "
            f"image. Its samples are {picture.length(max(grid.pitch))} apart, the instrument resolves those "
            f"of {picture.length(resolved)}. Build its operator with more samples_per_lenslet, up to "
            f"{max(grid.pitch) / resolved:.2g} times as many. If that changes little, check depths, "
            "calibration, aberrations, gain and prior.",
            SamplingWarning,
            stacklevel=5,
        )


def _expected(run: Run, state: State) -> float:
    """Deviance per pixel that noise, and the error of the operator, leave."""
    scale, model = run.problem.scale, state.model
    xp = arrays.namespace(model)
    bright = float(xp.sum(model**2)) / float(xp.sum(model))
    return 1 + scale.gain * run.wanted[0].error ** 2 * bright
