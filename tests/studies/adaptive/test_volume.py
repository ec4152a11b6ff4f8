"""Aberrations from the light field of a textured volume, whose raw image another operator makes."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from tests.studies.adaptive.test_estimate import SCOPE

import lumigraph as lg
from lumigraph.deconvolution import Exposure
from lumigraph.studies.adaptive import estimate, start
from lumigraph.studies.adaptive.sight import VolumeOperators
from lumigraph.studies.adaptive.voxels import Voxels

DEPTHS = (-5e-6, -2.5e-6, 0.0, 2.5e-6, 5e-6)
TRUE_DEPTHS = (-5.5e-6, -1.5e-6, 2.5e-6, 6.5e-6)
EXPOSURE = Exposure(gain=1.0)
COUNTS = 40.0
"""Electrons in a pixel, in the mean."""


def exposed(aberrations, planes=TRUE_DEPTHS, samples=5, seed=0):
    """By propagation on a grid, from more planes and finer samples than are looked for."""
    bent = SCOPE.replace(objective={"aberrations": aberrations})
    operator = bent.operator(planes, samples, accuracy=2e-2).widened(0.05)[0]
    rng = np.random.default_rng(4)
    across = 0.5 * samples
    texture = gaussian_filter(rng.normal(size=operator.shape[1]), (0.7, across, across))
    light = operator.forward(np.maximum(texture / texture.std(), 0).astype(np.float32) ** 2)
    return np.random.default_rng(seed).poisson(light * COUNTS / light.mean()).astype(np.float32)


@pytest.fixture(scope="module")
def sight():
    return VolumeOperators.of(SCOPE.pupil_images((6, 8), accuracy=3e-2), (-3e-6, 2e-6), 2)


def volume_of(sight, seed=2):
    rng = np.random.default_rng(seed)
    volume = np.zeros((2, *sight.grid.shape), np.float32)
    volume[(slice(None), *sight.inside)] = rng.uniform(size=(2, *sight.picture.shape))
    return volume


def test_a_volume_is_seen_as_the_microscopes_operator_sees_it(sight):
    bent = SCOPE.replace(objective={"aberrations": {6: 0.2, 8: -0.1}})
    operator = bent.operator((-3e-6, 2e-6), 2, accuracy=2e-2)
    assert sight.picture == operator.object_grid
    volume = volume_of(sight)
    found = sight.operator(np.array([0.2, -0.1])).forward(volume)
    wanted = operator.forward(volume[(slice(None), *sight.inside)])
    assert np.std(found - wanted) < 0.05 * np.std(wanted)


def test_changes_of_a_volumes_image_are_central_differences(sight):
    at, volume = np.array([0.1, -0.05]), volume_of(sight)
    for step, change in zip(0.02 * np.eye(2), sight.changes(at), strict=True):
        ends = [sight.operator(at + side * step).forward(volume) for side in (1, -1)]
        wanted = (ends[0] - ends[1]) / 0.04
        assert np.std(change.forward(volume) - wanted) < 0.12 * np.std(wanted)


def test_what_the_volume_explains_counts_for_nothing(sight):
    """With all voxels free less is known of each term, and a volume that fits leaves no slope."""
    raw = sight.operator(np.zeros(2)).forward(volume_of(sight) + 0.2).astype(np.float32) * 50
    voxels = Voxels(sight, raw, EXPOSURE)
    around = voxels.around(voxels.begun(np.zeros(2), 30))
    known, fixed = np.diag(around.information), np.diag(around.fixed)
    assert (known > 0).all()
    assert (known < 0.95 * fixed).all()
    assert np.abs(np.linalg.solve(around.information, around.slope)).max() < 0.02


def test_coefficients_settle_where_the_slope_vanishes(sight):
    """Of a volume that the model holds, in bright light; and again from there, nothing moves."""
    true, free = np.array([0.1, -0.08]), np.ones(2, bool)
    raw = sight.operator(true).forward(volume_of(sight) + 0.2).astype(np.float32) * 200
    voxels = Voxels(sight, raw, EXPOSURE)
    begun = voxels.begun(np.array([0.13, -0.05]), 30)
    told, around = voxels.settled(begun, voxels.around(begun), free)
    off = told.coefficients - true
    assert np.abs(off).max() < 0.006
    assert told.steps > 0
    chi_square = around.slope @ np.linalg.solve(around.information, around.slope)
    assert chi_square < 0.01 * (off @ around.information @ off + 1) + 0.1
    assert around.scores.sum((1, 2)) == pytest.approx(around.slope + around.pull, rel=1e-2, abs=1e-2)
    assert voxels.settled(told, voxels.around(told), free)[0].steps == told.steps


def test_views_shift_by_the_wavefronts_slopes():
    """One plane with texture: what rays say of 0.4 waves of coma, astigmatism and spherical aberration."""
    true = {6: 0.25, 7: -0.2, 11: 0.2}
    found = start(exposed(true, planes=(0.0,), samples=3), SCOPE, (6, 7, 11))
    assert found.coefficients == pytest.approx(true, abs=0.1)
    assert found.places.shape == found.shifts.shape
    assert np.hypot(*found.places.T).max() < 0.9
    assert found.rms == pytest.approx(0.38, abs=0.1)
    assert set(found.deviations) == set(true)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"instrument": SCOPE.replace(configuration="2.0", lenslet_offset="1 mm")}, "configuration '1.0'"),
        ({"instrument": lg.load_camera("thesis-plenoptic-2-m050")}, "only a PlenopticCamera or"),
        ({"terms": (3, 6)}, "the scene's place explains 1 to 3"),
        ({"terms": ()}, "Give others"),
        ({"raw": np.ones((135, 134), np.float32)}, "the instrument's"),
        ({"raw": np.full((135, 135), np.nan)}, "NaN"),
        ({"raw": np.zeros((135, 135))}, "dark"),
        ({"raw": np.ones((135, 135))}, "even"),
    ],
)
def test_shifts_that_cannot_be_measured_are_refused(given, message):
    with pytest.raises(lg.LumigraphError, match=message):
        start(**{"raw": np.ones((135, 135)), "instrument": SCOPE, "terms": (6,), **given})


@pytest.mark.long
def test_aberrations_come_back_with_the_volume():
    raw = exposed({6: 0.3, 8: -0.25})
    their = r"the volume leaves 1\.[67]\d* times"  # its planes are others
    with pytest.warns(lg.SamplingWarning, match=their):
        found = estimate(raw, SCOPE, DEPTHS, (4, 6, 8), exposure=EXPOSURE, object="volume")
    pulls = (found.values.ravel() - [0.3, -0.25]) / found.deviations.ravel()
    assert np.abs(pulls).max() < 3
    assert found.coefficients == pytest.approx({6: 0.3, 8: -0.25}, abs=0.02)
    assert found.untold == {4: "the volume's depth explains it"}
    assert found.deviance[0] > found.deviance[1]
    assert (found.deviations < 0.02).all()
    assert found.volume is not None
    assert found.volume.depths == DEPTHS
    assert set(found.explained) == {6, 8}
    assert all(0 < part < 1 for part in found.explained.values())
    assert len(found.beads.intensities) == 0


@pytest.mark.long
def test_no_aberration_of_a_volume_is_invented():
    with pytest.warns(lg.SamplingWarning, match="the volume leaves"):
        found = estimate(exposed({}), SCOPE, DEPTHS, (6, 8), exposure=EXPOSURE, object="volume")
    assert found.rms < 0.02
    assert (found.deviations > 0).all()
