"""A plane that leans: pictures whose refocus factor changes from row to row and from column to column."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.rendering import refocus


def light_field(pattern, alpha=lambda y, x: 1 + 0 * y, shape=(24, 30), valid=None):
    """5 × 5 views of a pattern(y, x) that each place shows at its own refocus factor."""
    aperture, lenslets = lg.Grid((5, 5), 10.0), lg.Grid(shape, 1.0)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    data = np.zeros((5, 5, *shape))
    for v, down in enumerate(aperture.y):
        for u, right in enumerate(aperture.x):
            row, column = y, x
            for _ in range(60):  # the place (row, column) of the picture that this sample of the view shows
                off = 1 - alpha(row, column)
                row, column = y - down * off, x - right * off
            data[v, u] = pattern(row, column)
    return lg.LightField(data, aperture, lenslets, 200.0, valid)


def waves(y, x):
    return 3 + np.sin(0.5 * y + 0.3 * x) + np.cos(0.45 * x - 0.2 * y)


@pytest.fixture
def views():
    return light_field(waves, lambda y, x: 0.97 + 0.006 * y - 0.004 * x)


@pytest.mark.parametrize("oversample", [1, 2])
def test_each_column_of_a_picture_tilted_across_is_that_of_its_own_refocus_factor(views, oversample):
    columns = 29 * oversample + 1
    alphas = 0.97 + 0.06 * (np.arange(columns) / (columns - 1) - 0.5)
    expected = [refocus(views, a, oversample=oversample)[:, k] for k, a in enumerate(alphas)]
    found = refocus(views, 0.97, tilt=(0, 0.06), oversample=oversample)
    np.testing.assert_allclose(found, np.stack(expected, 1), atol=1e-12)
    rows = 0.97 + 0.06 * (np.arange(24) / 23 - 0.5)
    expected = [refocus(views, a, oversample=1)[k] for k, a in enumerate(rows)]
    # Two passes interpolate rows of other factors: 1e-3 of what the picture spans, a level picture is 0.2 off
    assert np.abs(refocus(views, 0.97, tilt=(0.06, 0), oversample=1) - expected).max() < 2e-3


def test_a_leaning_plane_is_sharp_everywhere_only_with_its_tilt(views):
    y, x = np.mgrid[:24, :30]
    truth, inner = waves(y, x), (slice(3, -3), slice(3, -3))
    middle, tilt = 0.97 + 0.006 * 11.5 - 0.004 * 14.5, (0.006 * 23, -0.004 * 29)
    off = {
        t: np.abs(refocus(views, middle, tilt=t, oversample=1) - truth)[inner].max()
        for t in (tilt, (0, 0), (-tilt[0], -tilt[1]), tilt[::-1])
    }
    assert off[tilt] < 0.02  # cubic interpolation of waves of 12 samples
    assert min(error for t, error in off.items() if t != tilt) > 0.2


def test_hardly_any_tilt_is_none_with_colours_and_samples_that_are_not_valid(rng):
    data = rng.random((5, 5, 12, 14, 3))
    views = lg.LightField(
        data, lg.Grid((5, 5), 10.0), lg.Grid((12, 14), 1.0), 200.0, rng.random((5, 5, 12, 14)) > 0.6
    )
    level = lg.refocus_stack(views, [0.95, 1.03], oversample=2)
    np.testing.assert_allclose(
        lg.refocus_stack(views, [0.95, 1.03], oversample=2, tilt=(1e-13, 1e-13)), level, atol=1e-11
    )


def test_pictures_stay_on_their_array_library(views):
    torch = pytest.importorskip("torch")
    data = torch.tensor(views.data, requires_grad=True)
    own = lg.LightField(data, views.aperture, views.lenslets, views.separation)
    picture = refocus(own, 1.0, tilt=(0.02, 0.01), oversample=1)
    assert isinstance(picture, torch.Tensor)
    picture.sum().backward()
    assert data.grad is not None
    assert float(data.grad.sum()) == pytest.approx(picture.numel(), rel=1e-6)  # of a mean


@pytest.mark.parametrize(
    ("tilt", "words"),
    [
        ("0.1", "tilt is '0.1' but must be two numbers"),
        ((0.1,), "must be two numbers"),
        ((2.5, 0), "one corner has -0.25 but must have above 0"),
        ((1.5, 0), "fold over. Give at most"),
        ((float("nan"), 0), "tilt is nan but must be a finite number"),
    ],
)
def test_tilts_that_make_no_picture_are_refused(views, tilt, words):
    with pytest.raises(lg.GeometryError, match=words):
        refocus(views, 1.0, tilt=tilt)
