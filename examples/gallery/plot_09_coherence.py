"""
The same star in coherent and incoherent light
==============================================

Coherent light resolves half as far and rings at edges; incoherent light has no speckle here, because the
image is computed exactly and not from random snapshots.
"""

import lumigraph as lg
from lumigraph.units import mm, nm, um

camera = lg.SingleLensCamera(
    wavelength=633 * nm,
    object_distance=316 * mm,
    main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
    sensor={"pixel_pitch": 10 * um, "shape": [120, 120]},
)
star = lg.targets.siemens_star(camera.object_grid)
lights = (
    (lg.Coherent(), "coherent"),
    (lg.Snapshots(20, rng=1), "20 random snapshots"),
    (lg.Incoherent(), "incoherent"),
)
figure = lg.plots.images([(lg.simulate(camera, star, light).data, name) for light, name in lights], columns=3)

# %%
# Play with both, side by side:
#
# .. code-block:: sh
#
#    lumigraph simulate thesis-2f --scene siemens_star --coherence coherent -o coherent.tiff
#    lumigraph simulate thesis-2f --scene siemens_star -o incoherent.tiff
#    lumigraph view coherent.tiff incoherent.tiff
