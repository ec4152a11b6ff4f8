"""
Rays through a camera
=====================

A camera file is all it takes: what is left out is computed, and every number names its equation.
"""

import lumigraph as lg

camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
figure = lg.plots.layout(camera)

# %%
# The numbers behind it:

print("\n".join(f"{row.name:38} {row.text}" for row in camera.describe().rows[:14]))

# %%
# Play with it; every length is a slider:
#
# .. code-block:: sh
#
#    lumigraph design thesis-plenoptic-2-m050 --web
