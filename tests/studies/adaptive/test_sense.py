"""A plenoptic camera as wavefront sensor: modes of a point's wavefront, and slopes of a scene's."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import lumigraph as lg
from lumigraph.deconvolution import Exposure
from lumigraph.elements.zernike import noll_to_nm
from lumigraph.operators.lenslets.point_changes import point_changes
from lumigraph.scene import Points
from lumigraph.studies.adaptive import sense, start
from lumigraph.studies.adaptive.checked import bent
from lumigraph.studies.adaptive.sense import MODES
from lumigraph.studies.adaptive.star import StarImages
from lumigraph.studies.adaptive.start import _left, _scatter, _slopes
from lumigraph.studies.information.points import CameraSource

CAMERA = lg.PlenopticCamera(
    wavelength="600 nm",
    object_distance="400 mm",
    main_lens={"focal_length": "200 mm"},
    lenslets={"pitch": "120 um", "count": (4, 4), "focal_length": "2.5 mm"},
    sensor={"pixel_pitch": "8 um"},
)
"""The axis meets the corner of four lenslets."""
EXPOSURE = Exposure(background=0.01, gain=1.0)
PLACE = np.array([20e-6, -11e-6, 0.0])


def turbulence(rng):
    """Coefficients of `MODES` [waves rms] with the modal spectrum of turbulence, 1 rad rms in all."""
    drawn = rng.normal(size=len(MODES)) * np.array([noll_to_nm(j)[0] + 1.0 for j in MODES]) ** (-11 / 6)
    return drawn / np.linalg.norm(drawn) / (2 * math.pi)


def exposed(terms, coefficients, photons, seed=0, camera=CAMERA):
    """By another path than the estimate's: finer, and with twice its samples of the pupil."""
    light = CameraSource(bent(camera, terms, np.asarray(coefficients)), 1e-3).image(np.zeros(3))
    return np.random.default_rng(seed).poisson(photons * light + 0.01).astype(np.float32)


@pytest.mark.parametrize("rotation", [0.0, 0.2])
def test_changes_of_a_points_image_are_those_of_differences(rotation):
    """Central differences of its own images, to 2e-4; a phase turned with the lenslets fails by 0.3."""
    star = StarImages(CAMERA.replace(lenslets={"rotation": rotation}), (4, 5, 8))
    c, step = np.array([0.05, -0.08, 0.06]), 1e-3
    lit = next(star.lit(Points(PLACE[None], np.ones(1)), c))
    other = CameraSource(bent(star.camera, star.terms, c), 1e-3).image(PLACE)
    assert np.linalg.norm(lit.image - other) < 3e-3 * np.linalg.norm(other)

    def seen(move=0.0, turned=0.0):
        return star.forward(Points((PLACE + move)[None], np.ones(1)), c + turned)

    for k, turn in enumerate(np.eye(3)[1:] * step, 1):
        slope = (seen(turned=turn) - seen(turned=-turn)) / (2 * step)
        assert np.linalg.norm(slope - lit.changes[k]) < 2e-4 * np.linalg.norm(slope)
    move = np.array([1e-7, 0.0, 0.0])
    slope = (seen(move) - seen(-move)) / 2e-7
    assert np.linalg.norm(slope - lit.changes[3]) < 1e-3 * np.linalg.norm(slope)
    assert not lit.changes[5].any()


def test_modes_of_a_star_come_back_within_their_covariance():
    terms, true = (4, 5, 6, 8), np.array([0.09, -0.07, 0.06, 0.08])
    found = sense(exposed(terms, true, 3e4), CAMERA, (1, 2, 3, *terms), exposure=EXPOSURE)
    off = found.values.ravel() - true
    assert off @ np.linalg.solve(found.covariance, off) < 18  # χ² of four: 1e-3 are above
    assert 1e-4 < math.sqrt(np.trace(found.covariance)) < 4e-3
    assert found.pearson == pytest.approx(1, abs=0.15)
    assert np.diag(found.covariance) == pytest.approx(found.deviations.ravel() ** 2, rel=1e-9)
    assert set(found.untold) == {1, 2, 3}
    assert found.instrument.main_lens.aberrations == found.coefficients
    assert np.abs(found.beads.positions).max() < 1e-6
    assert found.beads.intensities == pytest.approx(3e4, rel=0.02)
    assert found.deviance[0] > 2 * found.deviance[1]


@pytest.mark.long
def test_one_radian_of_turbulence_is_found_below_what_a_shack_hartmann_leaves():
    """1e5 photons: 0.012 rad, where `benchmarks.wavefront_sensor` has 0.043, and 0.025 at best."""
    true = turbulence(np.random.default_rng(0))
    found = sense(exposed(MODES, true, 1e5), CAMERA, exposure=EXPOSURE)
    assert 2 * math.pi * np.linalg.norm(found.values.ravel() - true) < 0.018


@pytest.mark.long
def test_deviations_hold_what_modes_that_were_not_asked_for_pull():
    """Half a radian of them, three draws: by noise alone χ² of six is 40 on average."""
    terms, chi = (4, 5, 6, 7, 8, 11), []
    kept = np.isin(MODES, terms)
    for seed in range(3):
        true = turbulence(np.random.default_rng(seed)) * np.where(kept, 1.0, 0.5)
        with pytest.warns(lg.SamplingWarning, match="a point with these modes leaves"):
            found = sense(exposed(MODES, true, 3e4, seed), CAMERA, terms, exposure=EXPOSURE)
        off = found.values.ravel() - true[kept]
        chi.append(off @ np.linalg.solve(found.covariance, off))
    assert np.mean(chi) < 14  # 1e-3 are above of three


def test_what_is_no_point_is_warned_of():
    raw = exposed((4,), [0.0], 3e4) + np.random.default_rng(1).poisson(2.0, CAMERA.sensor.shape)
    with pytest.warns(lg.SamplingWarning, match="a point with these modes leaves"):
        sense(raw.astype(np.float32), CAMERA, (4,), exposure=EXPOSURE)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"camera": lg.load_camera("lfm-fourier")}, "must be a LensletCamera"),
        ({"terms": (1, 2, 3)}, "the point explains 1 to 3 itself"),
        ({"terms": (0,)}, "Noll's index is 0"),
        ({"place": (0.0, 0.0, -0.5)}, "object|focal"),
        ({"place": (0.0, math.nan, 0.0)}, "a place"),
        ({"raw": np.ones((9, 9), np.float32)}, "the operator makes"),
        ({"raw": np.zeros(CAMERA.sensor.shape, np.float32)}, "dark"),
        ({"camera": CAMERA.replace(model="exact")}, "paraxial"),
    ],
)
def test_what_cannot_be_sensed_is_refused(given, message):
    with pytest.raises(lg.LumigraphError, match=message):
        sense(**{"raw": np.ones(CAMERA.sensor.shape, np.float32), "camera": CAMERA, "terms": (4,), **given})


def test_an_exact_model_has_no_changes():
    with pytest.raises(lg.GeometryError, match="model = 'paraxial'"):
        point_changes(CAMERA.replace(model="exact"), np.zeros(3), (4,), 1e-2)


@pytest.mark.long
def test_slopes_of_a_scene_before_a_camera(tmp_path):
    """Defocus too, for the scene is flat; rays leave a quarter of it. Mirrored slopes leave twice of it."""
    camera, rng = (
        CAMERA.replace(lenslets={"count": (12, 12)}, sensor={"shape": None}),
        np.random.default_rng(0),
    )
    true = turbulence(rng)
    scene = gaussian_filter(rng.normal(size=camera.operator_grid().shape), 6)
    scene = np.maximum(1 + scene / scene.std() / 2, 0.05).astype(np.float32)
    operator = bent(camera, MODES, true).operator(accuracy=1e-2, folder=tmp_path)
    found = start(np.maximum(operator.forward(scene), 0), camera, MODES)
    off = np.array(list(found.coefficients.values())) - true
    assert np.linalg.norm(off) < 0.35 * np.linalg.norm(true)
    sure = np.array(list(found.deviations.values()))
    assert sure == pytest.approx(np.sqrt(np.diag(found.covariance)))
    assert 0.5 < np.sqrt(np.mean((off / sure) ** 2)) < 1.4


def test_deviations_of_slopes_count_errors_that_views_share():
    """Noise that eight views share, 60 draws: what is said is what coefficients scatter by.

    As if views were independent, residuals of shifts say half of it.
    """
    rng, places = np.random.default_rng(0), np.random.default_rng(1).uniform(-0.6, 0.6, (32, 2))
    places = places[np.argsort(places[:, 0])]
    flat = _slopes(places, (5, 6, 8)).reshape(-1, 3)
    inverse, texture = np.linalg.pinv(flat), gaussian_filter(rng.normal(size=(40, 40)), 1.5)
    found, said, residuals = [], [], []
    for _ in range(60):
        shared = gaussian_filter(rng.normal(size=(4, 40, 40)), (0, 0.7, 0.7))
        seen = texture / texture.std() + 0.2 * np.repeat(shared / shared.std(), 8, 0)
        left = _left(seen, np.zeros((32, 2))).ravel()
        found.append(inverse @ left)
        said.append(np.trace(_scatter(seen, np.zeros((32, 2)), inverse)))
        rest = left - flat @ found[-1]
        residuals.append(rest @ rest / (left.size - 3) * np.trace(inverse @ inverse.T))
    true = np.trace(np.cov(np.array(found).T))
    assert np.mean(said) == pytest.approx(true, rel=0.25)
    assert np.mean(residuals) < 0.3 * true
