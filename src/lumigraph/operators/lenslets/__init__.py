"""Images of points before a camera: light in the main lens → in the lenslet plane → behind the lenslets.

One chain of pure steps. Sampling is decided once from plain numbers; all else are arrays computed from a
camera's numbers, with nothing written in place, by the functions of an array library.

- `array_libraries`: the functions that the chain calls, NumPy's or autograd's, and derivatives by these
- `illuminated`: cells that a point lights; `sampled_camera`, how finely all is sampled before
  a point; `exact_camera`, beyond the paraxial; `no_lenslets`; `cameras`, which of them a camera is
- `main_lens`: the wave in the main lens, whose stop is sampled with smooth edges
- lenslets: `square`, alike; `individual`, each its own; `any_shape`, by `line_matrices`; `exact_square`,
  beyond the paraxial; `models`, which of them an array has
- `point_images`: raw images with derivatives between cameras; `gradient`, what these come to; `moving_point`,
  derivatives by a point's place
"""
