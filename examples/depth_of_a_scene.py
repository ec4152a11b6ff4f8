"""Depth of a scene of two surfaces: disparities, metres, points in space.

Run: python examples/depth_of_a_scene.py
"""

import numpy as np

import lumigraph as lg


def texture(y, x, seed):
    rng = np.random.default_rng(seed)
    waves = zip(*rng.uniform(-0.9, 0.9, (2, 40)), rng.uniform(0, 2 * np.pi, 40), strict=True)
    return 8 + sum(np.cos(ky * y + kx * x + phase) for ky, kx, phase in waves)


def main() -> None:
    # A square nearer than the focused plane, before a slanted wall behind it: 7 x 7 views.
    v, u, y, x = np.meshgrid(*(np.arange(n) - n // 2 for n in (7, 7, 72, 80)), indexing="ij")
    slope = 0.01
    wall_x = (x + 0.5 * u) / (1 + slope * u)
    wall = texture(y - (slope * wall_x - 0.5) * v, wall_x, seed=1)
    near_y, near_x = y - 0.8 * v, x - 0.8 * u
    inside = (abs(near_y) < 16) & (abs(near_x) < 16)
    data = np.where(inside, texture(near_y, near_x, seed=2), wall)
    views = lg.LightField(data, lg.Grid((7, 7), 1e-3), lg.Grid((72, 80), 1e-4), separation=0.24)

    found = lg.depth.epi(views)
    truth = np.where(inside[3, 3], 0.8, slope * x[3, 3] - 0.5)
    print(f"disparity: median error {np.median(abs(found.values - truth)):.4f} px per view")

    depth = lg.depth.metric(found, views, focal_length=0.12)
    print(f"the square stands {-1e3 * np.median(depth.values[28:44, 32:48]):.1f} mm before the focused plane")
    picture = views.view(3, 3) / views.view(3, 3).max()
    lg.save(lg.depth.cloud(depth, views, object_distance=0.24, colours=picture), "points.ply")
    lg.save(found, "disparity.pfm")


if __name__ == "__main__":
    main()
