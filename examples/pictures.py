"""Pictures out of views: sharp all over with its depth, a moving point of view, a focal sweep.

Run: python examples/pictures.py [views.zarr]; without views, of a scene of two planes made up here.
"""

import sys

import numpy as np

import lumigraph as lg


def made_up() -> lg.LightField:
    """9 x 9 views of a near plane on the left and a far one on the right."""
    aperture, lenslets = lg.Grid((9, 9), 1.0), lg.Grid((120, 160), 1.0)
    v, u, t, s = np.meshgrid(aperture.y, aperture.x, lenslets.y, lenslets.x, indexing="ij")
    move = np.where(s < 0, 0.4, -0.3)  # lenslets per view: 1 - alpha
    y, x = t - v * move, s - u * move
    light = 2 + np.sin(0.5 * y + 0.2 * x) + np.sin(0.6 * x) * np.cos(0.35 * y)
    return lg.LightField(light.astype(np.float32), aperture, lenslets, 10.0)


def main(path: str | None = None) -> None:
    views = made_up() if path is None else lg.open(path)
    alphas = np.linspace(0.5, 1.5, 21)
    sharp = lg.all_in_focus(views, alphas)
    lg.save(sharp.picture, "sharp.png")
    lg.save(sharp.alpha, "alpha.tiff")
    lg.save(list(lg.refocus_stack(views, alphas)), "sweep.gif")
    lg.save(list(lg.view_path(views, 24, path="circle", alpha=0.6)), "around.gif")
    near, far = (float(np.median(part)) for part in np.array_split(sharp.alpha, 2, axis=1))
    print(f"refocus factors of the left and right half: {near:.2f}, {far:.2f}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
