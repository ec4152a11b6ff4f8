"""Whatever is handed in by mistake, one clear error comes back: no TypeError, no hang, no huge array."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import rendering, sensor
from lumigraph.design import plenoptic2
from lumigraph.elements.zernike import noll_to_nm
from lumigraph.scene import Points, Scene, Slice, sources

GRID, HUGE = lg.Grid.square(8, 1e-5), lg.Grid.square(10**6, 1e-6)
FIELD = lg.Field(np.ones((8, 8)), GRID, 5e-7)
LATTICE = lg.Lattice.square(10.0, origin=(5, 5))
CALIBRATION = lg.Calibration(LATTICE, (40, 60), np.zeros((0, 2)), np.zeros((0, 2)), 0.0)
RAW = np.ones((40, 60), np.float32)
VIEWS = lg.LightField(np.ones((2, 2, 3, 3)), lg.Grid.square(2, 1.0), lg.Grid.square(3, 1.0), 1.0)

MISTAKES = {
    "propagate an array": (
        lambda: lg.propagate(np.ones((8, 8)), 0.1),
        "field is of type ndarray but must be a Field",
    ),
    "propagate to a number": (
        lambda: lg.propagate(FIELD, 0.1, grid=5),
        "grid is of type int but must be a Grid",
    ),
    "method list": (lambda: lg.propagate(FIELD, 0.1, []), "method is .* but must be 'auto' or one of"),
    "choose without grid": (
        lambda: lg.choose_method(None, 0.1, 5e-7),
        "grid is of type NoneType but must be a Grid",
    ),
    "choose wavelength": (
        lambda: lg.choose_method(GRID, 0.1, -5e-7),
        "wavelength is -5e-07 m but must be above 0",
    ),
    "lens before an array": (lambda: lg.ThinLens(0.1)(RAW), "field is of type ndarray but must be a Field"),
    "aperture before an array": (lambda: lg.CircularAperture(0.1)(RAW), "field is of type ndarray"),
    "lenslets without lattice": (
        lambda: lg.LensletArray(150e-6, 1e-3),
        "lattice is of type float but must be a Lat",
    ),
    "lenslets without f": (
        lambda: lg.LensletArray(LATTICE, None),
        "focal_length is None but must be a finite",
    ),
    "train of one": (lambda: lg.Train(5), "a train is 5 but must be a list of elements"),
    "zernike number": (lambda: lg.ZernikePlate(4, 1e-3), "coefficients are 4 but must be a mapping"),
    "endless zernike": (lambda: noll_to_nm(10**30), "Noll's index is 1000.* but must be at most 1000"),
    "integrate a list": (
        lambda: sensor.integrate([[1.0]], GRID, GRID),
        "intensity is of type list but must be an ar",
    ),
    "integrate onto a number": (
        lambda: sensor.integrate(np.ones((8, 8)), GRID, 5),
        "sensor is of type int but must",
    ),
    "mosaic a list": (lambda: sensor.mosaic([1]), "a colour image is of type list but must be an array"),
    "rng number": (
        lambda: lg.Sensor((8, 8), 1e-6).expose(np.ones((8, 8)), rng=5),
        "rng is of type int but must be a G",
    ),
    "huge target": (lambda: lg.targets.edge(HUGE), "a target of 1000000 x 1000000 samples needs .* GiB"),
    "huge wave": (lambda: sources.plane_wave(HUGE, 5e-7), "a wave of 1000000 x 1000000 samples needs .* GiB"),
    "huge stop": (
        lambda: sources.gaussian_beam(HUGE, 5e-7, 1e-3),
        "a wave of 1000000 x 1000000 samples needs",
    ),
    "target without grid": (lambda: lg.targets.pinhole(1e-6), "grid is of type float but must be a Grid"),
    "usaf group": (
        lambda: lg.targets.usaf1951(GRID, 2.5),
        "groups is 2.5 but must be one or two whole numbers",
    ),
    "usaf huge group": (
        lambda: lg.targets.usaf1951(GRID, 10**30),
        "must be one or two whole numbers from -10 to 20",
    ),
    "one frequency": (lambda: lg.targets.gratings(GRID, 5.0), "no frequencies were given"),
    "one point": (lambda: lg.targets.points((0.0, 0.0)), r"point 0 is 0.0 but must be \(y, x\)"),
    "points of text": (lambda: Points([("a", 0, 0)], [1]), "positions are .* but must be numbers"),
    "scene of one": (lambda: Scene(5), "parts are 5 but must be a list"),
    "scene moved": (
        lambda: lg.targets.points([(0, 0)]).at("5 deg"),
        "dz is '5 deg' but must be a finite number",
    ),
    "scene scaled": (lambda: lg.targets.white().scaled(None), "factor is None but must be a finite number"),
    "slice of a list": (lambda: Slice([[1.0]], GRID), "a slice is of type list but must be an array"),
    "source wavelength": (
        lambda: sources.plane_wave(GRID, None),
        "wavelength is None but must be a finite number",
    ),
    "decode without calibration": (
        lambda: lg.decode(RAW, None),
        "the positions of the micro-images are not known",
    ),
    "decode complex": (
        lambda: lg.decode(RAW + 0j, CALIBRATION),
        "the raw image is complex. Give its intensity",
    ),
    "half a direction": (
        lambda: lg.decode(RAW, CALIBRATION, directions=2.5),
        "directions is 2.5 but must be two wh",
    ),
    "directions": (lambda: lg.decode(RAW, CALIBRATION, directions=(1, 10**9)), "hold no more than 4096"),
    "interpolation": (
        lambda: lg.decode(RAW, CALIBRATION, interpolation=[]),
        r"interpolation is \[\] but must be",
    ),
    "patch none": (lambda: lg.render(RAW, CALIBRATION, None), "patch is None but must be a size in pixels"),
    "patch true": (lambda: lg.render(RAW, CALIBRATION, True), "patch is True but must be a size in pixels"),
    "patch empty": (lambda: lg.render(RAW, CALIBRATION, []), r"patch is \[\] but must be a size in pixels"),
    "refocus text": (lambda: lg.refocus(VIEWS, "1.1"), "alpha is '1.1' but must be a finite number"),
    "refocus true": (lambda: lg.refocus(VIEWS, True), "alpha is True but must be a finite number"),
    "refocus an array": (lambda: lg.refocus(RAW, 1.1), "views is of type ndarray but must be a LightField"),
    "fourier an array": (
        lambda: lg.refocus_fourier(RAW, 1.1),
        "views is of type ndarray but must be a LightField",
    ),
    "stack of one": (lambda: lg.refocus_stack(VIEWS, 1.1), "alphas is 1.1 but must be a list of numbers"),
    "view number": (lambda: lg.sub_aperture(VIEWS, 0.5, 0), "v is 0.5 but must be a whole number"),
    "aperture of an array": (
        lambda: lg.reduce_aperture(RAW, 0.5),
        "views is of type ndarray but must be a LightF",
    ),
    "encode an array": (
        lambda: lg.encode(RAW, CALIBRATION),
        "views is of type ndarray but must be a LightField",
    ),
    "mosaic": (
        lambda: rendering.views_from_mosaic(None, GRID, GRID, 1.0),
        "the mosaic is of type NoneType but must",
    ),
    "floor": (lambda: lg.devignette(RAW, RAW, floor=None), "floor is None but must be a finite number"),
    "complex white": (lambda: lg.devignette(RAW, RAW + 0j), "the white image is complex. Give its intensity"),
    "no views": (lambda: plenoptic2.views_per_axis(0.0), "magnification is 0 but must not be"),
    "text distance": (
        lambda: plenoptic2.magnification_at(0.06, "1", 0.1, 0.01),
        "object_distance is '1' but must",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gives_one_clear_error(name):
    act, told = MISTAKES[name]
    with pytest.raises(lg.LumigraphError, match=told):
        act()


@pytest.mark.parametrize("f", [np.float32(2), np.int64(2), np.array(2.0).item(), np.float64(2)])
def test_lenslets_take_any_real_focal_length(f):
    assert lg.LensletArray(LATTICE, f).focal_length == 2.0


@pytest.mark.parametrize("method", ["band_limited", "angular_spectrum", "auto"])
def test_a_distance_too_small_to_divide_by_counts_as_zero(method):
    assert np.array_equal(lg.propagate(FIELD, 1e-320, method).data, FIELD.data)


def test_an_exposure_far_beyond_the_full_well_is_white():
    light, rng = np.ones((2, 2)), np.random.default_rng(1)
    assert np.all(lg.Sensor((2, 2), 1e-6, bits=8).expose(light, fill=1e30, rng=rng).data == 255)


def test_the_byte_order_of_a_file_does_not_change_the_precision():
    assert lg.decode(RAW.astype(">f4"), CALIBRATION).data.dtype.name == "float32"
    assert lg.Field(np.ones((8, 8), ">f4"), GRID, 5e-7).data.dtype.name == "complex64"
