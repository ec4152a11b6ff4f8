"""
Views or resolution
===================

A camera 2.0 trades one for the other by the magnification of its lenslets. The closed forms behind the
curves stand in `camera.describe()`, each with its equation.
"""

import numpy as np

import lumigraph as lg

camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
magnifications = np.linspace(0.12, 1.0, 40)
found = {}
for m in magnifications:
    for row in camera.replace(lenslets={"magnification": float(m)}).trade_offs():
        found.setdefault(row.name, []).append(row.value)
views = lg.plots.curves(
    magnifications,
    {"views per axis": found["views per axis"]},
    xlabel="magnification of the lenslets", ylabel="views per axis", marks={"the thesis' camera": 0.5},
)  # fmt: skip
resolution = lg.plots.curves(
    magnifications,
    {
        "lateral": 1e6 * np.array(found["lateral resolution"]),
        "axial / 100": 1e4 * np.array(found["axial resolution"]),
    },
    xlabel="magnification of the lenslets", ylabel="resolved at the object [µm]", log=True,
)  # fmt: skip

# %%
# Play with it: sliders for every length, the drawing and the image of a point beside the curves.
#
# .. code-block:: sh
#
#    lumigraph design thesis-plenoptic-2-m050 --web
