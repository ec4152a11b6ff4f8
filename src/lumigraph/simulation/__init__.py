"""Raw images by wave optics, from a camera and a scene; linear images are formed by `operators`.

- `imaging`: `simulate`
- `exact`: parts of a scene that need no shots; `hiding`, those behind opaque slices
- `shots`: slices in light that interferes, field after field
- `light`: what arrives on the sensor, and the raw image of it
- `microscope_scene`: scenes before a light-field microscope
- `spectrum`: `Spectrum`, light of several wavelengths, colour sensors
- `curves`: spectra and filters as curves, by few wavelengths
- `coherence`: `Incoherent`, `Coherent`, `PartiallyCoherent`, `Snapshots`, `TiltedWaves`: how light interferes
- `known_planes`: `plane_views`, textured planes at known depths
- `directions`: quasi-random directions of tilted waves, more of them where more light comes from
"""

from lumigraph.simulation.coherence import (
    Coherence,
    Coherent,
    Incoherent,
    PartiallyCoherent,
    Snapshots,
    TiltedWaves,
)
from lumigraph.simulation.imaging import Interrupted, simulate
from lumigraph.simulation.known_planes import plane_views
from lumigraph.simulation.spectrum import Spectrum

__all__ = [
    "Coherence",
    "Coherent",
    "Incoherent",
    "Interrupted",
    "PartiallyCoherent",
    "Snapshots",
    "Spectrum",
    "TiltedWaves",
    "plane_views",
    "simulate",
]


def __dir__() -> list[str]:
    return __all__
