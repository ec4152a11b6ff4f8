"""The nouns that everything else shares; verbs are functions on higher floors.

- `grid`: `Grid`, where samples stand
- `lattice`: `Lattice`, where lenslets stand, in a simulation [m] or on a white image [px]
- `field`: `Field`, a complex scalar wave on a grid
- `modes`: `CoherentModes`, partially coherent light as fields that never interfere
- `raw`: `RawImage`, what a sensor read out
- `calibration`: `Calibration`, the micro-images found on a raw image
- `warp`: `Warp`, tilt and distortion of their lattice
- `lightfield`: `LightField`, decoded radiance (v, u, t, s)
- `depth_map`: `DepthMap`, a depth for each place, and how sure it is
- `noun`: what the nouns share: NumPy, xarray and drawings; `labelled`: arrays with named axes
- `drawing`: where nouns find what draws them
- `picture`: thumbnails and tables for notebooks
- `volume`: `Volume`, reconstructed intensities (z, y, x)
- `stack`: `Stack`, pictures in an order; `cloud`: `PointCloud`, points in space
- `linear`: `Linear`, maps from objects to raw images and back; `joint`: `Joint`, several of one object;
  `matrix`: `Matrix`, one of given numbers
- `arrays`: the only file that knows array libraries
- `brief`: what a large object shows of itself in a few lines
- `checks`: one-line refusals of bad numbers
- `progress`: `Progress`, how far a computation has come, and what it needs; `notes`: which notes matter
- `cache`: arrays kept within a bound of memory
- `coverage`: fractions of samples that shapes cover
"""
