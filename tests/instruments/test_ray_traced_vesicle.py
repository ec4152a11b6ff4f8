"""A ray-traced light field of a known vesicle, of napari-LF's samples: the volume comes back."""

import numpy as np
import pytest

import lumigraph as lg
from data_folder import real
from lumigraph.deconvolution import Exposure, LowPass, RichardsonLucy, TotalVariation, deconvolve
from lumigraph.deconvolution.filters import widths_of

PITCH = 104e-6 / 60 / 3
"""Of the true volume, along all axes: three samples per lenslet, one on the lenslet's axis."""


SCOPE = lg.LightFieldMicroscope.from_catalogue("lfm-guv-simulated").replace(sensor={"fill_factor": 0.1})
"""The light field was traced by one ray through the middle of each pixel, as its radiometry image shows."""


def radial_peak(volume):
    """Radius of the brightest shell about the middle [m]: the mean over the profile's upper half."""
    at = (np.arange(47) - 23) * PITCH
    radius = np.sqrt(at[:, None, None] ** 2 + at[:, None] ** 2 + at**2).ravel()
    edges = np.arange(5e-6, 20e-6, 0.25e-6)
    profile = np.histogram(radius, edges, weights=volume.ravel())[0] / np.histogram(radius, edges)[0]
    profile = np.where(profile > profile.max() / 2, profile, 0)
    return profile @ (edges[1:] + edges[:-1]) / 2 / profile.sum()


def steps(plane):
    """Differences across lenslets' borders over all differences: 1 for a picture without blocks."""
    jump = np.abs(np.diff(plane, axis=1))
    return jump[:, ::3].mean() / jump.mean()


def low_pass(operator):
    return LowPass(widths_of(SCOPE.low_pass_distances(operator.depths), operator.object_grid.pitch[0]))


def seen_and_true():
    folder = real("lfm_guv_simulated")
    names = ("LightField_GUVSimul1", "Radiometry_GUVSimul1")
    raw, white = (lg.open(folder / f"{name}.tif").data.astype(np.float32) for name in names)
    return raw, white, lg.io.open(folder / "GUVSimul1_VolumeGroundTruth.tif").data.astype(np.float32)


def even_cell(operator):
    """What an even object shows behind the lenslets in the middle, on average."""
    even = operator.forward(np.ones(operator.shape[1], np.float32))
    return even.reshape(29, 16, 29, 16)[10:19, :, 10:19].mean((0, 2))


def exposure_of(white, operator):
    """White image over the model's, each the mean over lenslets; pixels without light are left out."""
    even, white = even_cell(operator), white.reshape(29, 16, 29, 16).mean((0, 2))
    used = (even > 0) & (white > 0)
    response = np.where(used, white / np.where(used, even, 1), 0)
    response, used = (
        np.tile(one, (29, 29)).astype(np.float32) for one in (response / np.median(response[used]), used)
    )
    return Exposure(response=response, weights=used)


@pytest.fixture(scope="module")
def vesicle():
    depths = (np.arange(47) - 23) * PITCH
    operator = SCOPE.operator(depths, 3, pixels=16)
    raw, white, truth = seen_and_true()
    return operator, raw, exposure_of(white, operator), truth


@pytest.mark.long
def test_pixels_of_the_radiometry_image_see_one_direction_each(vesicle):
    # Whole pixels read up to a fifth less at the rim of a micro-image, where the stop cuts them: 0.15 rms.
    exposure = vesicle[2]
    response = exposure.response[exposure.weights > 0]
    assert response.std() / response.mean() < 0.01


@pytest.mark.long
def test_the_true_volume_makes_the_light_field(vesicle):
    # By waves of 593 nm 0.89, by waves of 300 nm 0.93, and 0.985 by rays that whole pixels average.
    operator, raw, exposure, truth = vesicle
    volume = np.zeros(operator.shape[1], np.float32)
    volume[:, 20:67, 20:67] = truth
    seen = operator.forward(volume) * exposure.response
    used = exposure.weights > 0
    assert np.corrcoef(seen[used], raw[used])[0, 1] > 0.998


@pytest.mark.long
def test_the_light_field_makes_the_true_volume(vesicle):
    operator, raw, exposure, truth = vesicle
    method = RichardsonLucy(TotalVariation(0.005), low_pass(operator), accelerated=True)
    volume = deconvolve(raw, operator, 30, method=method, exposure=exposure)[:, 20:67, 20:67]
    assert np.corrcoef(volume.ravel(), truth.ravel())[0, 1] >= 0.91
    assert radial_peak(volume) == pytest.approx(13.0e-6, abs=0.6e-6)
    assert steps(volume[23]) == pytest.approx(steps(truth[23]), abs=0.15)


@pytest.mark.long
def test_the_low_pass_takes_the_blocks_away_and_makes_it_truer(vesicle):
    operator, raw, exposure, truth = vesicle
    volumes = [
        deconvolve(raw, operator, 30, method=RichardsonLucy(filter=one), exposure=exposure)[:, 20:67, 20:67]
        for one in (None, low_pass(operator))
    ]
    plain, smooth = (
        [np.corrcoef(v.ravel(), t.ravel())[0, 1] for v, t in ((v, truth), (v[23], truth[23]))]
        for v in volumes
    )
    assert smooth[0] >= 0.84
    assert smooth[0] > plain[0] - 0.001
    assert smooth[1] > plain[1] + 0.1
    assert steps(volumes[0][23]) > 2
    assert steps(volumes[1][23]) == pytest.approx(steps(truth[23]), abs=0.15)
