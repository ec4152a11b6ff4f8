"""The same bars in coherent, partially coherent and incoherent light, and what snapshots make of them.

Run: python examples/kinds_of_light.py
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um


def main() -> None:
    camera = lg.SingleLensCamera(
        wavelength=633 * nm,
        object_distance=316 * mm,
        main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
        sensor={"pixel_pitch": 10 * um, "shape": [100, 100]},
    )
    chart = lg.targets.siemens_star(camera.object_grid)
    exact = lg.simulate(camera, chart, lg.Incoherent())
    lg.save(lg.simulate(camera, chart, lg.Coherent()), "coherent.tiff")
    lg.save(lg.simulate(camera, chart, lg.TiltedWaves(40, na=0.004)), "partially_coherent.tiff")
    lg.save(exact, "incoherent.tiff")
    for light in (lg.Snapshots(40, rng=1), lg.TiltedWaves(40)):
        raw = lg.simulate(camera, chart, light)
        error = np.linalg.norm(raw.data - exact.data) / np.linalg.norm(exact.data)
        estimate = raw.metadata["estimated_error"]
        print(f"{light}: {100 * error:.1f} % rms off, estimated {100 * estimate:.1f} %")


if __name__ == "__main__":
    main()
