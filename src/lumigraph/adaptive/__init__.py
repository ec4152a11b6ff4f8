"""Digital adaptive optics: an instrument's aberrations from the light field itself, together with the object.

- `estimate`: `estimate`, from a raw image of beads or of any object
- `start`: `start`, a first wavefront from the shifts of views; `Slopes`, its result
- `sense`: `sense`, of a plenoptic camera before a point of light; `star`: its images by coefficients
- `wavefront`: `Wavefront`, the result; `wavefront_map`, Zernike terms over the pupil
- `of_beads`: of beads, points or balls
- `of_volume`: of any object; `scene`: a volume or picture before its instrument
- `sight`: operators by coefficients; `voxels`: steps on volume and coefficients
- `field`: nodes of the field at which coefficients stand
- `search`: beads of a raw image through a wavefront; `beads`: of a volume; `changes`: what beads tell
- `fit`: beads and coefficients by steps of Levenberg and Marquardt; `images`: of one bead, a point or a ball
- `known`: how well coefficients are known that were found with beads
- `clusters`: deviations that hold what the object does not explain; `misfit`: the warning of it
- `worth`: which terms stay; `checked`: what is asked for
"""

from lumigraph.adaptive.estimate import TERMS, estimate
from lumigraph.adaptive.sense import MODES, sense
from lumigraph.adaptive.start import Slopes, start
from lumigraph.adaptive.wavefront import Wavefront, wavefront_map

__all__ = ["MODES", "TERMS", "Slopes", "Wavefront", "estimate", "sense", "start", "wavefront_map"]
