"""Images of points before a lenslet array: light of a point, in the lenslet plane, behind it, on the sensor.

- `array_libraries`: array functions that the image of a point is computed with, by NumPy or autograd
- `main_lens`: wave of a point in the main lens; `stops`, its stop as places of the lenslets see it
- `point_light`, `exact_light`: amplitude in the lenslet plane; `exact_waves`, sums over directions
- `models`: lenslets by their model: `square`, `any_shape` and its `line_matrices`, `individual` ones that
  differ, `exact_square`; `no_lenslets`, light straight to the pixels
- `cameras`: sampling by a camera's model: `sampled_camera`, `exact_camera`
- `moving_point`, `gradient`: image of a point with derivatives by its place, and by a camera's parts
- `relay`: light through the lenslets to the image, cell by cell; `points`, raw images of points;
  `illuminated`, cells that a point lights; `point_changes`, changes by its place and the lens' phase
- `point_images`, `part_points`: points with derivatives by the parts of cameras; `tilted_planes`,
  `part_leaning`, arrays and sensors that lean
- `whole_planes`: planes with derivatives: `part_plane` behind lenslets that repeat, `film_plane` without
  lenslets, `plane_of_points` where no image repeats; `part_volume`, several planes; `sample_images`, an
  operator of each sample's image
- `cell_response`, `exact_lenslets`, `lenslet_light`: lenslets to one cell, for the lenslet-periodic operator;
  `cell_images`, images of a cell's points; `point_subset`, those from few of the points
- `wave_image`: image of one wave through all lenslets
- `paraxial_error`: error of the paraxial model
"""
