"""Microscopes reach the accuracy asked for, by quadratures that share no code with them."""

import numpy as np
import pytest
from benchmarks import accuracy_microscope, references

import lumigraph as lg

FINENESS = references.Fineness(80, 4, 120, 16)
"""Enough for one lenslet."""


@pytest.mark.parametrize(
    ("model", "dz", "accuracy", "place"),
    [
        ("scalar", 0.0, 1e-2, (0.6e-6, -1.4e-6)),
        ("vector", 2e-6, 1e-3, (0.6e-6, -1.4e-6)),
        ("scalar", 0.0, 1e-2, (7e-6, 1e-6)),  # beside the array: 3e-2 if it is followed as the others
    ],
)
def test_a_points_image_is_as_exact_as_asked(model, dz, accuracy, place):
    scope = lg.LightFieldMicroscope(
        wavelength=525e-9,
        objective={"magnification": 20.0, "numerical_aperture": 0.5, "model": model},
        lenslets={"pitch": 125e-6, "focal_length": 2.5e-3, "count": (1, 1)},
        sensor={"pixel_pitch": 8.3e-6},
    )
    (truth,) = accuracy_microscope.points(scope, dz, [place], FINENESS)
    raw = lg.simulate(scope, lg.targets.points([(*place, dz)]), lg.Incoherent(accuracy=accuracy))
    off = np.linalg.norm(raw.data - truth) / np.linalg.norm(truth)
    assert off < accuracy
    assert raw.metadata["error"]["rms"] < accuracy
