"""Refocus pictures of your own plenoptic 1.0 camera from a raw and a white image.

Run: python examples/real_camera.py white.png raw.png
"""

import sys

import numpy as np

import lumigraph as lg


def main(white_path: str, raw_path: str) -> None:
    white, raw = lg.open(white_path), lg.open(raw_path)
    calibration = lg.calibrate(white)
    print(calibration.report())
    lg.plots.lattice(white, calibration).savefig("lattice.png")

    views = lg.decode(lg.devignette(raw, white), calibration)
    for alpha in np.linspace(0.9, 1.1, 9):
        lg.save(lg.refocus(views, alpha), f"refocused_{alpha:.3f}.png")


if __name__ == "__main__":
    main(*sys.argv[1:3])
