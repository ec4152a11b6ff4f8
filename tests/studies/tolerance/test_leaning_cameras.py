"""Tolerances of tilts and bow: corners are where they count, to first order and by chance."""

import math

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.instruments import Built
from lumigraph.studies.tolerance import built, study
from lumigraph.studies.tolerance.trials import ToleranceTrials

TILTS = {
    "array_tilt_y": "±2 mrad", "array_tilt_x": "±2 mrad", "array_bow": "±20 um uniform",
    "sensor_tilt_y": "±5 mrad", "sensor_tilt_x": "±1 mrad",
}  # fmt: skip


@pytest.fixture(scope="module")
def camera():
    return lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")


def test_a_corner_is_a_camera_of_its_distances(camera):
    """With the names of tolerances for the array as built, beside one moved everywhere."""
    made = built(
        camera, {"array_tilt_y": 3e-3, "array_bow": 5e-6, "sensor_tilt_x": -4e-3, "separation": 1e-4}
    )
    assert made.built.array_tilt == (3e-3, 0.0)
    y, x = camera.lattice.position(camera.lenslets.indices()[-1:])[0]
    array = math.tan(3e-3) * y + 5e-6 * (y**2 + x**2) / sum(r**2 for r in camera.lenslets.reach)
    scale = 1 + made.lenslet_distance / made.separation
    distance = made.lenslet_distance - array - math.tan(4e-3) * x * scale
    local = camera.replace(built=Built(separation=made.separation + array, lenslet_distance=distance))
    here, there = (
        {row.name: row.value for row in lg.tolerance.measures(camera, one)} for one in (made, local)
    )
    assert here["focus shift"] + here["corner focus shift"] == pytest.approx(there["focus shift"], rel=1e-9)
    assert here["corner depth error"] == pytest.approx(there["depth error"], rel=1e-9)
    assert here["corner shift y"] == pytest.approx(there["corner shift y"], rel=1e-6)
    assert there["corner focus shift"] == 0
    assert abs(here["corner focus shift"]) > 1e-6


def test_first_order_agrees_with_cameras_by_chance(camera):
    """To 10 %, where the statistical error of 500 is 3 %."""
    trials = ToleranceTrials.of(camera, TILTS)
    assert trials.names[-2:] == ("corner focus shift", "corner depth error")
    names = ("corner focus shift", "corner depth error", "corner shift y", "corner shift x")
    found = study(camera, TILTS, draws=500, seed=4, measure=[*names, "focus shift"])
    for name in names:
        one = found[name]
        assert one.first_order == pytest.approx(one.deviation, rel=0.1), name
        assert one.is_linear, name
    assert not found["focus shift"].changes
    assert dict(found["corner shift y"].ranked(found.names))["array_tilt_y"] > 0.01
    np.testing.assert_array_equal(
        study(camera, TILTS, draws=5, seed=4, measure=names)["corner shift y"].sample,
        found["corner shift y"].sample[:5],
    )
