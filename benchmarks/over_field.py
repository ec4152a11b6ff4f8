"""Slices behind a lens whose aberrations change over the field: ``python -m benchmarks.over_field``.

Building, an image and its adjoint [CPU s], and how far twelve samples' images are from those of points.
"""

import math
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np

COMA, BENT = 0.06, 0.02
"""Waves rms at the corner of the field, of coma, as the field, and of defocus: both as the field."""


def camera(count: int) -> Any:
    """2.0, of so many lenslets a side."""
    sys.path.insert(0, "tests")
    import cameras

    ideal = cameras.focused(count=(count, count))
    grid, share = ideal.object_grid, np.linspace(0, 1, 5)
    corner = math.hypot(abs(grid.y[0]), abs(grid.x[0])) / ideal.object_distance
    angles = math.degrees(math.atan(corner)) * 1.0001 * share
    table = {
        "field": [f"{angle} deg" for angle in angles],
        "unit": "waves",
        "terms": {8: list(COMA * share), 4: list(BENT * share)},
    }
    return ideal.replace(main_lens={"over_field": table})


def timed(what: Callable[[], Any]) -> tuple[Any, float]:
    """What a function gives, and the processor's time that it takes [s]."""
    start = time.process_time()
    return what(), time.process_time() - start


def off(operator: Any, camera: Any) -> float:
    """Relative rms by which images of twelve samples are off those of points, but for their brightness."""
    import lumigraph as lg
    from lumigraph.operators.lenslets.points import points_image

    rng, grid = np.random.default_rng(1), operator.object_grid
    places = [tuple(int(rng.integers(0, n)) for n in grid.shape) for _ in range(12)]
    bright, picture = rng.random(12), np.zeros(grid.shape, np.float32)
    for (i, j), intensity in zip(places, bright, strict=True):
        picture[i, j] = intensity
    positions = np.array([[grid.y[i], grid.x[j], 0.0] for i, j in places])
    expected = points_image(camera, lg.Points(positions, bright), 2e-4)
    found = operator.forward(picture)
    share = np.sum(found * expected) / np.sum(expected**2)
    return float(np.linalg.norm(found - share * expected) / np.linalg.norm(found))


def run(count: int = 13) -> None:
    """Print a line for each accuracy."""
    one = camera(count)
    print("accuracy  lenses  building  an image  adjoint  off")
    for accuracy in (1e-2, 1e-3):
        with tempfile.TemporaryDirectory() as folder:
            operator, built = timed(lambda a=accuracy, f=folder: one.operator(accuracy=a, folder=f))
            raw, forward = timed(lambda o=operator: o.forward(np.ones(o.shape[1], np.float32)))
            _, adjoint = timed(lambda o=operator, r=raw: o.adjoint(r))
            print(
                f"{accuracy:8.0e} {len(operator.maps):7d} {built:9.1f} {forward:9.2f} {adjoint:8.2f} "
                f"{off(operator, one):.1e}", flush=True,
            )  # fmt: skip


if __name__ == "__main__":
    run()
