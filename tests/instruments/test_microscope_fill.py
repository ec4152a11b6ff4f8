"""Pixels of a microscope that are active in part, beside smaller pixels that are active all over."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.instruments import LightFieldMicroscope

COARSE = {
    "wavelength": "525 nm",
    "objective": {"magnification": 20.0, "numerical_aperture": 0.5},
    "lenslets": {"pitch": "125 um", "focal_length": "2.5 mm", "count": (5, 5)},
    "sensor": {"pixel_pitch": "13.7 um", "shape": (45, 45), "fill_factor": 1 / 3},
}
FINE = {**COARSE, "sensor": {"pixel_pitch": 13.7e-6 / 3, "shape": (135, 135)}}
MIDDLE = (slice(1, None, 3),) * 2
"""Of three by three whole pixels the one that stands where the active part of a larger one is."""


def apart(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


@pytest.mark.parametrize(
    ("scene", "count"),
    [
        (lg.targets.points([(3e-6, -2e-6, 9e-6)]), 5),
        pytest.param(lg.targets.white(), 3, marks=pytest.mark.long),
    ],
    ids=["point", "white"],
)
def test_a_pixel_active_in_part_reads_a_ninth_of_what_a_third_of_it_does(scene, count):
    # Pixels that are active all over read nine times as much light, and the point 9 % off beside it.
    scopes = (
        LightFieldMicroscope(**one).replace(
            lenslets={"count": (count, count)}, sensor={"shape": (pixels * count, pixels * count)}
        )
        for one, pixels in ((COARSE, 9), (FINE, 27))
    )
    seen, fine = (np.asarray(lg.simulate(scope, scene).data) for scope in scopes)
    assert apart(seen, fine[MIDDLE] / 9) < 2e-3


def test_volumes_and_images_by_the_pupil_have_such_pixels_too():
    # Each is good to 1e-2.
    scopes = [LightFieldMicroscope(**one) for one in (COARSE, FINE)]
    volume = np.random.default_rng(3).random((2, 15, 15)).astype(np.float32) ** 8
    seen, fine = (one.operator((-9e-6, 6e-6), 3, accuracy=1e-2).forward(volume) for one in scopes)
    assert apart(seen, fine[MIDDLE] / 9) < 1e-2
    point = lg.targets.points([(3e-6, -2e-6, 9e-6)])
    seen, fine = (
        one.pupil_images((5,), farthest=9e-6).forward(point.parts[0], np.array([0.05])) for one in scopes
    )
    assert apart(seen, fine[MIDDLE] / 9) < 1e-2


def test_rays_meet_the_active_part_of_a_pixel():
    # Of either sampling as many rays pass the stop, but for its edge.
    rays = {"objective": {**COARSE["objective"], "model": "rays"}}
    coarse, fine = (
        LightFieldMicroscope(**{**COARSE, **rays, "sensor": {**COARSE["sensor"], "fill_factor": fill}})
        for fill in (1 / 3, 1.0)
    )
    volume = np.random.default_rng(3).random((2, 15, 15)).astype(np.float32) ** 8
    seen, whole = (
        one.operator((-9e-6, 6e-6), 3, pixels=n).forward(volume) for one, n in ((coarse, 9), (fine, 27))
    )
    assert apart(seen * whole[MIDDLE].sum() / seen.sum(), whole[MIDDLE]) < 1e-5
    assert seen.sum() == pytest.approx(whole[MIDDLE].sum() / 9, rel=0.02)


def test_rays_are_interpolated_between_samples_as_close_as_the_active_part_asks():
    rays = {**COARSE, "objective": {**COARSE["objective"], "model": "rays"}}
    scopes = LightFieldMicroscope(**rays), LightFieldMicroscope(**{**FINE, "objective": rays["objective"]})
    volume = np.random.default_rng(3).random((1, 15, 15)).astype(np.float32) ** 8
    seen, fine = (one.operator((9e-6,), 3).forward(volume) for one in scopes)
    assert apart(seen, fine[MIDDLE] / 9) < 0.06


def test_pixels_of_fourier_microscopes_are_whole():
    scope = LightFieldMicroscope.from_catalogue("lfm-fourier")
    with pytest.raises(lg.GeometryError, match=r"fill_factor is 0.8 but pixels of Fourier microscopes are"):
        scope.replace(sensor={"fill_factor": 0.8})
