"""Raw images by wave optics, from a camera and a scene.

- `imaging`: `simulate`
- `coherence`: `Incoherent`, `Coherent`, `Snapshots`, `TiltedWaves`: how the scene's light interferes
"""

from lumigraph.simulation.coherence import Coherence, Coherent, Incoherent, Snapshots, TiltedWaves
from lumigraph.simulation.imaging import Camera, Interrupted, simulate

__all__ = [
    "Camera",
    "Coherence",
    "Coherent",
    "Incoherent",
    "Interrupted",
    "Snapshots",
    "TiltedWaves",
    "simulate",
]
