"""Pictures that are sharp at every depth, apertures of any shape, points of view that move."""

import numpy as np
import pytest

from data_folder import real
from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.errors import GeometryError
from lumigraph.rendering import all_in_focus, reduce_aperture, refocus, view_path

APERTURE, LENSLETS = Grid((7, 7), 2.0), Grid((40, 48), 1.0)
NEAR, FAR = 0.85, 1.1


def texture(t, s):
    return 2 + np.sin(0.9 * t + 0.3 * s) + np.cos(1.1 * s - 0.2 * t) + np.sin(0.5 * t * 1.3 + 0.8 * s)


def two_planes(xp=np):
    """Left half at NEAR, right half at FAR, without occlusion."""
    v, u, t, s = np.meshgrid(APERTURE.y, APERTURE.x, LENSLETS.y, LENSLETS.x, indexing="ij")
    near = texture(t - v * (1 - NEAR), s - u * (1 - NEAR))
    far = texture(t - v * (1 - FAR), s - u * (1 - FAR))
    return LightField(xp.asarray(np.where(s < 0, near, far)), APERTURE, LENSLETS, 10.0)


def truth():
    return texture(LENSLETS.y[:, None], LENSLETS.x[None, :])


PARTS = (slice(4, -4), slice(4, 20)), (slice(4, -4), slice(28, -4))


def test_both_planes_are_sharp_in_one_picture(xp):
    views, seen = two_planes(xp), []
    made = all_in_focus(views, np.linspace(0.8, 1.15, 15), progress=seen.append, oversample=1)
    picture, alpha = to_numpy(made.picture), to_numpy(made.alpha)
    assert type(made.picture) is type(views.data)
    for part, factor in zip(PARTS, (NEAR, FAR), strict=True):
        # Cubic interpolation keeps 97 % of the finest wave; a plane off by 0.05 loses half of the contrast.
        np.testing.assert_allclose(picture[part], truth()[part], atol=0.12)
        assert np.median(alpha[part]) == pytest.approx(factor, abs=0.01)
        assert np.abs(to_numpy(refocus(views, 0.98, oversample=1))[part] - truth()[part]).max() > 0.3
    assert seen[-1] == 1
    assert seen == sorted(seen)


def test_a_given_depth_is_used_and_its_gaps_are_filled():
    depth = np.where(LENSLETS.x[None, :] < 0, NEAR, FAR) * np.ones((40, 1))
    depth[10:14, 5:9] = np.nan
    made = all_in_focus(two_planes(), depth=depth, oversample=1)
    for part in PARTS:
        np.testing.assert_allclose(made.picture[part], truth()[part], atol=0.05)
    assert np.isfinite(made.alpha).all()
    even = all_in_focus(two_planes(), depth=np.full((40, 48), NEAR), oversample=1)
    np.testing.assert_allclose(even.picture, refocus(two_planes(), NEAR, oversample=1), atol=1e-12)


def test_what_cannot_be_sharp_is_refused():
    views = two_planes()
    for call, match in (
        (lambda: all_in_focus(views, oversample=1), "neither given but one of them is needed"),
        (lambda: all_in_focus(views, [1, 2, 3], depth=np.ones((40, 48)), oversample=1), "both given"),
        (lambda: all_in_focus(views, [0.9, 1.1], oversample=1), "a minimum needs three"),
        (lambda: all_in_focus(views, [0.9, 1.0, 1.3], oversample=1), "must ascend in equal steps"),
        (
            lambda: all_in_focus(views, depth=np.ones((3, 3)), oversample=1),
            r"depth has shape \(3, 3\) but the views have",
        ),
        (
            lambda: all_in_focus(views, depth=np.zeros((40, 48)), oversample=1),
            "depth is 0 but refocus factors are above 0",
        ),
        (
            lambda: all_in_focus(views, depth=np.full((40, 48), np.nan), oversample=1),
            "depth is NaN everywhere",
        ),
        (
            lambda: all_in_focus(views, depth=np.linspace(0.1, 99, 1920).reshape(40, 48), oversample=1),
            "need .* planes, above 512",
        ),
        (lambda: view_path(views, 0), "frames is 0"),
        (lambda: view_path(views, 99999), "frames is 99999 but must be at most 10000"),
        (lambda: view_path(views, radius=1.5), r"radius is 1\.5 but must be above 0 and at most 1"),
        (lambda: view_path(views, path="spiral"), "path is 'spiral' but must be one of circle, line, eight"),
        (lambda: reduce_aperture(views, shape=np.zeros((7, 7))), "keeps none of them"),
        (lambda: reduce_aperture(views, shape=np.zeros((3, 3))), "a mask of 7 x 7 views"),
    ):
        with pytest.raises(GeometryError, match=match):
            call()


@pytest.mark.parametrize("path", ["circle", "line", "eight"])
def test_the_point_of_view_moves_and_one_plane_stays(xp, path):
    views = two_planes(xp)
    frames = to_numpy(view_path(views, 12, path=path, radius=1.0, alpha=NEAR))
    assert frames.shape == (12, 40, 48)
    still, moving = (frames[(slice(None), *part)].std(0).max() for part in PARTS)
    # Mixing two views of the far plane 0.5 lenslets apart is exact to the cubic kernel only.
    assert still < 0.12
    assert moving > 0.5


def test_a_circle_begins_on_the_right_and_goes_down():
    frames = view_path(two_planes(), 4, radius=1.0)
    views = two_planes()
    for frame, (v, u) in zip(frames, ((3, 6), (6, 3), (3, 0), (0, 3)), strict=True):
        np.testing.assert_allclose(frame, views.data[v, u], atol=1e-9)


def test_apertures_of_any_shape():
    views = two_planes()
    ring = reduce_aperture(views, shape="ring")
    kept = ring.data.any((2, 3))
    assert not kept[3, 3]
    assert not kept[0, 0]
    assert kept[3, 0]
    mask = np.zeros((7, 7), bool)
    mask[2, 5] = True
    one = reduce_aperture(views, shape=mask)
    np.testing.assert_allclose(refocus(one, 1.0, oversample=1), views.data[2, 5])
    valid = LightField(views.data, APERTURE, LENSLETS, 10.0, np.ones(views.data.shape, bool))
    assert reduce_aperture(valid, 0.5).valid.shape == reduce_aperture(views, 0.5).data.shape


def test_real_views_have_no_lattice_pattern():
    """Micro-images of 48.234 px in blocks of 48 px would beat with a period of 48/0.234/48 = 4.3 lenslets."""
    from PIL import Image

    from lumigraph.calibration import devignette
    from lumigraph.core.calibration import Calibration
    from lumigraph.core.lattice import Lattice
    from lumigraph.rendering import decode

    white, raw = (
        np.asarray(Image.open(real("letters_plenoptic1", name)))
        for name in ("letters_ULF_M1_white.png", "letters_ULF_M1.png")
    )
    # As `calibrate` finds it.
    lattice, none = Lattice.square(48.235, 2.28e-3, (503.418, 632.93)), np.zeros((0, 2))
    calibration = Calibration(lattice, white.shape, none, none, 0.1)
    views = reduce_aperture(decode(devignette(raw, white), calibration), 0.8)
    # The even grey card, between letters and edge.
    card = views.data[:, :, :, 16:21].astype(float)
    waves = np.exp(-2j * np.pi * 0.234 * np.arange(card.shape[2]))
    ripple = np.abs(((card - card.mean(2, keepdims=True)) * waves[:, None]).mean((2, 3))) / card.mean((2, 3))
    assert np.median(ripple) < 0.01
    picture = refocus(views, 1.0, oversample=6)
    lines = picture[:, 16 * 6 : 20 * 6].mean(1)
    spectrum = np.abs(np.fft.rfft((lines - lines.mean())[: 17 * 6])) / lines.sum()
    assert spectrum[17] < 0.002  # one period per lenslet


def test_a_benchmark_scene_is_sharp_all_over():
    from PIL import Image

    pictures = [
        np.asarray(Image.open(real("hci_antinous", f"input_Cam{k:03}.png")))[80:200, 150:330].mean(-1)
        for k in range(81)
    ]
    data = np.stack(pictures).reshape(9, 9, 120, 180).astype(np.float32)
    views = LightField(data, Grid((9, 9), 10.0), Grid((120, 180), 1.0), 10.0)
    made = all_in_focus(views, 1 + np.linspace(-2.8, 3.2, 25) / 10, oversample=1)
    inner = (slice(14, -14), slice(14, -14))
    error, plain = (
        np.sqrt(np.mean((p - data[4, 4])[inner] ** 2))
        for p in (made.picture, refocus(views, 1.0, oversample=1))
    )
    assert error < 0.35 * plain
