"""Microscopes reach the accuracy asked for, by quadratures that share no code with them."""

import numpy as np
import pytest
from benchmarks import accuracy_microscope, references

import lumigraph as lg

FINENESS = references.Fineness(80, 4, 120, 16)
"""Enough for one lenslet."""


def _scope(model):
    return lg.LightFieldMicroscope(
        wavelength=525e-9,
        objective={"magnification": 20.0, "numerical_aperture": 0.5, "model": model},
        lenslets={"pitch": 125e-6, "focal_length": 2.5e-3, "count": (1, 1)},
        sensor={"pixel_pitch": 8.3e-6},
    )


@pytest.mark.parametrize(
    ("model", "dz", "accuracy", "place"),
    [
        ("scalar", 0.0, 1e-2, (0.6e-6, -1.4e-6)),
        ("vector", 2e-6, 1e-3, (0.6e-6, -1.4e-6)),
        ("scalar", 0.0, 1e-2, (7e-6, 1e-6)),  # beside the array: 3e-2 if it is followed as the others
    ],
)
def test_a_points_image_is_as_exact_as_asked(model, dz, accuracy, place):
    scope = _scope(model)
    (truth,) = accuracy_microscope.points(scope, dz, [place], FINENESS, 2)
    raw = lg.simulate(scope, lg.targets.points([(*place, dz)]), lg.Incoherent(accuracy=accuracy))
    off = np.linalg.norm(raw.data - truth) / np.linalg.norm(truth)
    assert off < accuracy
    assert raw.metadata["error"]["rms"] < accuracy


def test_a_point_beside_the_array_states_the_error_of_what_was_computed():
    scope = _scope("scalar")
    found = [scope.imaged_point(7e-6, 1e-6, 0.0, accuracy) for accuracy in (1e-4, 1e-5)]
    np.testing.assert_array_equal(found[0][0], found[1][0])  # light is followed to 1e-5 for both
    assert found[0][1] == found[1][1]


def test_a_point_that_lights_many_lenslets_is_as_exact_as_asked():
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv")
    scope = scope.replace(lenslets={"count": (1, 1)}, sensor={"shape": (15, 15)})
    place = 0.1 * scope.lenslet_size, -0.23 * scope.lenslet_size
    fineness = references.Fineness(440, 8, 600, 24)
    (truth,) = accuracy_microscope.points(scope, -9e-6, [place], fineness, 11)
    image = scope.point_image(*place, -9e-6, accuracy=1e-3)  # 1.2e-3 if as few samples as in focus do
    assert np.linalg.norm(image - truth) < 1e-3 * np.linalg.norm(truth)
