"""What a raw image tells of points of light: Fisher information, and the least errors of any estimate.

- `bounds`: `bounds`, errors of place, depth and light over a volume; `Bounds`, the result
- `slopes`: `slopes`, how a bound changes with the parts of an instrument; `followed`, images of points that
  are followed back to these
- `points`: images of points and their derivatives by place, of any instrument
- `noise`: information of a pixel with photon and read noise
- `reconstruction`: `reconstruction_error`, what the best linear reconstruction of scenes leaves
- `reconstruction_slopes`: `reconstruction_slopes`, how that changes with the parts of a camera
- `reconstruction_trials`: `reconstruction_trials`, errors of drawn scenes' reconstructions
- `scenes`: `Scenes`, what pictures have in common; `imaging`, their raw images and the noise
- `trials`: `trials`, errors of the most likely places in drawn noise, to set beside the bounds
"""

from lumigraph.information.bounds import Bounds, Light, bounds
from lumigraph.information.noise import pixel_information
from lumigraph.information.reconstruction import ReconstructionError, reconstruction_error
from lumigraph.information.reconstruction_slopes import reconstruction_slopes
from lumigraph.information.reconstruction_trials import ReconstructionTrials, reconstruction_trials
from lumigraph.information.scenes import Scenes
from lumigraph.information.slopes import slopes
from lumigraph.information.trials import Trials, trials

__all__ = [
    "Bounds",
    "Light",
    "ReconstructionError",
    "ReconstructionTrials",
    "Scenes",
    "Trials",
    "bounds",
    "pixel_information",
    "reconstruction_error",
    "reconstruction_slopes",
    "reconstruction_trials",
    "slopes",
    "trials",
]
