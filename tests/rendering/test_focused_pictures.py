"""Pictures of a camera 2.0: maps of patches, kinds of lenslets, stacks, super-resolution; refusals."""

import warnings

import numpy as np
import pytest

from data_folder import real
from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.warp import Warp
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.rendering import match_kinds, render, render_stack, sharp_patches, super_resolve
from lumigraph.rendering.focused import rendered_grid
from lumigraph.rendering.patches import lenslet_indices

NONE = np.zeros((0, 2))
SHAPE = (210, 250)


def calibrated(lattice, **more):
    return Calibration(lattice, SHAPE, NONE, NONE, 0.0, **more)


def scene(y, x):
    return 1 + 0.4 * np.sin(0.31 * y + 0.4) * np.cos(0.28 * x) + 0.3 * np.sin(0.05 * x - 0.21 * y)


def raw_of(calibration, ratio, blur=None, supersampling=1):
    """Raw image whose micro-image at C holds the scene about C, -1/ratio(y, x) times as large.

    `ratio` is a number, or a function of the place in the picture; `blur` says how much of the contrast each
    lenslet keeps.
    """
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    i, j = calibration.index(y, x)
    indices = np.stack([i, j], -1)
    on_sensor, flat = calibration.position(indices), calibration.lattice.position(indices)
    parts = (np.arange(supersampling) - (supersampling - 1) / 2) / supersampling
    total = 0.0
    for part_y in parts:
        for part_x in parts:
            dy, dx = y + part_y - on_sensor[..., 0], x + part_x - on_sensor[..., 1]
            size = ratio(flat[..., 0], flat[..., 1]) if callable(ratio) else ratio
            value = scene(flat[..., 0] - dy / size, flat[..., 1] - dx / size)
            total = total + (value if blur is None else 1 + (value - 1) * blur(i, j)) / len(parts) ** 2
    return total


def truth(calibration, patch, samples):
    grid, pitch = rendered_grid(calibration, patch, samples), calibration.lattice.pitch
    return scene(grid.y[:, None] * pitch + SHAPE[0] // 2, grid.x[None, :] * pitch + SHAPE[1] // 2)


@pytest.mark.parametrize(
    "lattice", [Lattice.square(24.3, 0.02, (104, 124)), Lattice.hex(24.3, 0, (104, 124))]
)
def test_a_slanted_plane_is_rendered_without_seams_from_a_map_of_patches(lattice):
    calibration = calibrated(lattice)

    def ratio(y, x):
        return 0.34 + 0.08 * (x - 124) / 124

    raw = raw_of(calibration, ratio)
    places = lattice.position(lenslet_indices(calibration))
    sizes = ratio(places[..., 0], places[..., 1]) * lattice.pitch
    errors = {}
    for name, patch in (("map", sizes), ("one", float(np.median(sizes)))):
        picture = render(raw, calibration, patch, samples=8, blend=True)
        errors[name] = np.sqrt(np.mean((picture - truth(calibration, patch, 8))[10:-10, 10:-10] ** 2))
    # One patch for all blurs and doubles what lies in front and behind.
    assert errors["map"] < 0.025
    assert errors["one"] > 1.7 * errors["map"]


def test_the_sharp_kind_of_lenslets_makes_the_picture():
    calibration = calibrated(Lattice.hex(24.3, 0.0, (104, 124), kinds=3))
    kept = np.array([0.2, 1.0, 0.5])
    raw = raw_of(calibration, -0.3, blur=lambda i, j: kept[calibration.lattice.kind(i, j)])
    patch, samples = -0.3 * 24.3, 8
    expected = truth(calibration, patch, samples)[10:-10, 10:-10]

    def contrast(picture):
        part = picture[10:-10, 10:-10]
        return np.sum((part - 1) * (expected - 1)) / np.sum((expected - 1) ** 2)

    mixed = render(raw, calibration, patch, samples=samples, blend=True)
    chosen = render(raw, calibration, patch, samples=samples, focus=(-14.0, -7.3, -11.0))
    wrong = render(raw, calibration, patch, samples=samples, focus=(-7.3, -14.0, -11.0))
    assert contrast(mixed) == pytest.approx(kept.mean(), abs=0.06)
    assert contrast(chosen) > 0.95
    assert contrast(wrong) < 0.3


def test_the_picture_tells_which_kind_is_sharp():
    calibration = calibrated(Lattice.hex(24.3, 0.0, (104, 124), kinds=3))
    kept = np.array([0.5, 1.0, 0.7])
    raw = raw_of(calibration, -0.3, blur=lambda i, j: kept[calibration.lattice.kind(i, j)])
    sizes = np.full(lenslet_indices(calibration).shape[:2], -0.3 * 24.3)
    for given in ((-7.3, -9.5, -12.0), (-12.0, -7.3, -9.5)):
        assert match_kinds(raw, calibration, sizes, given) == (-12.0, -7.3, -9.5)
    assert match_kinds(np.ones(SHAPE), calibration, sizes, (-7.3, -9.5, -12.0)) == (-7.3, -9.5, -12.0)
    with pytest.raises(GeometryError, match=r"map of patches has shape \(2, 2\) and the lattice 3 kinds"):
        match_kinds(raw, calibration, np.full((2, 2), -7.0), (-7.3, -9.5, -12.0))


def test_kinds_change_over_without_a_seam():
    """On a slanted plane each kind is sharp somewhere; an even scene must stay even to the last sample."""
    calibration = calibrated(Lattice.hex(24.3, 0.0, (104, 124), kinds=3))
    sizes = -np.linspace(6, 12, np.prod(lenslet_indices(calibration).shape[:2]))
    sizes = np.sort(sizes.reshape(lenslet_indices(calibration).shape[:2]), axis=1)
    picture = render(np.ones(SHAPE), calibration, sizes, focus=(-6.0, -9.0, -12.0), samples=6)
    np.testing.assert_allclose(picture, 1, atol=1e-12)


def test_a_stack_is_sharp_at_the_true_patch_only():
    calibration = calibrated(Lattice.square(24.3, 0.0, (104, 124)))
    patches = np.array([6.0, 7.0, 8.0, 9.0, 10.0])
    stack = render_stack(raw_of(calibration, 8.0 / 24.3), calibration, patches, samples=9)
    sharp = stack[:, 10:-10, 10:-10].var((1, 2))
    assert patches[np.argmax(sharp)] == 8
    alone = render(raw_of(calibration, 8.0 / 24.3), calibration, 10.0, samples=9, blend=True)
    np.testing.assert_allclose(stack[4], alone)


def test_distortion_is_taken_out_of_the_picture():
    warp = Warp((105.0, 125.0), (1e-4, 0.0), 3e-6)
    calibration = calibrated(Lattice.square(24.3, 0.0, (104, 124)), warp=warp)
    raw = raw_of(calibration, 0.35)
    expected = truth(calibration, 8.5, 8)
    errors = [
        np.quantile(np.abs(render(raw, known, 0.35 * 24.3, samples=8, blend=True) - expected), 0.9)
        for known in (calibration, calibrated(calibration.lattice))
        if rendered_grid(known, 8.5, 8).shape == expected.shape or known is calibration
    ]
    assert errors[0] < 0.02
    assert errors[1:] == [] or errors[1] > 0.05


def test_super_resolution_brings_back_what_one_micro_image_aliases(xp):
    lattice = Lattice.square(20.37, 0.0, (105.3, 124.8))
    calibration, ratio = calibrated(lattice), -6.7 / 20.37
    frequency = 0.7 * abs(ratio)  # cycles per place: 0.7 of a pixel's, where one micro-image ends at 0.5

    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    _, dx = lattice.offset(y, x)
    parts = (np.arange(5) - 2) / 5
    raw = np.mean(
        [1 + 0.5 * np.sin(2 * np.pi * frequency * (x - dx - (dx + part) / ratio)) for part in parts], 0
    )

    def contrast(picture):
        part = to_numpy(picture)[10:-10, 10:-10]
        places = np.arange(part.shape[1]) * 20.37 / 13
        return 4 * np.abs((part * np.exp(-2j * np.pi * frequency * places)).mean(1)).mean()

    plain = render(raw, calibration, -6.7, samples=13, blend=True)
    fine = super_resolve(xp.asarray(raw.astype(np.float32)), calibration, -6.7, factor=2)
    assert str(fine.dtype).endswith("float32")
    assert tuple(fine.shape) == plain.shape
    assert contrast(plain) < 0.1
    assert contrast(fine) > 0.8


def test_pixels_that_coincide_hold_no_more_detail():
    calibration = calibrated(Lattice.square(20.0, 0.0, (105.0, 125.0)))
    with pytest.warns(SamplingWarning, match=r"gaps of 1\.00 px, too wide for a picture 2 times finer"):
        super_resolve(np.ones(SHAPE), calibration, 5.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen = []
        even = super_resolve(np.ones(SHAPE), calibration, 5.4, progress=seen.append)
    np.testing.assert_allclose(even, 1, atol=1e-6)
    assert seen == sorted(seen)
    assert all(0 < fraction <= 1 for fraction in seen)


def test_the_cameras_kinds_are_sharp_where_the_lens_equation_says():
    camera = FocusedPlenopticCamera.from_catalogue("multi-focus-hex")
    assert camera.sharp_patches[0] == pytest.approx(camera.patch)
    assert sorted(camera.sharp_patches) == pytest.approx([-13.946, -12.5, -10.942], abs=1e-3)


def test_ranges_of_virtual_depth_meet_where_both_kinds_blur_alike():
    calibration = calibrated(Lattice.hex(36.0, kinds=3))
    near, middle, far = sharp_patches(calibration, [(1, 3), (3, 4), (4, 100)])
    assert (near + middle) / 2 == pytest.approx(-36 / 3)
    assert (middle + far) / 2 == pytest.approx(-36 / 4)
    assert sharp_patches(calibration, [(4, 100), (1, 3), (3, 4)]) == (far, near, middle)


def test_what_cannot_be_rendered_is_refused():
    calibration, raw = calibrated(Lattice.hex(24.3, 0.0, (104, 124), kinds=3)), np.ones(SHAPE)
    plain = calibrated(Lattice.square(24.3, 0.0, (104, 124)))
    for call, match in (
        (lambda: render(raw, calibration, 5.0, focus=(5.0, 6.0)), "focus is .* but the lattice has 3 kinds"),
        (lambda: render(raw, calibration, 5.0, focus=(5.0, 6.0, 0.0)), "focus is 0 px but must be above 0"),
        (lambda: render_stack(raw, plain, []), r"patches is \[\] but must be a list"),
        (
            lambda: render_stack(raw, plain, [-5.0, 5.0]),
            "patches are from -5 to 5 px but those of one camera",
        ),
        (lambda: super_resolve(raw, plain, 5.0, factor=9), "factor is 9 but must be from 1 to 8"),
        (lambda: super_resolve(raw, plain, 5.0, smoothness=-1), "smoothness is -1 but must be at least 0"),
        (lambda: super_resolve(raw, plain, 5.0, iterations=0), "iterations is 0"),
        (lambda: sharp_patches(plain, [(1, 2)] * 3), "for a lattice of 1 kinds"),
        (lambda: sharp_patches(calibration, [(3, 1), (1, 2), (2, 3)]), "must ascend from above 0"),
    ):
        with pytest.raises(GeometryError, match=match):
            call()


def test_a_real_multi_focus_image_is_upright_and_seamless():
    from PIL import Image

    raw = np.asarray(Image.open(real("raytrix_r42_multifocus", "sc2_klein.png")))
    calibration = Calibration(
        Lattice.hex(34.8647, 0.0, (20.1, 14.0), kinds=3), raw.shape[:2], NONE, NONE, 0.0
    )
    picture = render(raw, calibration, -5.5, samples=12, blend=True)
    grey = picture.mean(-1)
    # Green leaf above on the right, white edge and orange sheet below on the left, as on the sensor.
    assert picture[: len(picture) // 4, -60:, 1].mean() > picture[: len(picture) // 4, -60:, 0].mean()
    corner = picture[-20:, :30].reshape(-1, 3).mean(0)
    assert corner[0] > 1.2 * corner[2]
    # Seams would show as power at the lattice's frequencies, rows 12 √3/2 samples apart.
    step = np.abs(np.diff(grey, axis=0)).mean(1)
    phases = np.exp(-2j * np.pi * np.arange(len(step)) / (12 * np.sqrt(3) / 2))
    nearest = np.abs(np.diff(render(raw, calibration, -7.5, samples=12).mean(-1), axis=0)).mean(1)
    seams = [
        abs(((line - line.mean()) * phases[: len(line)]).mean()) / line.mean() for line in (step, nearest)
    ]
    assert seams[0] < 0.04
    assert seams[1] > 2 * seams[0]
