"""What a gradient of images of points by a camera's parts costs, over the image itself.

    python -m benchmarks.part_gradients [kinds [points [keys]]]

prints a line for each kind of camera (`KINDS`), number of points and of keys, such as `exact 1,5 3,8`: CPU
seconds of `part_images([]).forward` and of `part_images(pairs).gradient`, each made anew as a search makes
them, medians of five; their ratio; and peak memory over the image's, by tracemalloc.
"""

import sys
import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

Given = dict[str, Any]

LENSLETS: Given = {
    "pitch": 0.2 * mm, "focal_length": 5.2 * mm, "count": (9, 9), "magnification": 0.5, "fill_factor": 0.95,
}  # fmt: skip
SQUARES: Given = {
    "object_distance": 120 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 60 * mm, "diameter": 3 * mm, "aberrations": {"6": 0.3, "8": 0.2}},
    "lenslets": LENSLETS,
    "sensor": {"pixel_pitch": 6 * um, "shape": (321, 321), "fill_factor": 0.9},
}
HEX = LENSLETS | {"layout": "hex", "count": (8, 7), "fill_factor": 1.0}
OWN = LENSLETS | {"single": {n: {"focal_change": 0.01 * k} for k, n in enumerate((31, 33, 41, 49, 51))}}
FIELDS = {"field": ["0 mrad", "20 mrad"], "unit": "waves", "terms": {"8": [0.0, 0.2]}}
KINDS: dict[str, Given] = {
    "squares": SQUARES,
    "exact": SQUARES | {"model": "exact"},
    "hexagons": SQUARES | {"lenslets": HEX | {"focal_length": (5.2 * mm, 5.0 * mm, 5.4 * mm)}},
    "chance": SQUARES | {"built": {"focal_length_scatter": 0.02, "decentre_scatter": 2 * um}},
    "own": SQUARES | {"lenslets": OWN},
    "over_field": SQUARES | {"main_lens": SQUARES["main_lens"] | {"over_field": FIELDS}},
}
KEYS = (
    "object_distance", "main_lens.focal_length", "lenslets.pitch", "wavelength", "main_lens.diameter",
    "main_lens.aberrations.6", "lenslets.magnification", "sensor.pixel_pitch", "lenslets.fill_factor",
    "sensor.fill_factor", "main_lens.aberrations.8",
)  # fmt: skip
STEP = 1e-6
"""Of a value, to either side."""
TIMES = 5


def moved(given: Given, key: str, by: float) -> Given:
    """The description with one number that is so much larger, relative."""
    first, _, rest = key.partition(".")
    return given | {first: moved(given[first], rest, by) if rest else given[first] * (1 + by)}


def pair(given: Given, key: str) -> tuple[Any, Any]:
    """Cameras a little to either side."""
    low, high = (lg.FocusedPlenopticCamera(**moved(given, key, side * STEP)) for side in (-1, 1))
    return low, high


def points(count: int) -> lg.Points:
    """At five depths, or fewer where there are fewer points."""
    depths = np.resize(np.linspace(-5, 5, 5), count) * mm if count > 1 else np.array([-1 * mm])
    aside = np.random.default_rng(0).uniform(-0.3, 0.3, (count, 2)) * mm
    return lg.Points(np.column_stack([aside, depths]), np.ones(count))


def image(own: Any, seen: lg.Points) -> object:
    """Made anew."""
    return own.part_images([]).forward(seen)


def gradient(own: Any, seen: lg.Points, pairs: list[Any], weights: np.ndarray) -> object:
    """Made anew."""
    return own.part_images(pairs).gradient(seen, weights)


def cpu(run: Callable[[], object]) -> float:
    """Median, after a first one [s]."""
    found = []
    for _ in range(1 + TIMES):
        began = time.process_time()
        run()
        found.append(time.process_time() - began)
    return median(found[1:])


def peak(run: Callable[[], object]) -> int:
    """[bytes]."""
    tracemalloc.start()
    run()
    found = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found


def compare(kind: str, count: int, keys: int) -> str:
    """A line of the table."""
    own, pairs = lg.FocusedPlenopticCamera(**KINDS[kind]), [pair(KINDS[kind], key) for key in KEYS[:keys]]
    seen, weights = points(count), np.random.default_rng(1).random(own.sensor.shape)
    runs = partial(image, own, seen), partial(gradient, own, seen, pairs, weights)
    (once, back), (least, most) = map(cpu, runs), map(peak, runs)
    return (
        f"{kind}, {count} points, {keys} keys: image {once:.3f} s, gradient {back:.3f} s ({back / once:.1f} "
        f"images), {least / 1e6:.0f} and {most / 1e6:.0f} MB ({most / least:.1f})"
    )


def main(words: list[str]) -> None:
    """Print the table."""
    kinds, counts, keys = (
        words[k].split(",") if len(words) > k else default.split(",")
        for k, default in enumerate((",".join(KINDS), "1,2,5,20", "3,8,11"))
    )
    for kind in kinds:
        for count in map(int, counts):
            for n in map(int, keys):
                print(compare(kind, count, n), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
