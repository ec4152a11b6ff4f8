"""Linear image formers: from objects to raw images, and back; each is a `core.linear.Linear`.

Storeys, from the lowest; each imports only from those before it, the last two not from each other:

- `sampling`: sizes decided once from plain numbers: `CameraOptics`, cells, grids, accuracies
- `single_lens`: `single_lens_operator`, incoherent planes and points before a camera without lenslets
- `lenslets`: images of points and planes before a camera, by any lenslets or none, with derivatives by its
  parts; `is_possible`, where lenslets can be exact
- `periodic`: `periodic_operator`, incoherent planes before a lenslet array, and its adjoint; white images,
  screens, coherent light
- `microscope`: volumes before light-field and Fourier light-field microscopes
"""

from lumigraph.operators.lenslets.paraxial_error import is_possible
from lumigraph.operators.periodic.incoherent import PeriodicOperator, periodic_operator
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics, Model
from lumigraph.operators.single_lens import SingleLensOperator, single_lens_operator

__all__ = [
    "CameraOptics",
    "HasOptics",
    "Model",
    "PeriodicOperator",
    "SingleLensOperator",
    "is_possible",
    "periodic_operator",
    "single_lens_operator",
]
