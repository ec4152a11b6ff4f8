"""Digital adaptive optics: a microscope's aberrations from the light field itself, together with the object.

- `estimate`: `estimate`, from a raw image of beads or of any object
- `start`: `start`, a first wavefront from the shifts of views; `Slopes`, its result
- `wavefront`: `Wavefront`, the result; `wavefront_map`, Zernike terms over the pupil
- `of_volume`: of any object; `sight`: operators by coefficients; `voxels`: steps on volume and coefficients
- `field`: nodes of the field at which coefficients stand
- `fit`: beads and coefficients by steps of Levenberg and Marquardt; `beads`: beads of a volume
- `worth`: which terms stay; `checked`: what is asked for
"""

from lumigraph.adaptive.estimate import TERMS, estimate
from lumigraph.adaptive.start import Slopes, start
from lumigraph.adaptive.wavefront import Wavefront, wavefront_map

__all__ = ["TERMS", "Slopes", "Wavefront", "estimate", "start", "wavefront_map"]
