"""Aberrations of a camera 1.0 from a flat scene, whose raw image another operator makes."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from tests.studies.adaptive.test_estimate import SCOPE

import lumigraph as lg
from lumigraph.deconvolution import Exposure
from lumigraph.elements.zernike import zernike
from lumigraph.operators.lenslets.point_changes import point_changes
from lumigraph.scene import Points
from lumigraph.studies.adaptive import estimate
from lumigraph.studies.adaptive.checked import bent
from lumigraph.studies.adaptive.scene import OF_PICTURE, EstimatedScene, finest, inner_pixels, own_defocus
from lumigraph.studies.adaptive.start import starts
from lumigraph.studies.adaptive.voxels import Voxels

CAMERA = lg.PlenopticCamera(
    wavelength="600 nm",
    object_distance="400 mm",
    main_lens={"focal_length": "200 mm"},
    lenslets={"pitch": "60 um", "count": (9, 9), "focal_length": "1.25 mm", "offset": (11e-6, -7e-6)},
    sensor={"pixel_pitch": "5 um"},
)
EXPOSURE = Exposure(background=0.01, gain=1.0)
NEARER = -3e-3
"""Depth of a picture out of focus [m]."""


@cache
def exposed(aberrations, dz=0.0, camera=CAMERA, electrons=300.0, seed=0):
    """A raw image by the lenslet-periodic operator, of finer samples, through an array that ends."""
    operator = bent(camera, *zip(*aberrations, strict=True)).operator((dz,), 9, accuracy=5e-3)
    texture = gaussian_filter(np.random.default_rng(seed).normal(size=operator.shape[1]), (0, 7, 7))
    light = operator.forward(np.maximum(texture / texture.std() + 0.7, 0.02).astype(np.float32))
    light = np.maximum(light, 0) * electrons / light.mean()
    return np.random.default_rng(seed).poisson(light + 0.01).astype(np.float32)


@pytest.mark.parametrize(("built", "dz"), [({}, 0.0), ({}, 4e-3), ({"separation": "400.5 mm"}, 0.0)])
def test_a_camera_sees_points_as_its_own_waves_do(built, dz):
    """As those of a telecentric microscope, whose lenslets stand at another distance from the sensor.

    Behind 25 x 25 lenslets: 9 x 9 end within the light, which takes 1.1 % off the changes at any accuracy.
    Changes are of light farther out, where errors are twice as large.
    """
    camera, terms = CAMERA.replace(built=built, lenslets={"count": (25, 25)}), (4, 6, 7)
    c, place = np.array([0.1, -0.2, 0.3]), np.array([13e-6, -21e-6, dz])
    wanted, changes = point_changes(bent(camera, terms, c), place, terms, 1e-3)
    images = camera.pupil_images(terms, dz=dz, accuracy=1e-3)
    point = Points(np.append(place[:2], 0.0)[None], np.ones(1))
    area = np.vdot(images.forward(point, c), wanted) / np.vdot(wanted, wanted)
    assert np.linalg.norm(images.forward(point, c) / area - wanted) < 1e-3 * np.linalg.norm(wanted)
    for direction, change in zip(np.eye(3), changes, strict=False):
        off = images.derivative(point, c, direction) / area - change
        assert np.linalg.norm(off) < 3e-3 * np.linalg.norm(change)


@pytest.mark.parametrize("dz", [0.0, 4e-3])
def test_a_picture_is_seen_as_the_cameras_operator_sees_it(dz):
    """As bright, too; but for the outermost lenslets, beyond which the array ends."""
    sight = EstimatedScene(CAMERA, (dz,), replace(OF_PICTURE, accuracy=2e-3), None).sight((6,))
    picture = np.zeros((1, *sight.grid.shape), np.float32)
    inner = (slice(None), *sight.inside)
    picture[inner] = 1 + np.random.default_rng(1).uniform(size=picture[inner].shape)
    operator = CAMERA.operator_on(sight.picture, (dz,), accuracy=5e-3)
    wanted, found = operator.forward(picture[inner]), sight.operator(np.zeros(1)).forward(picture)
    counted = inner_pixels(CAMERA, None) > 0
    assert np.std((found - wanted)[counted]) < 0.015 * np.std(wanted[counted])
    assert np.mean(found[counted]) == pytest.approx(np.mean(wanted[counted]), rel=4e-3)


def test_pixels_where_the_array_ends_do_not_count():
    pitch = CAMERA.calibration.lattice.pitch
    counted = inner_pixels(CAMERA, None)
    assert counted.shape == CAMERA.sensor.shape
    assert counted.sum() == pytest.approx((5 * pitch) ** 2, rel=0.04)
    rows, columns = (np.flatnonzero(counted.sum(k)) for k in (1, 0))
    middle = CAMERA.calibration.centers.mean(0)
    assert [np.mean(rows), np.mean(columns)] == pytest.approx(middle, abs=0.6)
    cropped = CAMERA.replace(sensor={"shape": (49, 49)})
    assert inner_pixels(cropped, None).min() == 1  # lenslets go on beside the pixels
    assert inner_pixels(cropped, cropped.calibration).min() == 0


@pytest.mark.parametrize("instrument", ["camera", "microscope"])
def test_a_depth_is_as_much_of_defocus(instrument):
    """Noll's term 4 of its phase, by least squares over the pupil."""
    if instrument == "camera":
        images, depth = CAMERA.pupil_images((6,), dz=5e-3), 0.0
    else:
        images, depth = SCOPE.pupil_images((6,)), 2e-6
    one = images.objectives[0]
    y, x = np.mgrid[-1:1:101j, -1:1:101j]
    rho, angle = np.hypot(y, x), np.arctan2(y, x)
    inside, na = rho < 1, one.numerical_aperture
    waves = one.phase(na * y[inside], na * x[inside], depth) / (2 * math.pi)
    basis = np.stack([zernike(j, rho[inside], angle[inside]) for j in (1, 4)], 1)
    fitted = np.linalg.lstsq(basis, waves)[0][1]
    assert abs(fitted) > 0.1
    assert own_defocus(images, depth) == pytest.approx(fitted, rel=0.1 if depth else 1e-3)


def test_samples_of_a_picture_hold_how_points_images_change():
    """p D/(λ L) periods along a lenslet, and a tenth more."""
    assert finest(CAMERA.pupil_images((6,))) == math.ceil(1.1 * 60 * CAMERA.pupil_diameter / 0.24)


def test_the_start_knows_the_scenes_own_defocus():
    raw, scene = exposed(((4, 0.1), (7, 0.2)), NEARER), EstimatedScene(CAMERA, (NEARER,), OF_PICTURE, None)
    voxels = Voxels(sight := scene.sight((4, 7)), raw, EXPOSURE)
    begun = voxels.begun(np.zeros(2), 1)
    defocus = own_defocus(sight.images, 0.0)
    assert abs(defocus) > 0.3
    found = starts(begun.problem, CAMERA, (4, 7), None, defocus)
    assert found[0] == pytest.approx([0.1, 0.2], abs=0.15)  # as rays see it


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"object": "volume"}, "need a 'picture'"),
        ({"object": "beads"}, "need a 'picture'"),
        ({"depths": (0.0, 1e-3)}, "there are 2 depths but a picture stands at one"),
        ({"terms": (1, 2, 3)}, "the picture explains 1 to 3 itself"),
        ({"regions": (2, 2)}, "a picture has one"),
        ({"microscope": lg.load_camera("thesis-plenoptic-2-m050")}, "or a PlenopticCamera"),
        ({"microscope": CAMERA.replace(lenslets={"rotation": 0.1})}, "rows and columns along the sensor's"),
        ({"microscope": CAMERA.replace(lenslets={"layout": "hex"})}, "rows and columns along the sensor's"),
        ({"microscope": CAMERA.replace(model="exact")}, "Use model = 'paraxial'"),
        ({"microscope": CAMERA.replace(built={"focal_length_scatter": 0.01})}, "lenslets that are alike"),
        ({"microscope": CAMERA.replace(lenslets={"shape": "round"})}, "square"),
    ],
)
def test_what_is_no_picture_before_a_camera_is_refused(given, message):
    raw = np.ones(CAMERA.sensor.shape, np.float32)
    asked = {"microscope": CAMERA, "depths": (0.0,), "terms": (4, 6), "object": "picture", **given}
    with pytest.raises(lg.LumigraphError, match=message):
        estimate(raw, **asked)


@pytest.mark.long
@pytest.mark.parametrize("dz", [0.0, NEARER])
def test_aberrations_come_back_with_the_picture(dz):
    true = {4: 0.15, 6: 0.25, 7: -0.2}
    found = estimate(
        exposed(tuple(true.items()), dz), CAMERA, (dz,), (2, *true, 8), exposure=EXPOSURE, object="picture"
    )
    assert found.coefficients == pytest.approx({**true, 8: 0.0}, abs=0.03)
    assert set(found.untold) == {2}
    off = found.values.ravel() - np.array([*true.values(), 0.0])
    assert off @ np.linalg.solve(found.covariance, off) < 18  # χ² of four: 1e-3 are above
    assert found.deviance[1] < found.deviance[0]
    assert isinstance(found.instrument, lg.PlenopticCamera)
    assert found.volume is not None
    assert found.volume.depths == (dz,)
    assert found.volume.grid == EstimatedScene(CAMERA, (dz,), OF_PICTURE, None).sight((4,)).picture


@pytest.mark.long
def test_no_aberration_of_a_picture_is_invented():
    """Behind lenslets of 120 µm; behind 5 x 5 of 60 µm that count, up to 0.023 waves of defocus are."""
    camera = CAMERA.replace(
        lenslets={"pitch": "120 um", "focal_length": "2.5 mm", "count": (10, 10)},
        sensor={"pixel_pitch": "8 um"},
    )
    raw = exposed.__wrapped__(((4, 0.0),), 0.0, camera, 100.0)
    found = estimate(raw, camera, (0.0,), (4, 6, 7, 11), exposure=EXPOSURE, object="picture")
    assert found.rms < 0.01
    assert (found.deviations > 1e-3).all()


def test_what_pulls_is_how_far_slopes_of_noise_are_off_at_the_truth():
    """Six drawings of 30 electrons and fine texture: 7 deviations from 0. Defocus alone."""
    camera = CAMERA.replace(lenslets={"count": (7, 7)})
    scene, c = EstimatedScene(camera, (0.0,), OF_PICTURE, None), np.array([0.1])
    operator = (sight := scene.sight((4,))).operator(c)
    texture = gaussian_filter(np.random.default_rng(1).normal(size=operator.shape[1]), (0, 2, 2))
    light = np.maximum(operator.forward(np.maximum(1 + 6 * texture, 0.05).astype(np.float32)), 0)
    light *= 30 / light.mean()
    slopes, pulls = [], []
    for seed in range(6):
        raw = np.random.default_rng(seed).poisson(light + 0.01).astype(np.float32)
        exposure = scene.counted(EXPOSURE)
        voxels = Voxels(sight, raw, exposure, method=scene.method(sight), least=OF_PICTURE.least)
        told = voxels.begun(c, OF_PICTURE.iterations[1])
        slopes.append(voxels.around(told).slope[0])
        if seed < 3:
            pulls.append(voxels._pull(told)[0])
    unsure = np.std(slopes) / math.sqrt(5)
    assert np.mean(slopes) > 4 * unsure
    assert np.mean(pulls) == pytest.approx(np.mean(slopes), abs=3 * unsure)
