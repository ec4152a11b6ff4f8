"""Cameras calibrated from boards of known size.

- `corners`, `finding`, `chessboard`, `views`, `windows`, `order`: corners and dots on raw images
- `camera`, `geometry`, `calibration`, `adjustment`, `start`, `twofold`, `noise`, `known`: cameras and errors
- `rims`, `spill`, `waves`, `places`: effects of lenslets on corners
- `planning`, `printed`: poses to take, boards to print; `triangulation`, points in space
- `files`, `exchange`, `compote`, `lftoolbox`: files, also of other programs
"""
