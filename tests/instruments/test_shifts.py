"""Shifts found from raw images: where the object stands in each, how well it is told, what is refused."""

import numpy as np
import pytest
from benchmarks import found_shifts, scanned
from scipy.ndimage import gaussian_filter

import lumigraph as lg
from lumigraph.deconvolution import Exposure
from lumigraph.metrology.scanning import texture
from lumigraph.metrology.scanning.texture import PicturePart, Textures
from lumigraph.units import um

CAMERA, SIZE = scanned.CAMERA, scanned.SIZE
TOLD = lg.scan(2, SIZE)
TRUE = TOLD + np.array([(8, -5), (-12, 9), (3, 14), (-6, -10)]) * um


@pytest.fixture(scope="module")
def moved():
    """What an object that was moved by `TRUE` is seen as."""
    own = CAMERA.operator_grid(12)
    beyond = lg.Grid(tuple(n + 72 for n in own.shape), own.pitch, own.center)
    return lg.joint_operator(CAMERA, None, 12, shifts=TRUE, grid=beyond, accuracy=1e-2)


def exposed(moved, picture, photons=1000.0, light=(1, 1, 1, 1)):
    rng = np.random.default_rng(5)
    seen = moved.parted(moved.forward(picture.astype(np.float32)))
    return [
        CAMERA.sensor.expose(np.maximum(one, 0), photons=photons * t, rng=rng)
        for one, t in zip(seen, light, strict=True)
    ]


def texture_on(moved, sigma=3.0):
    picture = gaussian_filter(np.random.default_rng(4).standard_normal(moved.shape[1]), sigma)
    return np.clip(0.5 + 0.15 * picture / picture.std(), 0, None)


def between(shifts):
    return (shifts - shifts[0])[1:]


def test_shifts_are_those_that_the_joint_operator_takes(moved):
    found = lg.find_shifts(exposed(moved, texture_on(moved)), CAMERA, TOLD)
    off = between(found.shifts) - between(TRUE)
    assert np.abs(off).max() < 3 * um  # told: 24 µm; of the wrong sign: 70 µm
    assert (found.errors[1:] < 2.5 * um).all()
    assert np.sqrt(np.mean((off / found.errors[1:]) ** 2)) < 1.8
    np.testing.assert_allclose(found.shifts[0], TOLD[0], rtol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), found.errors[1:].T.ravel(), rtol=1e-6)


def test_light_of_each_raw_image_is_allowed_for(moved):
    raws = exposed(moved, texture_on(moved), light=(1, 0.5, 1, 0.8))
    known = [Exposure.of(raw, light=t) for raw, t in zip(raws, (1, 0.5, 1, 0.8), strict=True)]
    found = lg.find_shifts(raws, CAMERA, TOLD, exposure=known)
    assert np.abs(between(found.shifts) - between(TRUE)).max() < 3 * um
    with pytest.warns(lg.SamplingWarning, match=r"raw image 1 is 0\.\d+ times as bright"):
        lg.find_shifts(raws, CAMERA, TOLD)
    raws = exposed(moved, texture_on(moved), light=(1, 0.96, 1.03, 0.99))
    found = lg.find_shifts(raws, CAMERA, TOLD)
    off = np.abs(between(found.shifts) - between(TRUE))
    assert (off < 3.5 * found.errors[1:]).all()  # a lamp that flickers


def test_an_even_object_is_refused(moved):
    with pytest.raises(lg.CalibrationError, match="do not show how the object was moved"):
        lg.find_shifts(exposed(moved, np.full(moved.shape[1], 0.5)), CAMERA, TOLD)


def test_a_shift_along_lines_is_warned_of_and_its_error_told(moved):
    x = moved.object_grid.x / SIZE
    picture = 0.5 + 0.3 * np.sin(np.pi / 2 * x + np.sin(x)) + np.zeros(moved.shape[1])
    with pytest.warns(lg.SamplingWarning, match="along y is known to"):
        found = lg.find_shifts(exposed(moved, picture), CAMERA, TOLD)
    assert (found.errors[1:, 0] > 0.4 * SIZE).all()
    assert (found.errors[1:, 1] < 0.02 * SIZE).all()
    assert np.abs((between(found.shifts) - between(TRUE))[:, 1] / found.errors[1:, 1]).max() < 3


@pytest.mark.filterwarnings("ignore:the last of")
def test_fine_lines_that_pass_for_coarse_ones_are_warned_of(moved):
    grid = moved.object_grid
    picture = 0.5 + 0.5 * np.cos(2 * np.pi * 0.9 * (grid.x + 0.17 * grid.y[:, None]) / SIZE)
    with pytest.warns(lg.SamplingWarning, match="lines of one period are 9. %"):
        lg.find_shifts(exposed(moved, picture), CAMERA, TOLD)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda raws: (raws[:1], CAMERA, None), lg.CalibrationError, "two or more"),
        (lambda raws: (raws, CAMERA, TOLD[:3]), lg.GeometryError, "3 shifts for 4"),
        (lambda raws: (raws, lg.load_camera("thesis-2f"), None), lg.GeometryError, 'kind "plenoptic"'),
        (lambda raws: (raws, lg.load_camera("lfm-fourier"), None), lg.GeometryError, "configuration"),
        (
            lambda raws: ([lg.RawImage(raw.data, raw.pixel_pitch) for raw in raws], CAMERA, None),
            lg.CalibrationError,
            "gain of the raw images is unknown",
        ),
        (
            lambda raws: (raws, CAMERA.replace(lenslets={"count": (7, 7)}), None),
            lg.CalibrationError,
            "has shape",
        ),
        (
            lambda raws: (raws, CAMERA.replace(lenslets={"count": (4, 4)}), None),
            lg.CalibrationError,
            "16 lenslets, but shifts need 25",
        ),
    ],
)
def test_what_tells_no_shifts_is_refused(moved, change, error, message):
    raws = exposed(moved, texture_on(moved))
    with pytest.raises(error, match=message):
        lg.find_shifts(*change(raws))


def test_dark_raw_images_and_too_few_exposures_are_refused(moved):
    raws = exposed(moved, texture_on(moved))
    with pytest.raises(lg.CalibrationError, match="3 exposures for 4"):
        lg.find_shifts(raws, CAMERA, exposure=[Exposure.of(raw) for raw in raws[:3]])
    with pytest.raises(lg.CalibrationError, match="dark"):
        lg.find_shifts(raws, CAMERA, exposure=Exposure(background=1e6, gain=1.0))
    unlit = np.zeros(raws[0].data.shape)
    with pytest.raises(lg.CalibrationError, match="0 lenslets count"):
        lg.find_shifts(raws, CAMERA, exposure=Exposure(weights=unlit, gain=1.0))


SCOPE = lg.LightFieldMicroscope(
    wavelength="525 nm",
    objective={"magnification": 20, "numerical_aperture": 0.5},
    lenslets={"pitch": "100 um", "focal_length": "2 mm", "count": (9, 11)},
    sensor={"pixel_pitch": "6.5 um", "full_well": 3e4, "read_noise": 2.0},
)
DEEP = (-20 * um, 0.0, 20 * um)


@pytest.fixture(scope="module")
def specimen():
    """An operator that sees beyond the lenslets, on other samples than shifts are found with."""
    return SCOPE.operator(DEEP, 15, accuracy=1e-2).widened(1e-3)[0]


def scanned_volume(operator, volume, shifts):
    """Raw images of a volume that was moved by shifts [lenslets]."""
    rng, raws = np.random.default_rng(5), []
    fy, fx = (np.fft.fftfreq(n, 1 / 15) for n in volume.shape[1:])
    for y, x in shifts:
        waves = np.fft.fft2(volume) * np.exp(-2j * np.pi * (fy[:, None] * y + fx * x))
        light = np.maximum(operator.forward(np.fft.ifft2(waves).real.astype(np.float32)), 0)
        raws.append(SCOPE.sensor.expose(light, photons=1000.0, rng=rng))
    return raws


def test_a_specimen_of_any_depth_is_found_before_a_microscope(specimen, rng):
    drawn = gaussian_filter(rng.standard_normal(specimen.shape[1]), (0, 5, 5))
    true = lg.scan(2, 1.0) + rng.uniform(-0.2, 0.2, (4, 2))
    raws = scanned_volume(specimen, np.clip(0.5 + 0.15 * drawn / drawn.std(), 0, None), true)
    found = lg.find_shifts(raws, SCOPE, lg.scan(2, SCOPE.lenslet_size))
    off = between(found.shifts) / SCOPE.lenslet_size - between(true)
    errors = found.errors[1:] / SCOPE.lenslet_size
    assert (errors < 0.02).all()  # lenslets
    assert np.sqrt(np.mean((off / errors) ** 2)) < 1.8  # told: 10 to 20


@pytest.mark.filterwarnings("ignore:raw image")
def test_beads_in_the_dark_are_warned_of(specimen, rng):
    beads = np.zeros(specimen.shape[1])
    beads[tuple(rng.integers(0, beads.shape, (60, 3)).T)] = rng.uniform(0.3, 1, 60)
    raws = scanned_volume(specimen, gaussian_filter(beads, (0, 2, 2)), lg.scan(2, 1.0))
    with pytest.warns(lg.SamplingWarning, match=r"bright spots \(excess kurtosis \d"):
        lg.find_shifts(raws, SCOPE, lg.scan(2, SCOPE.lenslet_size))


BOX = gaussian_filter(np.pad(np.ones((12, 12)), 18), 1.5)


@pytest.fixture
def part(rng):
    """Square lenslets with soft rims, 3 x 4 of them, in three raw images."""
    places = np.stack(np.meshgrid(np.arange(3.0), np.arange(4.0), indexing="ij"), -1).reshape(-1, 2)
    values = 1 + 0.2 * rng.standard_normal((3, 12))
    return PicturePart(values, np.full((3, 12), 1e-3), places, Textures.of(BOX))


SHIFTS = np.array([(0.0, 0.0), (0.31, -0.2), (-0.12, 0.43)])
SPECTRUM = np.array([-3.0, 0.5, 0.3, 0.9, 0.2])


def test_slopes_are_those_of_the_likelihood(part):
    told, step, found = part.told(SHIFTS, SPECTRUM, 0.0), 1e-4, []
    for axis in (0, 1):
        for k in (1, 2):
            by = np.zeros_like(SHIFTS)
            by[k, axis] = step
            ends = [part.likelihood(SHIFTS + side * by, SPECTRUM, 0.0) for side in (1, -1)]
            found.append((ends[0] - ends[1]) / (2 * step))
    for number in range(5):
        by = step * np.eye(5)[number]
        ends = [part.likelihood(SHIFTS, SPECTRUM + side * by, 0.0) for side in (1, -1)]
        found.append((ends[0] - ends[1]) / (2 * step))
    assert told.likelihood == pytest.approx(part.likelihood(SHIFTS, SPECTRUM, 0.0))
    np.testing.assert_allclose(told.slope, found, rtol=2e-3, atol=2e-3)  # cubic splines' slopes


def test_covariances_are_those_of_drawn_textures(part, rng):
    """Seen through the footprint on its own samples, where lenslets stand on whole ones."""
    n, samples = 16 * 12, 12
    fy, fx = np.fft.fftfreq(n, 1 / samples)[:, None], np.fft.rfftfreq(n, 1 / samples)[None]
    along, slant, across, gamma = np.exp(0.5), 0.3, np.exp(0.9), np.exp(0.2)
    q = 1 + (along * fy + slant * fx) ** 2 + (across * fx) ** 2
    waves = np.abs(np.fft.rfft2(BOX, (n, n))) * q ** (-gamma / 2)
    waves[0, 0] = 0
    at = np.array([(0, 0), (4, 3), (12, 0), (0, 12), (12, 12), (12, -12), (20, 5)])
    found = []
    for _ in range(300):
        drawn = np.fft.irfft2(waves * np.fft.rfft2(rng.standard_normal((n, n))), (n, n))
        found.append([np.mean(drawn * np.roll(drawn, one, (0, 1))) for one in at.tolist()])
    mean = np.mean(found, axis=0)
    pairs = texture._Pairs.of(np.concatenate([at, [(0, 0)]]) / samples)
    expected = pairs.even(part.textures.covariances(SPECTRUM)[0])[-1, :-1]
    np.testing.assert_allclose(mean / mean[0], expected / expected[0], atol=0.03)  # turned: 0.1
    assert expected[0] == pytest.approx(np.exp(-3.0), rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("kind", sorted(found_shifts.KINDS))
def test_errors_are_as_large_as_told(kind):
    stage = found_shifts.Stage(CAMERA)
    _, pulls = found_shifts.pulls(stage, found_shifts.KINDS[kind], 2, 6, 4500.0, first=1000)
    assert 0.55 < np.sqrt(np.mean(pulls**2)) < 1.25  # smooth objects are told better than they are said to be


@pytest.mark.long
def test_found_shifts_resolve_what_true_ones_do():
    stage, rng = found_shifts.Stage(CAMERA.replace(lenslets={"count": (9, 11)})), np.random.default_rng(1)
    picture, true = found_shifts.lines_in_discs(0.9, rng), found_shifts.off(3, rng)
    raws, told = stage.seen(picture, true, 4500.0, rng), lg.scan(3, SIZE)
    found = lg.find_shifts(raws, stage.camera, told).shifts
    by_true, by_found, by_told = (
        found_shifts.contrast(stage, raws, shifts, 0.9) for shifts in (true * SIZE, found, told)
    )
    assert by_found > 0.95 * by_true
    assert by_told < 0.9 * by_true
