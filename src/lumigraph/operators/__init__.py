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

import lazy_loader

# Names load when they are first used: a description needs no operator, and no other kind of camera.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
