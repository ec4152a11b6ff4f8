"""Digital adaptive optics: a microscope's aberrations from the light field itself, together with the object.

- `estimate`: `estimate`, from a raw image of beads
- `wavefront`: `Wavefront`, the result; `wavefront_map`, Zernike terms over the pupil
- `field`: nodes of the field at which coefficients stand
- `fit`: beads and coefficients by steps of Levenberg and Marquardt
- `beads`: beads of a volume
"""

from lumigraph.adaptive.estimate import TERMS, estimate
from lumigraph.adaptive.wavefront import Wavefront, wavefront_map

__all__ = ["TERMS", "Wavefront", "estimate", "wavefront_map"]
