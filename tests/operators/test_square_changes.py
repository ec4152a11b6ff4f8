"""Changes of the matrices of square lenslets: beside those of cameras a little apart, and the way back."""

import numpy as np
import pytest
from tests.operators.test_part_exact import GLASS, ON_AXIS, ONE_POINT, SMALL, STEEP
from tests.operators.test_part_images import POINTS, START, camera, off, pair

from lumigraph.operators.lenslets.exact_lenslets import ExactLenslets
from lumigraph.operators.lenslets.part_exact import SampledExactCamera
from lumigraph.operators.lenslets.sampled_camera import SampledCamera
from lumigraph.operators.lenslets.transmitted import LensletGradient, changed_pieces

ANGLES = START | {"sensor": START["sensor"] | {"angular_response": {"power": 40.0}}}
FINE = STEEP | {"lenslets": STEEP["lenslets"] | {"focal_length": 0.6e-3}}
CASES = [
    *((SampledCamera, START, POINTS, f"lenslets.{key}") for key in ("pitch", "focal_length", "fill_factor")),
    (SampledCamera, ANGLES, POINTS, "lenslets.pitch"),
    *(
        (SampledExactCamera, SMALL, ONE_POINT, f"lenslets.{key}")
        for key in ("pitch", "focal_length", "fill_factor")
    ),
    (SampledExactCamera, GLASS, ONE_POINT, "lenslets.pitch"),
    (SampledExactCamera, STEEP, ON_AXIS, "lenslets.focal_length"),
]
NAMES = [f"{of.__name__} {given.get('model')} {key}" for of, given, _, key in CASES]


def before(of, given, points):
    """A camera's lenslets, and keys of the matrices of two cells on its border and amid it."""
    own = of.of(camera(given).optics(), points, 1e-2)
    cells = own.spots(points)[0].cells
    keys = [own.lenslets.of_cells(which, cells)[k] for which, k in ((0, 1), (0, 4), (1, 3))]
    return own, keys


def ends(own, given, key, step=1e-6):
    return [own.alike(one.optics()).lenslets for one in pair(given, key, step=step)]


@pytest.mark.parametrize(("of", "given", "points", "key"), CASES, ids=NAMES)
def test_matrices_change_as_those_of_cameras_a_little_apart(of, given, points, key):
    """As light is concerned that a main lens lets through: it may be held by other numbers, too."""
    own, keys = before(of, given, points)
    low, high = ends(own, given, key)
    found = changed_pieces(own.lenslets, [(1.0, low, high)], set(keys))
    axis = own.optics.axes[0]
    light = np.exp(2j * np.pi * np.outer(axis.window, np.linspace(-0.9, 0.9, 7) * axis.band))
    for name in keys:
        assert off(found[name] @ light, (high.piece(name) - low.piece(name)) @ light) < 1e-5


@pytest.mark.parametrize(("of", "given", "points", "key"), CASES[1::3], ids=NAMES[1::3])
def test_slopes_go_back_as_matrices_change(of, given, points, key, rng):
    own, keys = before(of, given, points)
    low, high = ends(own, given, key)
    changed, slopes = changed_pieces(own.lenslets, [(1.0, low, high)], set(keys)), LensletGradient()
    whole = 0.0
    for name in keys:
        by = rng.standard_normal((2, *changed[name].shape)).T @ (1, 1j)
        slopes.add(name, by.T)
        whole += float(np.sum(by.T * changed[name]).real)
    assert slopes.along(own.lenslets, low, high) == pytest.approx(whole, rel=1e-9, abs=0)


def test_changes_follow_from_more_places_where_lenslets_are_faster():
    counts = []
    for given in (SMALL, STEEP, FINE):
        own, keys = before(SampledExactCamera, given, ON_AXIS)
        counts.append(own.lenslets._around(own.lenslets._seat(keys[0])).count)
    assert counts[0] == 8
    assert counts[0] < counts[1] < counts[2]


def test_a_gradient_makes_no_matrices_of_other_cameras(monkeypatch, rng):
    """However many keys there are."""
    made = []
    along = ExactLenslets.along
    monkeypatch.setattr(ExactLenslets, "along", lambda self, *at: made.append(at) or along(self, *at))
    weights = rng.random(SMALL["sensor"]["shape"])
    for keys in ((), ("wavelength", "lenslets.pitch", "lenslets.fill_factor")):
        images = camera(SMALL).part_images([pair(SMALL, key) for key in keys])
        images.gradient(ONE_POINT, weights)
    assert len(made) == 2 * len(set(made))
