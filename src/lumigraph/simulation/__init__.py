"""Raw images by wave optics, from a camera and a scene.

- `imaging`: `simulate`
- `periodic`: `periodic_operator`, incoherent planes before a lenslet array, and its adjoint
- `kernels`: its matrices; `optics`, what they depend on; `blocks`, how they are made, in factors; `cells`,
  what they are matrices between; `point_images`, where they come from; `cell_response`, what lenslets do to
  light; `glare`, what falls far from a point's image
- `resampling`, `turning`: from an object's samples to points and from the image's samples to pixels
- `slices`: `Slices`, operators of several depths as one
- `spectrum`: `Spectrum`, light of several wavelengths, colour sensors; `Mixed`, its operator
- `single_lens`: `single_lens_operator`, incoherent planes and points before a camera without lenslets
- `microscope_operator`: volumes before a light-field microscope; `microscope_kernels`, images of a cell's
  points; `microscope_rays`, the same by rays; `microscope_spectrum`, the lenslets' frequencies;
  `microscope_pixels`, real pixels; `microscope_scene`, scenes before one; `fourier_microscope`
- `band`: band-limited samples along an axis, to and from points and pixels
- `camera`: `Camera`, what a simulation asks of an instrument
- `coherence`: `Incoherent`, `Coherent`, `Snapshots`, `TiltedWaves`: how the scene's light interferes
- `directions`: quasi-random directions of tilted waves, more of them where more light comes from
"""

from lumigraph.simulation.camera import Camera
from lumigraph.simulation.coherence import Coherence, Coherent, Incoherent, Snapshots, TiltedWaves
from lumigraph.simulation.imaging import Interrupted, simulate
from lumigraph.simulation.periodic import PeriodicOperator, periodic_operator
from lumigraph.simulation.single_lens import SingleLensOperator, single_lens_operator
from lumigraph.simulation.slices import Slices
from lumigraph.simulation.spectrum import Mixed, Spectrum

__all__ = [
    "Camera",
    "Coherence",
    "Coherent",
    "Incoherent",
    "Interrupted",
    "Mixed",
    "PeriodicOperator",
    "SingleLensOperator",
    "Slices",
    "Snapshots",
    "Spectrum",
    "TiltedWaves",
    "periodic_operator",
    "simulate",
    "single_lens_operator",
]
