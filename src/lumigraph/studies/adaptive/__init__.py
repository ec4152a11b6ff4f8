"""Digital adaptive optics: an instrument's aberrations from the light field itself, together with the object.

- `estimate`: aberrations from a raw image of beads (`of_beads`) or of any object (`of_volume`)
- `start`, `sense`: a first wavefront from the shifts of views; the wavefront before a camera (`star`)
- `wavefront`: `Wavefront`, the result; `wavefront_map`, Zernike terms over the pupil
- `scene`, `sight`, `voxels`: the object, its operators by coefficients, steps on volume and coefficients
- `beads`, `search`, `changes`, `fit`, `images`: beads, their images and the steps of Levenberg and Marquardt
- `field`, `known`, `clusters`: nodes of the field; uncertainty by noise and by unexplained light
- `misfit`, `worth`, `checked`: the goodness of fit; selection of terms; checks of arguments
"""

from lumigraph.studies.adaptive.estimate import estimate
from lumigraph.studies.adaptive.sense import sense
from lumigraph.studies.adaptive.start import start
from lumigraph.studies.adaptive.wavefront import Wavefront, wavefront_map

__all__ = ["Wavefront", "estimate", "sense", "start", "wavefront_map"]


def __dir__() -> list[str]:
    return __all__
