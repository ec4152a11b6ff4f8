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


def test_a_point_beside_the_array_says_that_it_is_less_exact_than_asked():
    place, scope = (7e-6, 1e-6), _scope("scalar")
    (truth,) = accuracy_microscope.points(scope, 0.0, [place], references.Fineness(240, 8, 400, 32), 4)
    with pytest.warns(lg.SamplingWarning, match=r"asked"):  # no light is followed beyond 1e-5
        raw = lg.simulate(scope, lg.targets.points([(*place, 0.0)]), lg.Incoherent(accuracy=1e-5))
    off = np.linalg.norm(raw.data - truth) / np.linalg.norm(truth)
    assert 0.5 < raw.metadata["error"]["rms"] / off < 5
