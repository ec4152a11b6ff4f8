"""Light-field microscopes: volumes to raw images, and the adjoint.

- `volume_operator`: `MicroscopeOperator`; `building`, how it is made from a description
- `cell`: a lenslet and its cell; `layout`, lenslets and pixels of a raw image
- `kernels`: images of the points of a lenslet's cell: `bench`, `waves` on it, `round_lenslets`; `rays`
- `patterns`: even and odd patterns of cells; `spectrum`, `transforms`, `tiles`, convolution over lenslets;
  `far_light`, light in far cells
- `sensor`, `pixels`, `samples`: patterns to a real camera's pixels
- `pupil`: images as functions of the pupil's phase; `pupil_waves`, its waves behind lenslets; `pupil_points`,
  points with derivatives; `pupil_plane`, planes, by `pupil_cells`, the waves of a cell's points
- `medium`, `multislice`: points seen through a refracting sample
- `fourier_microscope`: Fourier light-field microscopes; `fourier_points`, `fourier_plane`, points and planes
  with derivatives, by `fourier_changes`
"""

import lazy_loader

# Names load when they are first used: a description needs no operator, and no other kind of camera.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
