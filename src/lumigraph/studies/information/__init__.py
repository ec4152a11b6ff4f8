"""Fisher information of a raw image about points of light, and the least errors of any estimate.

- `bounds`: `bounds`, errors of place, depth and light over a volume; `noise`, information of a pixel
- `slopes`: `slopes`, derivatives of a bound by an instrument's parts; `followed`, its way back
- `points`: images of points and their derivatives by place, of any instrument
- `reconstruction`: `reconstruction_error`, what the best linear reconstruction of `Scenes` leaves
- `reconstruction_slopes`, `reconstruction_trials`: its derivatives; errors of drawn scenes
- `unknown_depth`: `unknown_depth`, the best linear rule for scenes whose depth is not known
- `trials`: `trials`, errors of the most likely places in drawn noise, to compare with the bounds
"""

from lumigraph.studies.information.bounds import Bounds, Light, bounds
from lumigraph.studies.information.reconstruction import reconstruction_error
from lumigraph.studies.information.reconstruction_slopes import reconstruction_slopes
from lumigraph.studies.information.reconstruction_trials import reconstruction_trials
from lumigraph.studies.information.scenes import Scenes
from lumigraph.studies.information.slopes import slopes
from lumigraph.studies.information.trials import Trials, trials
from lumigraph.studies.information.unknown_depth import TrainedRule, unknown_depth, unknown_depth_trials

__all__ = [
    "Bounds",
    "Light",
    "Scenes",
    "TrainedRule",
    "Trials",
    "bounds",
    "reconstruction_error",
    "reconstruction_slopes",
    "reconstruction_trials",
    "slopes",
    "trials",
    "unknown_depth",
    "unknown_depth_trials",
]


def __dir__() -> list[str]:
    return __all__
