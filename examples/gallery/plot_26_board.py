"""
A camera measured with a board
==============================

`lumigraph.metrology.board` finds the lengths of a plenoptic camera from the corners of a board, each with its
uncertainty. Here the corners are drawn through a known camera, with noise of 0.3 pixels, so that the answer
can be checked.
"""

import numpy as np

import lumigraph as lg
from lumigraph.metrology import Board, Corners, MetricCamera, Nominal
from lumigraph.metrology.boards import geometry
from lumigraph.units import mm, um

target = Board((5, 7), 10 * mm)
truth = MetricCamera(50 * mm, 57 * mm, 0.42 * mm, 45 * mm, 5.5 * um, (1540.0, 2060.0))
lenslets = np.mgrid[60:3000:24, 60:4000:24].reshape(2, -1).T  # centres of micro-images [px]
centers = lenslets[::4]  # enough of them for the board
rng, rows = np.random.default_rng(1), []
for frame in range(5):
    lean = (rng.uniform(-0.1, 0.1), *rng.uniform(-0.6, 0.6, 2)) if frame else (0.0, 0.0, 0.0)
    place = (rng.uniform(0.22, 0.33), -0.02, -0.03)
    for corner, point in enumerate(geometry.moved(target.points(), np.array([*lean, *place]))):
        shown = truth.project(point, centers)
        lit = np.hypot(*(shown - centers).T) < 10  # pixels: a micro-image's radius
        found = shown[lit] + rng.normal(0, 0.3, (lit.sum(), 2))
        rows += [(frame, corner, *at, *center) for at, center in zip(found, centers[lit], strict=True)]
table = np.array(rows)
whole = table[:, :2].astype(int)
corners = Corners(whole[:, 0], whole[:, 1], table[:, 2:4], table[:, 4:6], np.zeros(len(table), int))
lg.metrology.save_corners(corners, "corners.csv")
measured = lg.metrology.board(corners, target, Nominal(50 * mm, 5.5 * um, (3068, 4080)))

# %%
# What was found, each with the interval that holds it with a probability of 95 %:

for quantity in measured.quantities()[:6]:
    print(f"{quantity.label}: {quantity}")

# %%
# A point that several lenslets show then has a place in space. Its expected error holds that of the camera,
# which all points share: a camera measured from other pictures moves them all alike, by some 8 mm.

errors, expected = [], []
distances = np.linspace(0.2, 0.32, 13)
for z in distances:
    point = np.array([z, 0.0, 0.0])
    shown = truth.project(point, lenslets)
    lit = np.hypot(*(shown - lenslets).T) < 10
    seen = shown[lit] + rng.normal(0, 0.3, (lit.sum(), 2))
    found = lg.metrology.triangulate(measured, seen, lenslets[lit])
    errors.append(abs(found.position[0] - z))
    expected.append(found.errors[0])
figure = lg.plots.curves(
    distances / mm, {"expected error": np.array(expected) / mm, "true error": np.array(errors) / mm},
    xlabel="distance [mm]", ylabel="error in depth [mm]",
)  # fmt: skip

# %%
# `lumigraph board` does the same with a table of corners, such as the one saved here:
#
# .. code-block:: sh
#
#    lumigraph board corners.csv --board "7 x 5 corners, 10 mm" --focal-length "50 mm" \
#        --pixel-pitch "5.5 um" --shape 3068 4080 -o camera.json
