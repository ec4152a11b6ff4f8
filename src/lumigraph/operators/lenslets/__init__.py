"""Images of points before a lenslet array: light of a point, in the lenslet plane, behind it, on the sensor.

- `point_light`, `exact_light`: amplitude in the lenslet plane
- `cell_response` (square), `lines` (any shape), `individual_lenslets`, `exact_lenslets`: lenslets
- `relay`: light through the lenslets to the image, cell by cell
- `points`: raw images of points; `part_*`, `whole_planes`: the same with derivatives by camera parameters
- `stops`, `tilted_planes`: stops of lenses of glass, tilted arrays
- `paraxial_error`: error of the paraxial model
"""
