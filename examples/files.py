"""What lumigraph reads and writes: a folder of views, a mosaic, a stack, a film, a volume, points in space.

Run: python examples/files.py
"""

import numpy as np

import lumigraph as lg


def cameras(rows: int, columns: int) -> lg.LightField:
    """Views of a bright square before a pattern, as a grid of cameras would see them."""
    y, x = np.mgrid[:90, :120]
    views = np.zeros((rows, columns, 90, 120, 3), np.uint8)
    for v in range(rows):
        for u in range(columns):
            pattern = 60 + 50 * np.sin(x / 4) * np.cos(y / 5)
            near = (abs(y - 45 - 2 * (v - rows // 2)) < 14) & (abs(x - 60 - 2 * (u - columns // 2)) < 14)
            views[v, u] = np.where(near[..., None], (250, 190, 60), pattern[..., None])
    return lg.LightField(views, lg.Grid((rows, columns), (1.0, 1.0)), lg.Grid((90, 120), (0.01, 0.01)), 20.0)


def main() -> None:
    views = cameras(5, 5)
    lg.save(views, "views")  # a folder: view_00_00.png is seen from the top left
    lg.save(views, "mosaic_eslf.png")
    same = lg.open("mosaic_eslf.png", views=5)
    print(f"{same.data.shape} (v, u, t, s, c), as in the folder: {np.array_equal(same.data, views.data)}")

    alphas = np.linspace(0.97, 1.01, 9)
    planes = np.stack([lg.refocus(views, alpha, oversample=1) for alpha in alphas])
    lg.save(lg.Stack(planes, alphas, "alpha"), "focus.ome.tiff")
    lg.save(lg.Stack(planes), "focus.gif", fps=6)
    print(lg.contents("focus.ome.tiff")[0].about)

    volume = lg.Volume(planes[..., 0], lg.Grid((90, 120), (1e-6, 1e-6)), np.arange(9) * 2e-6)
    lg.save(volume, "volume.ome.zarr")
    print(f"spacing of the volume [m]: {lg.open('volume.ome.zarr').spacing}")

    y, x = np.mgrid[:90, :120]
    z = np.where((abs(y - 45) < 14) & (abs(x - 60) < 14), 0.5, 1.0)
    points = np.stack([z, (y - 45) * z / 100, (x - 60) * z / 100], -1).reshape(-1, 3)
    lg.save(lg.PointCloud(points, views.view(2, 2).reshape(-1, 3)), "points.ply")


if __name__ == "__main__":
    main()
