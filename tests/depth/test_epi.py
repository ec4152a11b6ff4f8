"""Disparities of scenes in closed form, of a benchmark's rendered scene, and what is refused."""

import numpy as np
import pytest
from scenes import texture, views_of

from data_folder import real
from lumigraph.core.arrays import namespace, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import silent
from lumigraph.depth import alpha_of, disparity_of, epi
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.shading import ShadingFit
from lumigraph.depth.smooth import Stiffness, tears, update
from lumigraph.depth.sweep import costs, span
from lumigraph.depth.visible import visible
from lumigraph.errors import GeometryError, SamplingWarning


def flat(disparity):
    return lambda y, x: disparity + 0 * y + 0 * x


@pytest.fixture
def paint():
    rng = np.random.default_rng(1)
    return [texture(rng) for _ in range(2)]


def noisy(views, deviation, rng):
    data = views.data + deviation * rng.standard_normal(views.data.shape)
    return LightField(data, views.aperture, views.lenslets, views.separation)


@pytest.mark.parametrize("disparity", [0.37, -1.6, 2.5])
def test_a_plane_is_found_to_a_hundredth_with_no_range_given(paint, disparity):
    views, truth = views_of([(paint[0], flat(disparity), None)])
    # A sweep alone is off by up to 0.05: half of what a parabola cannot tell between its labels.
    assert np.abs(epi(views).values - truth)[4:-4, 4:-4].max() < 0.012


def test_vignetting_without_a_white_image_is_not_taken_for_depth(paint):
    """With one brightness for each view, off by 0.48 px in the mean, and by 0.7 px where the map is sure."""
    views, truth = views_of([(paint[0], lambda y, x: 0.8 * np.tanh(x / 20) + 0 * y, None)])
    v, u, y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in views.data.shape), indexing="ij", sparse=True)
    light = 1 / (1 + np.exp((np.hypot(v - 1.2 * y, u - 1.2 * x) - 1.3) / 0.2))  # of a second stop
    dark = LightField(views.data * light, views.aperture, views.lenslets, views.separation)
    found = epi(noisy(dark, 0.004, np.random.default_rng(2)))
    error = np.abs(found.values - truth)
    assert error.mean() < 0.05
    assert np.percentile(error[found.confidence > 0.5], 99) < 0.4


def test_what_vignetting_cuts_off_counts_for_nothing(paint):
    """Matched in brightness only: off by 0.9 px in the mean, and nothing unknown."""
    views, truth = views_of([(paint[0], lambda y, x: 0.8 * np.tanh(x / 20) + 0 * y, None)])
    v, u, y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in views.data.shape), indexing="ij", sparse=True)
    light = np.hypot(v - 1.2 * y, u - 1.2 * x) < 1.3
    dark = LightField(views.data * light, views.aperture, views.lenslets, views.separation)
    found = epi(noisy(dark, 0.004, np.random.default_rng(2)))
    known = np.isfinite(found.values)
    assert (known & ~light[3, 3]).sum() < 0.08 * (~light[3, 3]).sum()  # corners of a pixel or two
    assert known.sum() > 0.9 * light[3, 3].sum()
    error = np.abs(found.values - truth)[known]
    assert error.mean() < 0.05
    assert np.percentile(error, 98) < 0.2
    assert np.asarray(found.confidence)[~known].max() == 0


def test_bright_things_before_a_dark_ground_are_not_taken_for_vignetting():
    def bead(y, x):
        return np.exp(-((y + 12) ** 2 + (x + 8) ** 2) / 18) + np.exp(-((y - 17) ** 2 + (x - 11) ** 2) / 8)

    views, _ = views_of([(bead, flat(0.8), None)], shape=(45, 30))
    found = Pictures.of(views)
    assert found.seen is not None
    assert found.seen[found.middle].all()
    assert found.seen.mean() > 0.999


def test_black_things_are_not_taken_for_vignetting(paint):
    def bar(y, x):
        return np.abs(x - 10) < 6

    light = 1 / (1 + np.exp((np.hypot(*np.ogrid[-3:4, -3:4])[..., None, None] - 0.1 * np.arange(72)) / 2))
    views, _ = views_of([(lambda y, x: 0 * y, flat(1.0), bar), (paint[0], flat(0.0), None)])
    dark = LightField(views.data * light, views.aperture, views.lenslets, views.separation)
    found = Pictures.of(noisy(dark, 0.004, np.random.default_rng(2)))
    assert found.seen is not None
    assert found.seen[found.middle].all()
    assert np.isfinite(epi(dark).values).all()


def test_a_slanted_plane_is_not_a_staircase(paint):
    views, truth = views_of([(paint[0], lambda y, x: 0.02 * x + 0.01 * y, None)])
    found = np.asarray(epi(views).values)[4:-4, 4:-4]
    assert np.abs(found - truth[4:-4, 4:-4]).max() < 0.012
    # Steps from lenslet to lenslet: 0.02 everywhere, where a staircase has 0 and 0.13.
    np.testing.assert_allclose(np.diff(found, axis=1), 0.02, atol=0.006)


def test_an_edge_of_depth_stays_where_it_is(paint):
    near = (paint[1], flat(1.2), lambda y, x: (np.abs(y) < 14) & (np.abs(x + 4) < 12))
    views, truth = views_of([near, (paint[0], lambda y, x: -0.8 + 0.01 * x, None)])
    error = np.abs(epi(views).values - truth)
    # The outline of the square is 104 places long, 2.3 % of all: less than one place beside it is wrong.
    assert (error > 0.07).mean() < 0.02
    assert np.median(error) < 0.004


def test_noise_costs_confidence_and_little_else(paint, rng):
    views, truth = views_of([(paint[0], lambda y, x: 0.4 + 0.01 * x, None)])
    clear, rough = epi(views), epi(noisy(views, 0.1, rng))
    assert np.abs(rough.values - truth).mean() < 0.01
    assert np.median(rough.confidence) < np.median(clear.confidence)
    assert np.median(rough.error) > max(1.5 * np.median(clear.error), np.median(clear.error) + 0.004)


def test_sure_places_have_smaller_errors(paint, rng):
    def fades(y, x):
        return 1 + (paint[0](y, x) - 1) * 0.5 ** (np.abs(x) / 5)

    views, truth = views_of([(fades, flat(0.6), None)])
    found = epi(noisy(views, 0.03, rng), (-2, 2))
    error, trust = np.abs(found.values - truth), np.asarray(found.confidence)
    sure = trust > np.median(trust)
    assert error[sure].mean() < 0.5 * error[~sure].mean()
    assert found.error[:, :8].mean() > 10 * found.error[:, 34:38].mean()
    # The expected error is that of the whole scene to a factor of two, though it was never seen.
    assert 0.5 < np.mean(found.error) / error.mean() < 2


def test_nearer_is_positive_and_alpha_below_one(paint):
    views, _ = views_of([(paint[0], flat(0.5), None)])
    views = LightField(views.data, Grid((7, 7), 2.0), Grid((64, 72), 0.1), 20.0)
    found = epi(views)
    assert np.median(found.values) == pytest.approx(0.5, abs=0.005)
    alpha = alpha_of(found, views)
    # x moves by (1 - α') Δu: 0.5 lenslets of 0.1 are (1 - α') 2.
    assert np.median(alpha.values) == pytest.approx(1 - 0.025, abs=5e-4)
    np.testing.assert_allclose(disparity_of(alpha, views).values, found.values, atol=1e-9)


def test_lenslets_that_are_not_square_move_less_along_y(paint):
    views, _ = views_of([(paint[0], flat(0.8), None)])
    y = np.linspace(0, 63, 32)  # every other row or so: 63/31 rows apart
    rows = np.floor(y).astype(int)
    part = (y - rows)[:, None]
    data = views.data[:, :, rows] * (1 - part) + views.data[:, :, np.minimum(rows + 1, 63)] * part
    stretched = LightField(data, Grid((7, 7), 1.0), Grid((32, 72), (63 / 31, 1.0)), 20.0)
    assert np.median(epi(stretched).values) == pytest.approx(0.8, abs=0.01)


def test_every_library_and_precision_comes_back(xp, paint):
    views, truth = views_of([(paint[0], flat(0.4), None)], shape=(24, 28), views=(3, 5))
    data = xp.asarray(views.data.astype(np.float32))
    found = epi(LightField(data, views.aperture, views.lenslets, 20.0), (-1, 1))
    assert namespace(found.values) is namespace(data)
    assert found.values.dtype == found.confidence.dtype == data.dtype
    assert np.median(np.abs(to_numpy(found.values) - truth)) < 0.01


def test_colours_dark_views_and_brightness_do_no_harm(paint):
    views, _ = views_of([(paint[0], flat(0.4), None)])
    data = views.data[..., None] * [0.3, 1.0, 0.6] * 7.0
    data = data * np.linspace(0.8, 1.1, 7)[:, None, None, None, None]
    data[0, 0] = data[6, 0] = data[0, 6] = data[6, 6] = 0  # outside a round aperture
    found = epi(LightField(data, views.aperture, views.lenslets, 20.0))
    assert np.median(np.abs(found.values - 0.4)) < 0.01


def test_views_of_one_row_are_enough(paint):
    views, _ = views_of([(paint[0], flat(-0.7), None)], views=(1, 9))
    assert np.median(np.abs(epi(views).values + 0.7)) < 0.01


def test_many_views_are_thinned_about_the_middle(paint):
    views, _ = views_of([(paint[0], flat(0.1), None)], shape=(24, 24), views=(1, 34))
    pictures = Pictures.of(views)
    assert pictures.data.shape[:2] == (1, 9)
    np.testing.assert_allclose(pictures.right * pictures.reach, np.arange(-16, 17, 4))


def test_the_range_is_found_before_the_sweep(paint):
    near = (paint[1], flat(1.5), lambda y, x: np.abs(y) < 14)
    views, _ = views_of([near, (paint[0], flat(-1.0), None)], shape=(128, 128))
    low, high = (end / 3 for end in span(Pictures.of(views))[0])  # 3 views to the outermost
    assert -2.3 < low < -1.0
    assert 1.5 < high < 2.8


def shaded(views, share):
    """Surfaces that look brighter from farther to one side, each place by another part."""
    v, u, y, x = (np.arange(n) - n // 2 for n in views.data.shape)
    change = share * np.sin(0.05 * y)[:, None] * v[:, None, None, None] / 3
    change = change + share * np.cos(0.04 * x) * u[:, None, None] / 3
    return LightField(views.data * (1 + change), views.aperture, views.lenslets, views.separation)


def test_gloss_does_not_look_like_depth(rng):
    faint = texture(rng, longest=1.5)
    broad = texture(rng, waves=6, longest=0.05)

    def paint(y, x):
        return 1 + 0.02 * (faint(y, x) - 1) + 0.3 * (broad(y, x) - 1)

    views, truth = views_of([(paint, lambda y, x: 0.5 + 0.02 * y, None)], shape=(96, 96))
    error = np.abs(epi(shaded(views, 0.06)).values - truth)[6:-6, 6:-6]
    # Gloss of 6 % on a texture of 2 %: taken for matt, the surface is found 2.6 px elsewhere.
    assert error.mean() < 0.07


def test_shading_is_told_from_residuals_that_are_linear_in_the_views(rng):
    fit, flat_place = ShadingFit((40, 40), 0.001), np.zeros((40, 40))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            noise = 0.001 * rng.standard_normal((40, 40))
            fit.add(noise + 0.02 * down - 0.01 * right, np.ones((40, 40)), flat_place, down, right)
    found = fit.solved(4)
    np.testing.assert_allclose(found.down, 0.02, atol=4e-4)
    np.testing.assert_allclose(found.right, -0.01, atol=4e-4)
    np.testing.assert_allclose(found.at(0.5, 1.0), 0.0, atol=4e-4)


def test_progress_reaches_the_total_and_can_interrupt(paint):
    views, _ = views_of([(paint[0], flat(0.1), None)], shape=(24, 24), views=(3, 3))
    seen = []
    epi(views, (-1, 1), progress=seen.append)
    assert len(seen) > 10
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1)

    def stop(fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        epi(views, (-1, 1), progress=stop)


def test_light_fields_that_hold_no_depth_are_refused(monkeypatch):
    def field(shape=(3, 3, 16, 16), value=1.0):
        return LightField(np.full(shape, value), Grid(shape[:2], 1.0), Grid(shape[2:4], 1.0), 1.0)

    with pytest.raises(GeometryError, match="views is of type list"):
        epi([1])
    with pytest.raises(GeometryError, match="has 1 x 1 views of 16 x 16 lenslets but depth needs two"):
        epi(field((1, 1, 16, 16)))
    with pytest.raises(GeometryError, match="two views of 8 x 8 at least"):
        epi(field((3, 3, 4, 16)))
    with pytest.raises(GeometryError, match="NaN"):
        epi(field(value=np.nan))
    with pytest.raises(GeometryError, match="the middle view, 1/1 of 3 x 3, is dark or missing"):
        epi(field(value=0.0))
    with pytest.raises(GeometryError, match="from 1 to -1 px but the first must be less"):
        epi(field(), (1, -1))
    with pytest.raises(GeometryError, match="takes 25001 labels where 2000 are the most"):
        epi(field(), (-5000, 5000))
    with pytest.raises(GeometryError, match=r"disparities has 3 numbers"):
        epi(field(), (1, 2, 3))
    dark = field()
    dark.data[:] = 0
    dark.data[1, 1] = 1
    with pytest.raises(GeometryError, match="only the middle view is lit"):
        epi(dark)
    monkeypatch.setattr("lumigraph.core.memory.available", lambda: 10**6)
    with pytest.raises(ValueError, match="the cost of 255 disparities for 64 x 64 places needs"):
        epi(field((3, 3, 64, 64)), (-50, 50))


def test_even_pictures_have_no_confidence():
    views = LightField(np.ones((5, 5, 24, 24)), Grid((5, 5), 1.0), Grid((24, 24), 1.0), 20.0)
    assert np.asarray(epi(views).confidence).max() < 0.01


@pytest.mark.long
def test_the_benchmark_scene_is_measured_as_promised():
    import lumigraph.io as io

    folder = real("hci_antinous")
    views, truth = io.open(folder), io.open(folder / "gt_disp_lowres.pfm").data
    found = epi(views)
    error = np.abs(found.values - truth)  # of the whole picture, with its border
    assert np.median(error) < 0.01
    assert error.mean() < 0.05
    assert (error > 0.07).mean() < 0.1
    assert np.corrcoef(np.asarray(found.confidence).ravel(), error.ravel())[0, 1] < -0.5
    assert np.mean(found.error) / error.mean() == pytest.approx(1, abs=0.25)


@pytest.fixture
def bar(paint):
    """A near bar, 16 columns wide, before a wall; the wall beside it is hidden from the views of one side."""
    near = (paint[1], flat(2.0), lambda y, x: (np.abs(x) < 8) & (y > -99))
    return views_of([near, (paint[0], flat(0.0), None)])


def test_a_place_hidden_from_one_side_still_agrees_at_its_own_depth(bar):
    views, truth = bar
    pictures = Pictures.of(views)
    cost = costs(pictures, np.array([0.0, 6.0], np.float32), 0.1, silent)
    # Three columns beside the bar: it hides them from the views of that side, up to 6 px away.
    beside = [slice(25, 28), slice(45, 48)]
    assert (truth[:, beside[0]] == 0).all()
    assert (truth[:, beside[1]] == 0).all()
    for columns in beside:
        at_wall, at_bar = cost[:, 4:-4, columns]
        assert np.median(at_wall) < 0.02  # along y nothing is hidden; of the two sides the better one counts
        assert np.median(at_bar) > 0.05


def test_views_near_the_middle_one_count_less_as_they_move_less():
    """On a ramp along x, a wrong place that moves by m px differs in a view at w by m w of its slope."""
    data = np.zeros((9, 9, 16, 40)) + 1 + 0.004 * np.arange(40)
    pictures = Pictures.of(LightField(data, Grid((9, 9), 1.0), Grid((16, 40), 1.0), 20.0))
    cost = costs(pictures, np.array([0.0, 1.0], np.float32), 0.1, silent)[:, 8, 20]
    slope = np.gradient(pictures.center[0, 8])[20]
    assert cost[0] == pytest.approx(0, abs=1e-6)
    # One view alone, at the end, says 1; all four of a side, counted alike, (1 + 2 + 3 + 4) / 16 = 0.625.
    assert cost[1] / slope == pytest.approx(0.693, abs=0.01)


def test_views_that_cannot_see_a_place_are_told(bar):
    views, truth = bar
    pictures = Pictures.of(views)
    moves = (truth * pictures.reach).astype(np.float32)
    v = pictures.middle[0]
    seen = {u: places for row, u, places in visible(pictures, moves) if row == v}
    # In view u the bar moves by 2 (u - 3) and covers what lies there: left of it for u < 3, else right.
    assert not seen[0][20, 24:28].any()
    assert seen[6][20, 24:28].all()
    assert not seen[6][20, 45:49].any()
    assert seen[0][20, 45:49].all()
    assert all(places[20, 30:42].all() for places in seen.values())


def test_a_surface_is_not_bent_across_a_tear():
    values = np.where(np.arange(64) < 31, 0.0, 6.0) + np.zeros((64, 1))
    information = np.where(np.abs(np.arange(64) - 30.5) < 12, 0.0, 1.0) + np.zeros((64, 1))
    how = Stiffness(100.0, 4e-3, 2.0)
    pull = 0.1 * information
    kept = update(values, information, pull, how, tears=tears(values, 0.8))
    # Beside the tear nothing is known: each side goes on as it is, 0.1 higher.
    np.testing.assert_allclose(kept, values + 0.1, atol=0.04)
    assert np.abs(update(values, information, pull, how) - values - 0.1).max() > 0.1


def test_beside_an_edge_of_depth_a_place_is_less_sure(bar):
    views, _ = bar
    error = np.asarray(epi(views, (-1, 3)).error)[4:-4]
    beside, away = error[:, [27, 28, 43, 44]], error[:, 32:40]  # the bar's edges are at 28.5 and 43.5
    # Both have the same texture: noise and contrast alone gave both the same error.
    assert np.median(beside) > 10 * np.median(away)


def test_what_the_middle_view_does_not_show_is_unknown(paint):
    views, _ = views_of([(paint[0], flat(0.4), None)])
    valid = np.ones(views.data.shape[:4], bool)
    valid[:, :, :6, :6] = False
    found = epi(LightField(views.data, views.aperture, views.lenslets, 20.0, valid))
    assert np.isnan(found.values[:6, :6]).all()
    assert np.isnan(found.error[:6, :6]).all()
    assert (found.confidence[:6, :6] == 0).all()
    assert np.isfinite(found.values[6:, 6:]).all()
    assert alpha_of(found, views).quantiles(0.0, 1.0) == pytest.approx((0.6, 0.6), abs=0.02)


def test_places_beyond_the_range_asked_for_are_told(paint):
    views, _ = views_of([(paint[0], flat(0.4), None)])
    with pytest.warns(SamplingWarning, match=r"places lie beyond the given disparities, -1 to 0 px"):
        epi(views, (-1, 0))


def test_a_patch_of_texture_that_repeats_is_not_trusted_where_it_is_off_by_a_period(paint, rng):
    """Gratings of 3.5 px amid texture are off by 3.5 px per view; their confidence was 0.9."""
    phases = rng.uniform(0, 2 * np.pi, 2)

    def repeating(y, x):
        waves = (np.cos(2 * np.pi / 3.5 * place + phase) for place, phase in zip((y, x), phases, strict=True))
        return np.where((abs(y) < 25) & (abs(x) < 25), 1 + 0.4 * sum(waves), paint[0](y, x))

    views, truth = views_of([(repeating, flat(-0.52), None)], (96, 96), (9, 9))
    found = epi(noisy(views, 0.01, rng))
    error = np.abs(found.values - truth)
    wrong = error > 0.5
    assert 0.05 < wrong.mean() < 0.4
    assert np.median(found.confidence[wrong]) < 0.3
    assert found.error.mean() > 0.3 * error.mean()
    assert np.median(found.confidence[~wrong]) > 0.9
