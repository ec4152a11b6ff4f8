"""The demonstration shows what its captions say."""

import numpy as np

import lumigraph as lg
from lumigraph.demo.helix import helix
from lumigraph.demo.showcase import alphas, shown


def sharpness(picture, part):
    return float(np.abs(np.diff(np.asarray(picture)[part].sum(-1), axis=1)).mean())


def test_each_picture_of_the_still_life_is_sharpest_where_its_caption_says():
    sample = lg.samples.scene((99, 176), 7)
    pictures = [lg.refocus(sample.views, alpha, oversample=1) for alpha in alphas(sample.views)]
    # The leaves at the lower right, the robot's face and the wall beside it.
    parts = (np.s_[60:90, 135:160], np.s_[25:52, 75:101], np.s_[5:20, 10:50])
    found = [[sharpness(picture, part) for picture in pictures] for part in parts]
    assert [int(np.argmax(row)) for row in found] == [0, 1, 2]


def test_pictures_are_shown_upright_and_from_black_to_white():
    picture = np.zeros((20, 30, 3))
    picture[:5] = 2.0
    found = shown(picture)
    assert found.dtype == np.uint8
    assert found[:5].min() == 255
    assert found[5:].max() == 0


def test_the_volume_of_the_microscope_is_the_helix():
    sample = helix()
    truth, found = (np.asarray(volume.data, float) for volume in (sample.truth, sample.found))
    assert np.corrcoef(truth.ravel(), found.ravel())[0, 1] > 0.6
    mirrored = np.corrcoef(truth[..., ::-1].ravel(), found.ravel())[0, 1]
    assert np.corrcoef(truth.ravel(), found.ravel())[0, 1] > mirrored + 0.2
