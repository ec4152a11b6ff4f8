"""Agreement of micro-images with their neighbours: by matrix products as pixel by pixel."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import focused_raw, texture
from scipy.ndimage import map_coordinates

from lumigraph.core.lattice import Lattice
from lumigraph.core.progress import silent
from lumigraph.core.raw import RawImage
from lumigraph.depth.micro_images import MicroImageReader, MicroImages

LATTICES = {
    "square": Lattice.square(15.3, 0.01, (7, 7)),
    "hex": Lattice.hex(16.4, 0.02, (9, 9)),
    "three kinds": Lattice.hex(17.4, 0.0, (9, 9), kinds=3),
}


def drawn(name, fill=None, patch=5.3):
    """Micro-images of a textured plane with two percent of noise."""
    rng = np.random.default_rng(7)
    raw, calibration = focused_raw(
        LATTICES[name], (100, 120), texture(rng, longest=0.35), lambda y, x: patch + 0 * y
    )
    noisy = np.maximum(raw + 0.02 * rng.standard_normal(raw.shape), 0)
    return MicroImages.of(RawImage(noisy), replace(calibration, fill=fill))


def correlated(mine, its, inside, move):
    """Normalised correlation of what two micro-images (h, w) share, one number; None if too little."""
    y, x = np.meshgrid(*map(np.arange, inside.shape), indexing="ij")
    at = [y + move[0], x + move[1]]
    weight = inside * map_coordinates(inside, at, order=1, mode="constant")
    if weight.sum() < 0.12 * inside.sum():
        return None
    weight, moved = weight / weight.sum(), map_coordinates(its, at, order=1, mode="constant")
    a, b = mine - (weight * mine).sum(), moved - (weight * moved).sum()
    powers = ((weight * part**2).sum() + 0.01**2 for part in (a, b))
    return (weight * a * b).sum() / np.sqrt(np.prod(list(powers)))


def directly(micro, size):
    """The scores (rows, cols) of one size: loops over lenslets and their neighbours, in float64."""
    lattice, rows = micro.calibration.lattice, micro.indices.shape[:2]
    inside = micro.inside.astype(float)
    images = micro.data.astype(float).reshape(*rows, *inside.shape) + 0.5
    number = {tuple(index): k for k, index in enumerate(micro.indices.reshape(-1, 2).tolist())}
    steps = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if (i, j) != (0, 0)]
    ways = {step: lattice.matrix @ step / lattice.pitch for step in steps}
    ways = {step: way for step, way in ways.items() if np.hypot(*way) < 1.8}
    out = np.zeros(rows)
    for place in np.ndindex(rows):
        there = [
            (number.get(tuple((micro.indices[place] + step).tolist())), way) for step, way in ways.items()
        ]
        found = [
            correlated(images[place], images[np.unravel_index(k, rows)], inside, way * size)
            for k, way in there
            if k is not None
        ]
        best = sorted((score for score in found if score is not None), reverse=True)
        out[place] = np.mean(best[: (len(best) + 1) // 2]) if best else 0
    return out


@pytest.mark.parametrize("name", LATTICES)
@pytest.mark.parametrize("fill", [None, 0.7])
def test_scores_are_those_of_a_comparison_pixel_by_pixel(name, fill):
    """Sums in another order, float32: without the mean taken out first they would differ by 1e-4."""
    micro, sizes = drawn(name, fill), np.array([-8.9, -5.0, 1.3, 5.3, 6.25])
    scores = micro.scores(sizes, silent)
    for score, size in zip(scores, sizes, strict=True):
        np.testing.assert_allclose(score, directly(micro, size), atol=1e-5)
    assert scores[3].mean() > 0.9 > 2 * scores[0].mean()


def test_blocks_of_lenslets_make_no_difference(monkeypatch):
    whole = drawn("hex").scores(np.array([4.0, 5.3]), silent)
    monkeypatch.setattr("lumigraph.depth.micro_images._BLOCK", 5)
    seen = []
    np.testing.assert_allclose(drawn("hex").scores(np.array([4.0, 5.3]), seen.append), whole, atol=1e-6)
    assert seen == sorted(seen)
    assert seen[-1] == 1


def test_what_is_hardly_shared_is_not_compared():
    inside = drawn("square").inside
    assert MicroImageReader.of(inside, np.array([0.0, 14.0])) is None
    reading = MicroImageReader.of(inside, np.array([-2.5, 3.0]))
    assert reading is not None
    assert reading.weight.sum() == pytest.approx(1)
    assert len(reading.places) < inside.sum()


def test_a_reading_is_linear_between_pixels(rng):
    inside = np.hypot(*np.mgrid[-8:9, -8:9]) < 7.2
    image, move = rng.random((17, 17)).astype(np.float32), np.array([2.3, -3.8])
    reading = MicroImageReader.of(inside.astype(np.float32), move)
    assert reading is not None
    at = np.stack(np.divmod(reading.places, 17)) + move[:, None]
    assert reading.matrix @ image.ravel() == pytest.approx(
        map_coordinates(image, at, order=1, mode="constant"), abs=1e-5
    )
    shared = inside.ravel() * map_coordinates(
        inside.astype(float), np.mgrid[:17, :17].reshape(2, -1) + move[:, None], order=1, mode="grid-constant"
    )
    assert reading.weight == pytest.approx(shared[shared > 0] / shared.sum(), rel=1e-4)
