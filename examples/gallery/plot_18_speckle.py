"""
Speckle, and how slowly it goes
===============================

Images of incoherent light are often computed as the mean of snapshots with random phases. Speckle falls as
one over the root of their number. `lumigraph.Incoherent`, the default, leaves none.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

camera = lg.SingleLensCamera(
    wavelength=633 * nm,
    object_distance=316 * mm,
    main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
    sensor={"pixel_pitch": 10 * um, "shape": [100, 100]},
)
bars = lg.targets.gratings(camera.object_grid, (3e3, 6e3, 12e3))
exact = lg.simulate(camera, bars)
counts = (4, 16, 64, 256)
raws = [lg.simulate(camera, bars, lg.Snapshots(count, rng=1)) for count in counts]
pictures = [(raw.data, f"{count} snapshots") for raw, count in zip(raws[:3], counts[:3], strict=True)]
figure = lg.plots.images([*pictures, (exact.data, "exact")], columns=4)

# %%
# The error that each raw image estimates of itself, beside the one that it has.

errors = [np.linalg.norm(raw.data - exact.data) / np.linalg.norm(exact.data) for raw in raws]
estimated = [raw.metadata["estimated_error"] for raw in raws]
curve = lg.plots.curves(
    np.log2(counts), {"true": errors, "estimated": estimated},
    xlabel="snapshots [powers of 2]", ylabel="relative rms error", log=True,
)  # fmt: skip

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph simulate thesis-2f --scene gratings --coherence snapshots --count 16 -o speckle.tiff
#    lumigraph view speckle.tiff
