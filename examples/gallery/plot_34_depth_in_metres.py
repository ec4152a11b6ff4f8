"""
Depth in metres
===============

Of a camera whose lengths are known, disparities become distances, and every pixel a point in space.
"""

import lumigraph as lg

sample = lg.samples.scene((128, 170))
found = lg.depth.epi(sample.views)
depth = lg.depth.metric(found, sample.views, focal_length=0.045)
points = lg.depth.cloud(depth, sample.views, object_distance=0.18, colours=sample.views.view(4, 4))
lg.save(points, "points.ply")
distances = lg.plots.show(depth, title="depth, farther is above 0")
confidence = lg.plots.show(found.confidence, title="confidence")
print(f"{len(points)} points in points.ply")

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph samples make -o samples
#    lumigraph depth samples/scene.zarr --focal-length "45 mm" -o points.ply
