"""
Aberrations over the field
==========================

A grid of points behind a lens whose coma grows with the field and whose focus bends with its square.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import deg, mm

angles = np.linspace(0, 1.2, 5)
table = {
    "field": [f"{angle} deg" for angle in angles],
    "unit": "waves",
    "terms": {8: list(0.3 * angles), 4: list(-0.2 * angles**2)},  # Noll's numbers, rms
}
ideal = lg.SingleLensCamera(
    wavelength="550 nm",
    object_distance="200 mm",
    main_lens={"focal_length": "100 mm", "diameter": "4 mm"},
    sensor={"pixel_pitch": "12 um", "shape": (501, 501)},
)
real = ideal.replace(main_lens={"over_field": table})

# %%
# Coma spreads towards the axis, the more the farther out; points in the corners are out of focus besides.

places = np.linspace(-2.6, 2.6, 5) * mm
points = lg.targets.points([(y, x) for y in places for x in places])
pictures = []
for camera, name in ((ideal, "ideal"), (real, "coma and field curvature")):
    raw = lg.simulate(camera, points, lg.Incoherent(1e-2))
    tiles = [
        np.asarray(raw.data)[round(250 + y / 12e-6) - 12 :, round(250 + x / 12e-6) - 12 :][:25, :25]
        for y in places
        for x in places
    ]
    picture = np.block([tiles[5 * k : 5 * k + 5] for k in range(5)])  # what lies around each point
    pictures.append(((picture / picture.max()) ** 0.4, name))
figure = lg.plots.images(pictures, columns=2)

# %%
# Every point is imaged by the lens of its own field. An extended object is imaged by a few lenses, of which
# all others are sums; the raw image states how far off that is.

print(raw.metadata["error"], f"farthest field {np.hypot(2.6, 2.6) * mm / 0.2 / deg:.2f} degrees")

# %%
# Look at each closely:

lg.view_inline(lg.Stack(np.stack([picture.astype(np.float32) for picture, _ in pictures])))
