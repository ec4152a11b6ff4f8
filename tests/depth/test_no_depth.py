"""Views that hold no depth, or not one: confidence, expected errors and words say so."""

import warnings

import numpy as np
import pytest
from scenes import texture, views_of

from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.depth import epi
from lumigraph.depth.chance import by_chance
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.repeats import first_alike, repeats
from lumigraph.errors import GeometryError, SamplingWarning

CHANCE = "match no better than by chance"


def flat(disparity):
    return lambda y, x: disparity + 0 * y + 0 * x


def field(data):
    return LightField(data, Grid(data.shape[:2], 1.0), Grid(data.shape[2:4], 1.0), 20.0)


def scene(disparity=0.4, shape=(64, 72), views=(5, 5)):
    rng = np.random.default_rng(1)
    return views_of([(texture(rng), lambda y, x: disparity + 0.005 * x, None)], shape, views)


def grating(period, disparity, across=True, shape=(80, 80), views=(5, 5)):
    def waves(y, x):
        along = (x, y) if across else (x,)
        return 1.1 + 0.4 * sum(np.cos(2 * np.pi / period * place) for place in along)

    views, truth = views_of([(waves, flat(disparity), None)], shape, views)
    return field(views.data + 0.01 * np.random.default_rng(3).standard_normal(views.data.shape)), truth


@pytest.mark.parametrize("deviation", [0.02, 0.3])
@pytest.mark.parametrize("shape", [(5, 5, 64, 64), (1, 9, 64, 72), (3, 3, 48, 64, 3)])
def test_noise_has_no_confidence(deviation, shape):
    """40 to 96 % of it had a confidence above 0.5."""
    noise = 1 + deviation * np.random.default_rng(2).standard_normal(shape)
    with pytest.warns(SamplingWarning, match=CHANCE):
        found = epi(field(np.maximum(noise, 0)))
    assert (np.asarray(found.confidence) > 0.5).mean() < 0.03


def test_smooth_noise_has_no_confidence():
    from scipy.ndimage import gaussian_filter

    noise = np.random.default_rng(2).standard_normal((5, 5, 64, 64))
    smooth = gaussian_filter(noise, (0, 0, 1, 1))
    with pytest.warns(SamplingWarning, match=CHANCE):
        found = epi(field(1 + 0.2 * smooth / smooth.std()))
    assert (np.asarray(found.confidence) > 0.5).mean() < 0.03


@pytest.mark.parametrize("deviation", [0.0, 0.5])
def test_a_texture_among_noise_does_not_match_by_chance(deviation):
    """The noise is 0.8 of the texture: a bound of chance by the noise alone would doubt it."""
    views, truth = scene()
    data = views.data + deviation * np.random.default_rng(2).standard_normal(views.data.shape)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "4% of the light")
        found = epi(field(data + 1))
    assert np.median(found.confidence) > 0.75
    assert np.abs(found.values - truth).mean() < 0.15


def test_part_of_a_picture_that_is_noise_has_no_confidence():
    views, _ = scene(shape=(64, 128))
    noise = 1 + 0.3 * np.random.default_rng(2).standard_normal((*views.data.shape[:3], 64))
    data = np.concatenate([views.data[..., :64], np.maximum(noise, 0)], -1)
    with pytest.warns(SamplingWarning, match=r"(3|4|5).% of the places match no better"):
        trust = np.asarray(epi(field(data)).confidence)
    assert np.median(trust[:, :48]) > 0.9
    assert trust[:, 84:].max() < 0.3


@pytest.mark.parametrize("change", ["u", "v", "turned", "shuffled"])
def test_views_that_are_mirrored_or_in_the_wrong_order_are_told(change):
    views, _ = scene(0.8)
    data = {
        "u": lambda a: a[:, ::-1],
        "v": lambda a: a[::-1],
        "turned": lambda a: a[..., ::-1],
        "shuffled": lambda a: np.random.default_rng(5).permutation(a.reshape(25, 64, 72)).reshape(a.shape),
    }[change](views.data)
    with pytest.warns(SamplingWarning, match=CHANCE + ".*in order and not mirrored"):
        found = epi(field(data.copy()))
    assert (np.asarray(found.confidence) > 0.5).mean() < 0.1


@pytest.mark.parametrize(
    ("disparity", "said"), [(3.0, "finds [12].* to [34].* px: give a wider range"), (6.0, "")]
)
def test_disparities_far_outside_the_range_are_told(disparity, said):
    views, truth = scene(disparity)
    with pytest.warns(SamplingWarning, match=rf"chance at disparities of -1 to 1 px.*{said}"):
        found = epi(views, (-1, 1))
    assert (np.asarray(found.confidence) > 0.5).mean() < 0.02
    assert found.error.mean() > 0.3 * np.abs(found.values - truth).mean()


@pytest.mark.parametrize(
    ("period", "disparity", "across"), [(3.5, -0.52, True), (3.5, -0.52, False), (5, 2, True)]
)
def test_a_grating_may_be_off_by_its_period(period, disparity, across):
    views, truth = grating(period, disparity, across)
    with pytest.warns(SamplingWarning, match=rf"100% of the places repeat every {period:g}"):
        found = epi(views)
    assert np.asarray(found.confidence).max() < 0.1
    assert 0.97 * period < np.median(found.error) < 1.5 * period
    off = (found.values - truth)[6:-6, 6:-6] / period  # which of the periods it is cannot be told
    assert np.abs(off - np.rint(off)).mean() < 0.03


def test_of_a_grating_some_period_is_in_the_range():
    """Pictures four times smaller show it 5 px to the left, or rather half that."""
    views, truth = grating(5, 1.7, True, (96, 96), (9, 9))
    with pytest.warns(SamplingWarning, match="places repeat every 5 px"):
        off = (epi(views).values - truth)[6:-6, 6:-6] / 5
    assert np.abs(off - np.rint(off)).mean() < 0.03


def test_a_grating_is_told_if_the_range_is_less_than_its_period():
    views, truth = grating(3.5, -0.52)
    found = epi(views, (-1.3, 0.3))
    assert np.abs(found.values - truth).mean() < 0.02
    assert np.asarray(found.confidence).min() > 0.9


def test_periods_are_those_that_all_views_share():
    """Off by a third of a pixel, the outermost views would see a texture that is 0.7 of itself."""
    pictures = Pictures.of(grating(4.3, 0.2)[0])
    found = repeats(pictures, 20.0)
    assert found / pictures.reach == pytest.approx(4.3, abs=0.06)
    assert not repeats(pictures, 8.0).any()
    assert not repeats(Pictures.of(scene()[0]), 20.0).any()
    tiny = LightField(grating(3.5, 0.2)[0].data[..., :20, :20], Grid((5, 5), 1.0), Grid((20, 20), 1.0), 20.0)
    assert not repeats(Pictures.of(tiny), 20.0).any()


def test_what_views_show_of_a_texture_is_a_match_and_half_of_it_is_doubtful(rng):
    own = 0.2 * rng.standard_normal((64, 64))
    parts = [by_chance(part * own**2, own**2, 2e-3, 24).mean() for part in (1.0, 0.55, 0.2)]
    assert parts == pytest.approx([0, 0.5, 1], abs=0.01)


def test_saturated_places_are_told_and_have_what_is_near():
    rng = np.random.default_rng(1)
    near = (texture(rng), flat(1.2), lambda y, x: (abs(y) < 14) & (abs(x) < 14))
    views, truth = views_of([near, (texture(rng), flat(0.2), None)], views=(5, 5))
    clipped = field(np.minimum(views.data, np.quantile(views.data, 0.12)))
    with pytest.warns(SamplingWarning, match=r"(3|4|5|6).% of the middle view are saturated"):
        found = epi(clipped)
    wrong = np.abs(found.values - truth) > 0.5
    assert 0.01 < wrong.mean() < 0.2
    assert np.median(found.confidence[wrong]) < 0.7
    white = clipped.data[2, 2] == clipped.data.max()
    assert 0.5 < found.error[white].mean() / np.abs(found.values - truth)[white].mean() < 3


def test_values_that_are_no_light_are_refused():
    views, truth = scene()
    data = views.data.copy()
    data[2, 2, 40, 40] = data[1, 3, 10, 10] = 1e30
    with pytest.raises(GeometryError, match=r"holds 1e\+30 where 99.9% .* Replace the 2 broken values"):
        epi(field(data))
    with pytest.raises(GeometryError, match=r"100% of the light field are negative light, down to -[23]"):
        epi(field(-views.data))
    with pytest.warns(SamplingWarning, match=r"% of the light field are negative light, .* count as 0"):
        epi(field(views.data - 0.8))
    for unit in (1e60, 1e-60):  # not of single precision: no number warns
        assert np.abs(epi(field(unit * views.data)).values - truth).mean() < 0.01


def test_what_looks_alike_is_judged_above_the_noise():
    """Half the mean square of a picture that repeats every 2 px: noise, and its texture in between."""
    moves, noise, variance = np.arange(0.1, 4, 0.1), 0.3, np.array([1.0, 0.31, 0.29, 20.0])
    texture = np.sin(np.pi * moves / 2)[:, None] ** 2 * variance
    found = first_alike(noise + texture, moves, variance, noise)
    # A texture below the noise looks alike anyway.
    assert found == pytest.approx([2.0, 2.0, 0.0, 2.0], abs=0.01)
    off = noise + texture + 0.06 * variance  # by more than places alike may differ
    assert not first_alike(off, moves, variance, noise).any()
    near = noise + texture + 0.04 * variance
    assert first_alike(near, moves, variance, noise)[[0, 3]] == pytest.approx([2.0, 2.0], abs=0.01)
    flat = noise + 0.29 * texture  # never quite different
    assert not first_alike(flat, moves, variance, noise).any()
