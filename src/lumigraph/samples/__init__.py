"""Sample data with truth, made by lumigraph itself; nothing is downloaded.

- `scene`: a light field of opaque things at known depths, with its disparity map
- `still_life`: what stands there, painted by functions of the place
- `portrait`: raw and white image of that scene before a plenoptic camera, by rays; `glowing`: its layers,
  which shine through one another, for microscopes
- `bench`: white and raw image of a plenoptic camera (1.0 or 2.0), with camera, scene and depths
- `volume`: raw image of a light-field microscope, with the volume that it shows
- `drawn`: randomly drawn scenes before a camera; `dataset`: many of them in one store
- `files`: their camera files, and a lens' prescription; `folder`: all of them as files
"""

from lumigraph.samples.bench import bench
from lumigraph.samples.dataset import dataset
from lumigraph.samples.drawn import drawn
from lumigraph.samples.files import lens_path
from lumigraph.samples.folder import write
from lumigraph.samples.portrait import glowing, portrait
from lumigraph.samples.scene import scene
from lumigraph.samples.volume import volume

__all__ = [
    "bench",
    "dataset",
    "drawn",
    "glowing",
    "lens_path",
    "portrait",
    "scene",
    "volume",
    "write",
]


def __dir__() -> list[str]:
    return __all__
