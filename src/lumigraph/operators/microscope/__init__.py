"""Light-field microscopes: volumes to raw images, and the adjoint.

- `volume_operator`: `MicroscopeOperator`; `building`, how it is made from a description
- `kernels`, `waves`, `rays`, `bench`, `round_lenslets`: images of the points of a lenslet's cell
- `patterns`, `spectrum`, `transforms`, `tiles`: its factors; `sensor`, `pixels`, `samples`, `layout`: pixels
- `far_light`: light in far cells
- `pupil*`: images as functions of the pupil's phase; `medium`, `multislice`, refracting samples
- `fourier_*`: Fourier light-field microscopes
"""
