"""Raw images of planes by a microscope's parts: against its operator, and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from tests.operators.test_part_images import off, peak
from tests.studies.information.test_microscope_slopes import OTHER, PLAIN, ROUND, UM, Key, scope, waves_alike

import lumigraph as lg
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.operators.microscope.pupil_plane import CellOptics, PupilPlane

BEFORE = "pitch", "focal length of lenslets", "lenslets before the image"
"""Keys by which round lenslets, and the way behind them, change."""

DZ, GRID = -9 * UM, Grid((13, 12), (2.3 * UM, 2.3 * UM), (0.4 * UM, -0.3 * UM))


def exact(plane: PupilPlane) -> PupilPlane:
    """In double precision."""
    return replace(plane, images=replace(plane.images, double=True))


def sampled_alike(one, like: PupilPlane, scope_like) -> PupilPlane:
    """Of a microscope, with all that is sampled as another plane's."""
    points = like.images.layout.sampling.points
    _, [(images, _)] = scope_like.images_alike([(one, one)], abs(DZ), points)
    found = PupilPlane(images, [], GRID, DZ)
    found.__dict__["_behind"] = [
        replace(
            CellOptics.of(images, which, DZ),
            **dict(zip(("told", "waves"), waves_alike(images, like.images, which, DZ), strict=True)),
        )
        for which in range(len(images.objectives))
    ]
    return found


def check(key: Key, x: np.ndarray, rng: np.random.Generator):
    at, step, of = key
    plane = exact(of(at).part_plane([(of(at - step), of(at + step))], GRID, DZ))
    weights = rng.standard_normal(plane.shape[0])
    low, high = (sampled_alike(of(at + k * step), plane, of(at)).forward(x) for k in (-1, 1))
    slope = plane.gradient(x, weights)[0]
    assert slope == pytest.approx(np.vdot(weights, high - low), rel=1e-4, abs=0)
    assert off(plane.derivative(x, np.ones(1)), high - low) < 1e-5


QUICK = "phase of the pupil"


def test_slopes_are_central_differences_of_raw_images(rng):
    check(PLAIN[QUICK], rng.random(GRID.shape), rng)


@pytest.mark.long
@pytest.mark.parametrize(
    "key", [key for key in (*PLAIN, *OTHER, *(f"{key}, round" for key in BEFORE)) if key != QUICK]
)
def test_slopes_by_all_parts_are_central_differences(key, rng):
    check((PLAIN | OTHER | ROUND)[key], rng.random(GRID.shape), rng)


def pairs_of(keys):
    return [(of(at - step), of(at + step)) for at, step, of in keys]


@pytest.mark.parametrize("shape", ["square", pytest.param("round", marks=pytest.mark.long)])
def test_the_gradient_is_the_derivatives_transpose_and_adds_up_objects(shape, rng):
    names = ("magnification", "wavelength", "pitch", "phase of the pupil", "pixels")
    keys = [
        PLAIN[name]._replace(of=lambda v, of=PLAIN[name].of: of(v).replace(lenslets={"shape": shape}))
        for name in names
    ]
    one = scope(lenslets={"shape": shape, "fill_factor": 0.98})
    plane = exact(one.part_plane(pairs_of(keys), GRID, DZ))
    objects, change = rng.random((2, *GRID.shape)), rng.standard_normal(len(keys))
    weights = rng.standard_normal((2, *plane.shape[0]))
    moved = plane.derivative(objects, change)
    assert plane.gradient(objects, weights) @ change == pytest.approx(
        np.vdot(weights, moved), rel=1e-10, abs=0
    )
    assert np.allclose(plane.forward(objects)[1], plane.forward(objects[1]), rtol=1e-12)


def spot(grid: Grid, width: float) -> np.ndarray:
    """A soft one beside the axis, smooth on all samples."""
    y, x = (grid.y - 2 * width) / width, (grid.x + 3 * width) / width
    return np.exp(-(y[:, None] ** 2 + x**2) / 2)


@pytest.mark.parametrize("shape", ["square", pytest.param("round", marks=pytest.mark.long)])
def test_raw_images_are_those_of_the_operator_inside_and_at_the_border(shape):
    """To the accuracy, of objects that go on beyond the lenslets, too, and of the same on other samples."""
    one = scope(aperture=0.35, lenslets={"shape": shape})
    model = one.operator([DZ], 4, accuracy=3e-3)
    wide, _ = model.widened(1e-4)
    for operator in (model, wide):
        x = np.random.default_rng(0).random(operator.shape[1])
        raw = one.part_plane([], operator.object_grid, DZ).forward(x[0])
        true, inner = operator.forward(x.astype(np.float32)), (slice(20, -20),) * 2
        assert off(raw, true) < 1e-2
        assert off(raw[inner], true[inner]) < 1e-2
    grid = Grid((31, 36), (1.6 * UM, 1.7 * UM), (3.3 * UM, -5.2 * UM))
    true = model.forward(spot(model.object_grid, 2.2 * UM)[None].astype(np.float32))
    assert off(one.part_plane([], grid, DZ).forward(spot(grid, 2.2 * UM)), true) < 1e-2


def test_a_gradient_takes_less_than_three_times_the_memory_of_an_image(rng):
    plane = scope().part_plane(pairs_of(list(PLAIN.values())[2:5]), GRID, DZ)
    x, weights = rng.random(GRID.shape), rng.random(plane.shape[0])
    assert peak(lambda: plane.gradient(x, weights)) < 3 * peak(lambda: plane.forward(x))


def test_microscopes_without_waves_are_refused():
    with pytest.raises(GeometryError, match="model 'rays' has no"):
        scope(objective={"model": "rays", "aberrations": {}}).part_plane([], GRID, DZ)


def fourier(**changes) -> lg.LightFieldMicroscope:
    """Few pixels, no lenslet on the middle between two of them, those in the corners half in the pupil."""
    changes["sensor"] = {"pixel_pitch": 21 * UM, "shape": (181, 182), **changes.pop("sensor", {})}
    return lg.load_camera("lfm-fourier").replace(**changes)


FOURIER = {
    "lens": Key(0.075, 2e-7, lambda v: fourier(fourier_lens=v)),
    "aperture": Key(0.5, 2e-6, lambda v: fourier(objective={"numerical_aperture": v})),
    "magnification": Key(20, 2e-5, lambda v: fourier(objective={"magnification": v})),
    "wavelength": Key(525e-9, 1e-12, lambda v: fourier(wavelength=v)),
    "band": Key(30e-9, 1e-12, lambda v: fourier(bandwidth=v)),
    "pitch": Key(1.25e-3, 1e-9, lambda v: fourier(lenslets={"pitch": v})),
    "focal length": Key(0.026, 3e-8, lambda v: fourier(lenslets={"focal_length": v}, sensor_distance=0.025)),
    "sensor": Key(0.0252, 3e-8, lambda v: fourier(sensor_distance=v)),
    "fill factor": Key(0.95, 1e-6, lambda v: fourier(lenslets={"fill_factor": v})),
    "a turn": Key(0.01, 1e-6, lambda v: fourier(lenslets={"rotation": v})),
    "phase of the pupil": Key(0.1, 1e-5, lambda v: fourier(objective={"aberrations": {5: v}})),
    "pixels": Key(21 * UM, 1e-12, lambda v: fourier(sensor={"pixel_pitch": v})),
    "one lenslet": Key(0.01, 1e-6, lambda v: fourier(lenslets={"single": {2: {"focal_change": v}}})),
}
PLACED = Grid((21, 20), (5 * UM, 5 * UM), (2 * UM, -3 * UM))


@pytest.mark.parametrize("key", FOURIER)
def test_slopes_of_fourier_microscopes_are_central_differences(key, rng):
    """Of wider steps than the pair's."""
    at, step, of = FOURIER[key]
    plane = of(at).part_plane([(of(at - step), of(at + step))], PLACED, 14 * UM)
    x, weights = rng.random((2, *PLACED.shape)), rng.standard_normal((2, *plane.shape[0]))
    ends = (of(at + k * step).part_plane([], PLACED, 14 * UM).forward(x) for k in (-4, 4))
    low, high = ends
    slope, moved = plane.gradient(x, weights)[0], plane.derivative(x, np.ones(1))
    assert 4 * slope == pytest.approx(np.vdot(weights, high - low), rel=1e-4, abs=0)
    assert off(8 * moved, 2 * (high - low)) < 1e-4
    assert np.vdot(weights, moved) == pytest.approx(slope, rel=1e-10, abs=0)


def test_raw_images_of_fourier_microscopes_are_those_of_the_operator(rng):
    """The same on other samples, too."""
    one = fourier(bandwidth=30e-9)
    operator, x = one.operator([14 * UM]), rng.random(one.object_grid.shape)
    true = operator.forward(x[None])
    assert off(one.part_plane([], None, 14 * UM).forward(x), true) < 1e-6
    grid = Grid((80, 71), (2.1 * UM, 2.3 * UM), (12 * UM, -5 * UM))
    true = operator.forward(spot(operator.object_grid, 9 * UM)[None])
    assert off(one.part_plane([], grid, 14 * UM).forward(spot(grid, 9 * UM)), true) < 1e-3


def test_pairs_with_other_lenslets_or_pixels_are_refused():
    for one, other in ((fourier(), fourier(lenslets={"count": (5, 3)})), (scope(), scope(pixel=9 * UM))):
        with pytest.raises(GeometryError, match="derivatives need as many"):
            one.part_plane([(other, other)], GRID, DZ)
    with pytest.raises(GeometryError, match="not 'fourier'"):
        scope().part_plane([(fourier(), fourier())], GRID, DZ)
