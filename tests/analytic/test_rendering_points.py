"""Scenes whose raw image follows from ray geometry in closed form, and what must come back from it."""

import math

import numpy as np
import pytest

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.rendering import decode, refocus, refocus_fourier, refocus_stack, render
from lumigraph.rendering.focused import rendered_grid
from lumigraph.rendering.geometry import Frame

PIXEL, SEPARATION, DISTANCE = 5e-6, 0.2, 4e-3
NONE = np.zeros((0, 2))


def camera(lattice, shape):
    return Calibration(lattice, shape, NONE, NONE, 0.0, PIXEL, SEPARATION, DISTANCE)


def lenslets_and_aperture(calibration):
    """Ray of every pixel: lenslet position x and main-lens position u, both (y, x) [m], by geometry.

    The pixel at σ looks through its lenslet at x, whose micro-image is centred at x (1 + b/F), at the
    main lens at u = -(σ - x (1 + b/F)) F/b. Distances are from the axis, the middle pixel.
    """
    ny, nx = calibration.shape
    y, x = np.mgrid[:ny, :nx].astype(float)
    i, j = calibration.lattice.index(y, x)
    centers = calibration.lattice.position(np.stack([i, j], -1))
    sigma = np.stack([y - ny // 2, x - nx // 2], -1) * PIXEL
    middle = (centers - (ny // 2, nx // 2)) * PIXEL
    return middle / (1 + DISTANCE / SEPARATION), -(sigma - middle) * SEPARATION / DISTANCE


def turned(points, angle):
    """Components along the lattice's own axes (t, s) of vectors (y, x)."""
    y, x = points[..., 0], points[..., 1]
    return y * math.cos(angle) - x * math.sin(angle), y * math.sin(angle) + x * math.cos(angle)


def blob(t, s, at, width):
    return np.exp(-((t - at[0]) ** 2 + (s - at[1]) ** 2) / (2 * width**2))


LATTICES = {
    "square": Lattice.square(11.0, 0, (140, 150)),
    "not whole, turned": Lattice.square(11.37, 0.03, (141.3, 148.8)),
    "hexagonal": Lattice.hex(11.6, -0.02, (141.3, 148.8)),
    "hexagonal columns": Lattice.hex(11.6, math.pi / 6 + 0.01, (141.3, 148.8)),
}


@pytest.mark.parametrize("name", LATTICES)
@pytest.mark.parametrize("alpha", [0.93, 1.0, 1.06])
def test_a_point_comes_into_focus_at_its_own_alpha_and_place(name, alpha):
    calibration = camera(LATTICES[name], (280, 300))
    angle = calibration.lattice.rotation if "columns" not in name else 0.01
    pitch = calibration.lattice.pitch * PIXEL
    lenslet, aperture = lenslets_and_aperture(calibration)
    (t, s), (v, u) = turned(lenslet, angle), turned(aperture, angle)
    # An object whose image lies at F' = F/α' obeys x - u (1 - α') = α'x': the radiance depends on that alone.
    at, width = (1.1 * pitch, -2.3 * pitch), 2 * pitch
    raw = blob(t - v * (1 - alpha), s - u * (1 - alpha), at, width)
    views = decode(raw, calibration)
    grid = views.lenslets
    truth = blob(grid.y[:, None], grid.x[None, :], at, width)
    picture = refocus(views, alpha, oversample=1)
    # Cubic interpolation of this blob between lenslets errs by 5e-3; with alpha off by 0.03, or the shear's
    # sign wrong, by more than 0.05.
    # Along the edges of hexagonal cells, taps reach into the next micro-image: up to 0.04.
    np.testing.assert_allclose(picture, truth, atol=8e-3 if calibration.lattice.layout == "square" else 0.04)
    wrong = refocus(views, 2 - alpha if alpha != 1 else 1.06, oversample=1)
    assert np.abs(wrong - truth).max() > 0.05
    # The centroid needs no interpolation to be right: the place is exact to a hundredth of a lenslet.
    weight = np.clip(picture, 0, None)
    for axis, places in enumerate((grid.y[:, None], grid.x[None, :])):
        assert abs((weight * places).sum() / weight.sum() - at[axis]) < 0.02 * pitch


def test_slope_of_the_epipolar_image_is_one_minus_alpha():
    alpha, calibration = 0.9, camera(LATTICES["square"], (280, 300))
    lenslet, aperture = lenslets_and_aperture(calibration)
    width = 1.6 * 11 * PIXEL
    raw = blob(*(lenslet[..., k] - aperture[..., k] * (1 - alpha) for k in (0, 1)), (0, 0), width)
    views = decode(raw, calibration)
    v, t = views.aperture.shape[0] // 2, int(np.argmin(np.abs(views.lenslets.y)))
    epi = views.epi(v, t)
    centroid = (epi * views.lenslets.x).sum(1) / epi.sum(1)
    slope = np.polyfit(views.aperture.x, centroid, 1)[0]
    assert slope == pytest.approx(1 - alpha, abs=1e-3)


def test_the_sharpest_of_a_stack_is_the_true_one():
    alpha, calibration = 1.08, camera(LATTICES["not whole, turned"], (280, 300))
    lenslet, aperture = lenslets_and_aperture(calibration)
    (t, s), (v, u) = turned(lenslet, 0.03), turned(aperture, 0.03)
    width = 1.5 * 11.37 * PIXEL
    views = decode(blob(t - v * (1 - alpha), s - u * (1 - alpha), (0, 0), width), calibration)
    alphas = np.linspace(0.9, 1.2, 61)
    peaks = refocus_stack(views, alphas, oversample=1).max((1, 2))
    assert alphas[np.argmax(peaks)] == pytest.approx(alpha, abs=0.006)


def test_fourier_slice_and_shear_agree_away_from_the_borders():
    alpha, calibration = 1.07, camera(LATTICES["square"], (280, 300))
    lenslet, aperture = lenslets_and_aperture(calibration)
    raw = blob(*(lenslet[..., k] - aperture[..., k] * 0.05 for k in (0, 1)), (0, 0), 2 * 11 * PIXEL)
    views = decode(raw, calibration)
    # Cubic interpolation is what differs; the slice without its kernel's correction would be 10 % off.
    np.testing.assert_allclose(
        refocus_fourier(views, alpha), refocus(views, alpha, oversample=1), atol=1.5e-3
    )


def main_image(y, x):
    """A smooth picture in the main image plane, different everywhere [px of the lattice of centres]."""
    return 1 + 0.5 * np.sin(0.11 * y + 0.4) * np.cos(0.083 * x) + 0.3 * np.sin(0.05 * x - 0.07 * y)


def focused_raw(lattice, shape, ratio):
    """Raw image in which the micro-image at C holds the main image about C, -1/ratio times as large."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    dy, dx = lattice.offset(y, x)
    return main_image(y - dy - dy / ratio, x - dx - dx / ratio)


@pytest.mark.parametrize(
    "lattice",
    [
        Lattice.square(24.0, 0, (100, 120)),
        Lattice.square(23.7, 0.04, (100.2, 119.6)),
        Lattice.hex(23.3, -0.03, (100.2, 119.6)),
    ],
)
@pytest.mark.parametrize("ratio", [0.5, 0.43, -0.5, -0.27])
@pytest.mark.parametrize("blend", [False, True])
def test_focused_pictures_are_seamless_and_upright(lattice, ratio, blend):
    shape = (210, 250)
    calibration = Calibration(lattice, shape, NONE, NONE, 0.0)
    raw = focused_raw(lattice, shape, ratio)
    picture = render(raw, calibration, ratio * lattice.pitch, samples=9, blend=blend)
    grid = rendered_grid(calibration, ratio * lattice.pitch, 9)
    truth = main_image(
        grid.y[:, None] * lattice.pitch + shape[0] // 2, grid.x[None, :] * lattice.pitch + shape[1] // 2
    )
    # Pixels of a patch across a cell's edge come from the neighbouring micro-image's copy: they err by the
    # cubic kernel at a step. A whole-pixel block would be wrong by 0.1 at every seam, a turned patch by 0.3.
    error = np.abs(picture - truth)
    assert np.quantile(error, 0.99) < 0.01
    assert error.max() < 0.12 if not blend else error.max() < 0.06


def test_a_wrong_sign_or_size_of_the_patch_is_seen():
    lattice, shape = Lattice.square(24.0, 0, (100, 120)), (210, 250)
    calibration = Calibration(lattice, shape, NONE, NONE, 0.0)
    raw = focused_raw(lattice, shape, 0.5)
    for patch in (-12.0, 8.0):
        grid = rendered_grid(calibration, patch, 9)
        truth = main_image(grid.y[:, None] * 24 + 105, grid.x[None, :] * 24 + 125)
        assert np.quantile(np.abs(render(raw, calibration, patch, samples=9) - truth), 0.99) > 0.1


def test_a_map_of_patches_renders_each_depth_with_its_own():
    lattice, shape = Lattice.square(24.0, 0, (100, 120)), (210, 250)
    calibration = Calibration(lattice, shape, NONE, NONE, 0.0)
    near, far = focused_raw(lattice, shape, 0.5), focused_raw(lattice, shape, 0.35)
    raw = np.where(np.arange(250) < 132, near, far)  # 132: the border between two micro-images
    from lumigraph.rendering.patches import lenslet_indices

    columns = lattice.position(lenslet_indices(calibration))[..., 1]
    patches = np.where(columns < 132, 12.0, 0.35 * 24)
    picture = render(raw, calibration, patches, samples=9)
    grid = rendered_grid(calibration, patches, 9)
    truth = main_image(grid.y[:, None] * 24 + 105, grid.x[None, :] * 24 + 125)
    inside = np.abs(np.abs(grid.x * 24 + 125 - 132)) > 1
    assert np.quantile(np.abs(picture - truth)[:, inside], 0.99) < 0.01


@pytest.mark.parametrize("m", [0.5, -0.3])
def test_places_in_the_main_image_are_metres(m):
    """A point of the main image at X is imaged through every lenslet at C by rays; render shows it at X."""
    b, pitch = 4e-3, 120e-6
    a = b / m
    z2 = 0.2
    length = z2 + a
    per_px = PIXEL
    centers = pitch * (1 + b / length) / per_px
    lattice, shape = Lattice.square(centers, 0, (150, 150)), (300, 300)
    calibration = Calibration(lattice, shape, NONE, NONE, 0.0, per_px, length, b)
    at = np.array([130e-6, -210e-6])
    y, x = np.mgrid[:300, :300]
    raw = np.zeros(shape)
    for c in lattice.centers((0, 299), (0, 299)):
        lens = (c - 150) * per_px / (1 + b / length)
        spot = lens * (1 + m) - m * at  # a ray through the lenslet's middle, from the thesis' s = c(1+m) - mX
        near = (np.abs(y - c[0]) <= centers / 2) & (np.abs(x - c[1]) <= centers / 2)
        raw += near * blob(y, x, 150 + spot / per_px, 1.2)
    patch = m * pitch * z2 / length / per_px
    picture, grid = render(raw, calibration, patch, samples=12), rendered_grid(calibration, patch, 12)
    found = (picture * grid.y[:, None]).sum(), (picture * grid.x[None, :]).sum()
    # A patch of m p (the thesis' 5.5) or tiles in raw pixels would put the point 2 % to 4 % off: over 4 µm.
    np.testing.assert_allclose(np.array(found) / picture.sum(), at, atol=1e-6)
    assert grid.pitch[0] == pytest.approx(pitch * z2 / length / 12, rel=1e-9)


def test_frame_without_geometry_counts_in_lenslets():
    frame = Frame.of(Calibration(Lattice.square(15.0), (100, 100), NONE, NONE, 0.0))
    assert frame.lenslet_per_px * 15 == pytest.approx(1)
    assert frame.aperture_per_px * 15 == pytest.approx(21)  # (1 + b/F) F/b
