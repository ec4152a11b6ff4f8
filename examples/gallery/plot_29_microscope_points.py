"""
A point under a light-field microscope
======================================

In focus a point lights one lenslet; above and below, more and more of them. This is how one exposure
shows depth.
"""

import lumigraph as lg
from lumigraph.units import mm, nm, um

scope = lg.LightFieldMicroscope(
    wavelength=525 * nm,
    objective={"magnification": 20, "numerical_aperture": 0.5},
    lenslets={"pitch": 125 * um, "focal_length": 2.5 * mm, "count": (9, 9)},
    sensor={"pixel_pitch": 6.25 * um},
)
depths = (-60, -30, -10, 0, 10, 30)
pictures = [(scope.point_image(0.0, 0.0, dz * um, accuracy=1e-2) ** 0.4, f"{dz} µm") for dz in depths]
figure = lg.plots.images(pictures, columns=3)

# %%
# Play with it: move the point through the focus with a slider.
#
# .. code-block:: sh
#
#    lumigraph design lfm-worm --web
