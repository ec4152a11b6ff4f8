"""Cameras: what is given is checked, what is left out computed, and simulations get their grids and trains.

- `single_lens`: `SingleLensCamera`
- `plenoptic1`: `PlenopticCamera`, lenslets at the main-lens image
- `plenoptic2`: `FocusedPlenopticCamera`, lenslets that relay the main-lens image
- `microscope`: `LightFieldMicroscope` and its operator; `microscope_objective`: its `MicroscopeObjective`
- `with_parts`, `scope_with_parts`: derivatives of images by what differs between two cameras, or microscopes;
  `sees_volumes`: of volumes
- `parts`: `MainLens`, `Pixels`, and `lenslets`: `Lenslets`: the tables of a camera file
- `built`: `Built`, distances as built; `tolerances`: `Tolerance`, how far values may be off
- `loading`: `load_camera` for every kind
- `instrument`, `camera`, `lenslet_camera`: what the kinds share; `capabilities`: what some of them can do
- `parameters`: what a designer can change; `point_view`: a point's image at once
- `grids`: how finely and widely planes are sampled
- `description`: `Description`, rows of quantities (`Row`), which `lumigraph.describe` makes
- `quantities`, `problems`, `files`: numbers with units, errors in one line, TOML and the `catalogue`
"""

import lazy_loader

# Names load when they are first used: a description needs no operator, and no other kind of camera.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
