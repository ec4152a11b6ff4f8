"""Centres that stand where they were drawn: tilted, distorted, leaning cameras, at all pitches."""

import math
from dataclasses import replace

import numpy as np
import pytest

import calibration_drawing
import lumigraph as lg
from lumigraph.calibration import calibrate, fitting
from lumigraph.calibration.centres import Spots
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.warp import Warp

PITCHES = (7.0, 8.4, 10.5, 13.3, 17.25, 21.7, 27.1, 34.865, 45.5, 58.2, 74.9, 91.0)


def truth(layout, pitch, seed=0):
    """The white image of a rotated, tilted camera with 20 dB of noise and 1 % dead lenslets; its centres."""
    rng = np.random.default_rng((seed, int(pitch * 100)))
    shape = (max(250, int(7.3 * pitch)), max(270, int(8.1 * pitch)))
    lattice = getattr(Lattice, layout)(
        pitch, math.radians(rng.uniform(-2, 2)), tuple(rng.uniform(0, pitch, 2))
    )
    warp = Warp(tuple((n - 1) / 2 for n in shape), tuple(rng.uniform(-2e-5, 2e-5, 2)))
    options = {"fill": rng.uniform(0.75, 0.95), "warp": warp, "dead": 0.01, "noise": 0.1, "rng": rng}
    return calibration_drawing.white(lattice, shape, **options)


def check_truth(layout, pitch, seed=0):
    white, true = truth(layout, pitch, seed)
    found = calibrate(white)
    indices = np.stack(found.index(*true.T), -1)
    assert found.lattice.layout == layout
    assert len(np.unique(indices, axis=0)) == len(true)
    assert np.sqrt(((found.position(indices) - true) ** 2).sum(1).mean()) < 0.05


@pytest.mark.parametrize(("layout", "pitch"), [("square", 7.0), ("hex", 13.3), ("square", 34.865)])
def test_centres_are_true_on_noisy_tilted_pictures_with_dead_lenslets(layout, pitch):
    check_truth(layout, pitch)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("pitch", PITCHES)
@pytest.mark.parametrize("layout", ["square", "hex"])
def test_centres_are_true_at_all_pitches(layout, pitch, seed):
    check_truth(layout, pitch, seed)


def test_a_tilt_is_fitted_although_micro_images_at_the_border_stand_inwards(rng):
    """By less than a tilt moves them: they are outliers of the fit with it, not of the one without."""
    middle = (391.0, 391.0)
    lattice, warp = Lattice.square(31.25, origin=middle), Warp(middle, (1.9e-6, 0.0))
    indices = np.stack(np.meshgrid(*2 * [np.arange(-12, 13)], indexing="ij"), -1).reshape(-1, 2)
    inwards = np.select([np.abs(indices) == 12, np.abs(indices) == 11], [0.06, 0.03])
    centers = warp.applied(lattice.position(indices)) - np.sign(indices) * inwards
    centers += rng.normal(0, 0.003, centers.shape)
    none = np.zeros((0, 2), int)
    model = Calibration(lattice, (783, 783), none, none.astype(float), 0.0)
    found = fitting.fit(Spots(indices, centers, np.ones(len(indices))), model)
    assert found.warp is not None
    assert found.warp.tilt == pytest.approx(warp.tilt, abs=5e-8)
    assert len(found.spots.indices) == len(indices)


@pytest.mark.long
@pytest.mark.parametrize(
    "built", [{"sensor_tilt": ("95 mrad", "0 mrad")}, {"array_tilt": ("0 mrad", "80 mrad")}]
)
def test_a_camera_that_leans_is_calibrated_by_its_own_white_image(built):
    """Micro-images of simulated light stand where the fit says, to 0.05 px; a straight lattice is off."""
    camera = lg.PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    camera = camera.replace(lenslets={"count": (25, 25)}, built=built)
    found, rays = (
        lg.calibrate(lg.simulate(camera, lg.targets.white(), lg.Incoherent(1e-2))),
        camera.calibration,
    )

    def off(model):
        at = np.stack(model.index(*rays.centers.T), -1)
        return float(np.hypot(*(model.position(at) - rays.centers).T).max())

    assert off(found) < 0.05
    assert off(replace(found, warp=None)) > 0.2


def test_a_tilt_and_a_radial_distortion_are_fitted():
    warp = Warp((149.5, 159.5), (1.5e-4, -8e-5), 2e-7)
    white, true = calibration_drawing.white(Lattice.square(14.7, 0.01), (300, 320), fill=0.8, warp=warp)
    found = calibrate(white)
    assert found.warp is not None
    np.testing.assert_allclose(found.warp.tilt, warp.tilt, atol=1e-5)
    assert found.warp.radial == pytest.approx(warp.radial, rel=0.1)
    indices = np.stack(found.index(*true.T), -1)
    assert np.hypot(*(found.position(indices) - true).T).max() < 0.05


@pytest.mark.parametrize("pitches", [(14.0, 14.0), (12.0, 13.5), (16.0, 18.0)])
def test_a_pitch_of_whole_pixels_without_noise_has_true_centres(pitches):
    """Their mean has steps between its samples, which the shift followed by up to 0.32 px."""
    y, x = np.mgrid[:240, :260].astype(float)
    away = [
        np.abs((v - c + p / 2) % p - p / 2) for v, c, p in ((y, 120.3, pitches[0]), (x, 130.7, pitches[1]))
    ]
    white = np.prod(
        [1 / (1 + np.exp((v - 0.43 * p) / 0.8)) for v, p in zip(away, pitches, strict=True)], axis=0
    )
    found = lg.calibrate(lg.RawImage(white))
    place = found.position(found.indices) - (120.3, 130.7)
    off = (place + np.array(pitches) / 2) % pitches - np.array(pitches) / 2
    assert np.abs(off).max() < 0.02
