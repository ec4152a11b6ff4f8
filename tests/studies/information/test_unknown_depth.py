"""Scenes at an unknown depth: a rule in closed form, beside drawn noise and a depth that is known."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.studies.information import (
    Light,
    Scenes,
    reconstruction_error,
    unknown_depth,
    unknown_depth_trials,
)

CAMERA = lg.load_camera("thesis-2f").replace(sensor={"shape": (64, 64)})
DEPTHS = [-8e-3, 0.0, 8e-3]
SCENES = Scenes(40e-6, 8)
LIGHT = Light(3000)


@pytest.fixture(scope="module")
def rule():
    return unknown_depth(CAMERA, DEPTHS, SCENES, LIGHT)


def test_drawn_noise_agrees_with_the_expected_error(rule):
    found = unknown_depth_trials(CAMERA, DEPTHS, SCENES, LIGHT, draws=60, rng=np.random.default_rng(2))
    assert abs(found.rms - rule.value) < 4 * found.rms_error
    np.testing.assert_allclose(np.sqrt(np.mean(found.errors**2, 0)), rule.errors, rtol=0.15)


def test_a_known_depth_leaves_less_and_one_depth_is_known(rule):
    known = reconstruction_error(CAMERA, DEPTHS, SCENES, LIGHT)
    assert rule.value > 1.02 * known.value
    one = unknown_depth(CAMERA, DEPTHS[:1], SCENES, LIGHT)
    expected = reconstruction_error(CAMERA, DEPTHS[:1], SCENES, LIGHT)
    assert one.value == pytest.approx(expected.value, abs=4 * expected.uncertain * expected.value)


def test_optimise_trains_camera_and_rule_together(tmp_path):
    goal = lg.studies.optimisation.Goal("reconstruction", False, tuple(DEPTHS), LIGHT, None, SCENES)
    vary = {"main_lens.aberrations.6": "-0.5:0.5:x2"}
    with pytest.raises(lg.GeometryError, match="search 'gradient' is not for 'reconstruction'"):
        lg.optimise(CAMERA, vary, goal=goal, search="gradient")
    found = lg.optimise(CAMERA, vary, goal=goal, search="grid", output=tmp_path / "best.toml")
    assert found.best["reconstruction"] == min(row["reconstruction"] for row in found.rows[1:])
