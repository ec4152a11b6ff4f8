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


@pytest.mark.long  # light is followed to 1e-5
def test_a_point_beside_the_array_states_the_error_of_what_was_computed():
    scope = _scope("scalar")
    found = [scope.imaged_point(7e-6, 1e-6, 0.0, accuracy) for accuracy in (1e-4, 1e-5)]
    np.testing.assert_array_equal(found[0][0], found[1][0])  # light is followed to 1e-5 for both
    assert found[0][1] == found[1][1]


NEAR = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
    lenslets={"count": (1, 1)}, sensor={"shape": (15, 15)}
)
FAR = (0.1 * NEAR.lenslet_size, -0.23 * NEAR.lenslet_size, -9e-6)
"""A point that lights eleven lenslets to each side."""


def _off_from_far(image, fineness):
    (truth,) = accuracy_microscope.points(NEAR, FAR[2], [FAR[:2]], fineness, 11)
    return np.linalg.norm(image - truth) / np.linalg.norm(truth)


@pytest.mark.parametrize(
    ("accuracy", "fineness"),
    [
        (1e-3, references.Fineness(440, 8, 600, 24)),  # 1.2e-3 if as few samples as in focus do
        # 4.2e-4 without `BESIDE`
        pytest.param(1e-4, references.Fineness(640, 12, 900, 32), marks=pytest.mark.long),
    ],
)
def test_a_point_that_lights_many_lenslets_is_as_exact_as_asked(accuracy, fineness):
    assert _off_from_far(NEAR.point_image(*FAR, accuracy=accuracy), fineness) < accuracy


def test_a_pupils_image_of_a_point_that_lights_many_lenslets_is_as_exact_as_asked():
    pupil = NEAR.pupil_images((), farthest=-FAR[2], accuracy=1e-3)
    image = pupil.forward(lg.Points(np.array([FAR]), np.ones(1)), np.zeros(0))
    assert _off_from_far(image, references.Fineness(440, 8, 600, 24)) < 1e-3
