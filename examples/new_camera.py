"""Simulate a focused plenoptic camera that does not exist yet, and render its picture.

Run: python examples/new_camera.py
"""

import lumigraph as lg
from lumigraph.units import mm, nm, um


def main() -> None:
    camera = lg.FocusedPlenopticCamera(
        wavelength=550 * nm,
        object_distance=120 * mm,
        main_lens={"focal_length": 60 * mm},
        lenslets={"pitch": 150 * um, "focal_length": 5.2 * mm, "count": (21, 21), "magnification": 0.5},
        sensor={"pixel_pitch": 4.5 * um},
    )
    print(camera.describe())
    lg.plots.layout(camera).savefig("rays.png")

    target = lg.targets.siemens_star(camera.object_grid)
    raw = lg.simulate(camera, target)
    picture = lg.render(raw, camera.calibration, patch=camera.patch)
    lg.save(raw, "raw.tiff")
    lg.save(picture, "picture.png")


if __name__ == "__main__":
    main()
