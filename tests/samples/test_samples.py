"""Samples: their truth is true, they are always the same, and they survive their files."""

import numpy as np
import pytest

import lumigraph as lg


@pytest.fixture(scope="module")
def sample():
    return lg.samples.scene((72, 96), 5)


def moved(picture, down, across):
    """A picture moved by parts of a pixel, by its spectrum."""
    fy, fx = np.fft.fftfreq(picture.shape[0])[:, None], np.fft.fftfreq(picture.shape[1])
    return np.fft.ifft2(np.fft.fft2(picture) * np.exp(-2j * np.pi * (fy * down + fx * across))).real


def test_things_move_from_view_to_view_as_their_disparity_says(sample):
    middle, corner = (sample.views.data[k, k, ..., 1] for k in (2, 3))
    wall = slice(4, 14), slice(60, 70)
    disparity = np.asarray(sample.disparity.values)[wall]
    assert np.ptp(disparity) == 0
    far = float(disparity.mean())
    error = {d: np.abs(moved(middle, d, d) - corner)[wall].mean() for d in (far, -far, 0.0)}
    assert error[far] < 0.7 * min(error[-far], error[0.0])


def test_a_depth_map_of_the_views_finds_the_truth(sample):
    found = lg.depth.epi(sample.views)
    error = np.abs(np.asarray(found.values) - np.asarray(sample.disparity.values))
    assert np.nanmedian(error) < 0.12  # of -1.5 to 1.5 px; a map of the other sign has 0.5


def test_what_stands_in_front_hides_what_is_behind(sample):
    truth = np.asarray(sample.disparity.values)
    nearest = truth == truth.max()
    green = sample.views.data[2, 2]
    assert nearest.mean() > 0.02
    assert np.mean(green[nearest][:, 1] > green[nearest][:, 0]) > 0.9  # leaves


def test_a_sample_is_the_same_every_time(sample):
    again = lg.samples.scene((72, 96), 5)
    np.testing.assert_array_equal(again.views.data, sample.views.data)


def test_more_samples_show_the_same_scene(sample):
    finer = lg.samples.scene((144, 192), 5).views.data[2, 2].reshape(72, 2, 96, 2, 3).mean((1, 3))
    assert np.sqrt(np.mean((finer - sample.views.data[2, 2]) ** 2)) < 0.05


def test_files_hold_what_was_made(tmp_path):
    files = lg.samples.write(tmp_path, ("scene",), size=(24, 32))
    assert [file.name for file in files] == ["scene.zarr", "scene-disparity.pfm"]
    views, truth = (lg.open(file) for file in files)
    sample = lg.samples.scene((24, 32))
    assert views.data.shape == sample.views.data.shape
    assert np.abs((views.data / 255.0) ** 2.2 - sample.views.data).max() < 0.02
    np.testing.assert_array_equal(
        getattr(truth, "values", getattr(truth, "data", None)), sample.disparity.values
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: lg.samples.scene((8, 64)), r"size\[0\]"),
        (lambda: lg.samples.scene(views=1), "views"),
        (lambda: lg.samples.bench("microscope"), "kind"),
        (lambda: lg.samples.volume(0.0), "photons"),
        (lambda: lg.samples.write("x", ("moon",)), "there is no sample 'moon'"),
    ],
)
def test_wrong_requests_are_refused(call, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(lg.LumigraphError, match=message):
        call()
