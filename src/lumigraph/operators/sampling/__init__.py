"""Sampling of operators, decided once from plain numbers; no waves here.

- `camera`: `CameraOptics`, the numbers of an instrument that operators read
- `sampling_rules`: grid sizes that an accuracy asks for; `optics`, sizes for one depth
- `cells`, `cell_axis`: cells of a lenslet array; `tiles`, planes on them; `border_classes`, equal neighbours
- `time_limits`: limits on operations
- `band`, `resampling`, `regrid`, `rotate_by_shears`: band-limited samples, from one grid to another
- `sample_weights`: weights of object samples
- `field_lenses`, `glass_distortion`: main lenses that change over the field, places seen through glass
"""
