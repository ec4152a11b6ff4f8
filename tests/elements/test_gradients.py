"""Derivatives after the parameters of lenses, lenslets and distances: against finite differences."""

import warnings

import numpy as np
import pytest

import lumigraph as lg
import lumigraph.studies.thesis.methods

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    torch = pytest.importorskip("torch", reason="PyTorch is not installed (make torch)")

GRID = lg.Grid((40, 44), 8e-6)
SENSOR = lg.Grid((30, 28), 7e-6, (3e-6, 0.0))
WAVELENGTH = 633e-9
PARAMETERS = {"main": 60e-3, "lenslet": 5e-3, "pitch": 1.01, "first": 20e-3, "distance": 7e-3, "object": 1.0}


SQUARE = lg.Lattice.square(9.3e-5, 0.0, (1.1e-5, 0.6e-5))


def wave():
    y, x = GRID.y[:, None], GRID.x
    return np.exp(-((y - 2e-5) ** 2 + (x + 1e-5) ** 2) / (9e-5) ** 2) * np.exp(1j * 2e4 * (x + 0.3 * y))


def image(parameters, data, method, lattice=SQUARE):
    """A wave through a lens, a way, lenslets and another way, onto the sensor."""
    onto = SENSOR if method == "fresnel" else GRID
    train = lg.Train((
        lg.ThinLens(parameters["main"], 2.9e-4),
        lg.Propagate(parameters["first"], "band_limited"),
        lg.LensletArray(lattice, parameters["lenslet"], stretch=parameters["pitch"]),
        lg.Propagate(parameters["distance"], method, grid=onto),
    ))  # fmt: skip
    return train(lg.Field(data * parameters["object"], GRID, WAVELENGTH)).intensity


def loss(picture):
    """Sharpness about a place: depends on all that moves or blurs."""
    weight = np.linspace(0.5, 1.5, picture.shape[0])[:, None] * np.linspace(1.3, 0.6, picture.shape[1])
    if isinstance(picture, torch.Tensor):
        weight = torch.asarray(weight, dtype=picture.dtype)
    return (weight * picture**2).sum()


@pytest.mark.parametrize(
    ("layout", "method"),
    [
        ("square", "fresnel"),
        ("square", "band_limited"),
        ("square", "angular_spectrum"),
        ("square", "corrected_band_limited"),
        ("turned", "band_limited"),
        ("hex", "fresnel"),
    ],
)
@pytest.mark.filterwarnings("ignore::lumigraph.errors.SamplingWarning")
def test_gradients_are_those_of_finite_differences(layout, method):
    origin = (1.1e-5, 0.6e-5)
    lattice = {
        "square": SQUARE,
        "turned": lg.Lattice.square(9.3e-5, 0.2, origin),
        "hex": lg.Lattice.hex(9.3e-5, 0.1, origin),
    }[layout]
    tensors = {k: torch.tensor(v, dtype=torch.float64, requires_grad=True) for k, v in PARAMETERS.items()}
    loss(image(tensors, torch.asarray(wave()), method, lattice)).backward()
    for name, value in PARAMETERS.items():
        step = 3e-7 * value
        moved = [loss(image({**PARAMETERS, name: value + s}, wave(), method, lattice)) for s in (-step, step)]
        expected = (moved[1] - moved[0]) / (2 * step)
        assert float(tensors[name].grad) == pytest.approx(expected, rel=2e-5), name


def test_the_gradient_after_each_object_sample_is_that_of_finite_differences(rng):
    data = torch.tensor(wave(), requires_grad=True)
    parameters = {**PARAMETERS, "lenslet": torch.tensor(5e-3)}
    loss(image(parameters, data, "fresnel")).backward()
    for _ in range(4):
        place = tuple(rng.integers(10, 30, 2))
        for way in (1.0, 1j):
            moved = []
            for s in (-1e-6, 1e-6):
                changed = wave()
                changed[place] += s * way
                moved.append(loss(image(PARAMETERS, changed, "fresnel")))
            found = complex(data.grad[place])
            part = found.real if way == 1 else found.imag
            assert part == pytest.approx((moved[1] - moved[0]) / 2e-6, rel=1e-5)


@pytest.mark.parametrize("method", ["fresnel", "band_limited"])
def test_values_are_the_same_with_and_without_derivatives(method):
    tensors = {k: torch.tensor(v, dtype=torch.float64) for k, v in PARAMETERS.items()}
    found = image(tensors, torch.asarray(wave()), method)
    np.testing.assert_allclose(found.numpy(), image(PARAMETERS, wave(), method), rtol=1e-9, atol=1e-12)
    single = image(tensors, torch.asarray(wave().astype(np.complex64)), method)
    assert single.dtype == torch.float32
    plain = image(PARAMETERS, wave().astype(np.complex64), method)
    np.testing.assert_allclose(single.numpy(), plain, atol=1e-4 * plain.max())


@pytest.mark.filterwarnings("ignore::lumigraph.errors.SamplingWarning")
def test_three_focal_lengths_and_going_back_are_differentiated():
    lattice = lg.Lattice.hex(9.3e-5, kinds=3)

    def total(focal_lengths, distance, data):
        field = lg.LensletArray(lattice, tuple(focal_lengths))(lg.Field(data, GRID, WAVELENGTH))
        return loss(lg.propagate(field, distance, "fresnel", grid=SENSOR).intensity)

    values, distance = [5e-3, 7e-3, 9e-3], -6e-3
    tensors = [torch.tensor(v, dtype=torch.float64, requires_grad=True) for v in (*values, distance)]
    total(tensors[:3], tensors[3], torch.asarray(wave())).backward()
    for k in range(4):
        moved = []
        for s in (-1, 1):
            changed = [*values, distance]
            changed[k] *= 1 + s * 3e-7
            moved.append(total(changed[:3], changed[3], wave()))
        expected = (moved[1] - moved[0]) / (6e-7 * abs(distance if k == 3 else values[k]))
        expected *= np.sign(distance if k == 3 else 1)
        assert float(tensors[k].grad) == pytest.approx(expected, rel=1e-5)


def test_an_optimiser_may_change_a_parameter_in_place():
    """Nothing computed with the old value is kept."""
    focal_length = torch.tensor(60e-3, dtype=torch.float64)
    lens, field = lg.ThinLens(focal_length), lg.Field(torch.asarray(wave()), GRID, WAVELENGTH)
    lens(field)
    with torch.no_grad():
        focal_length.mul_(2)
    expected = lg.ThinLens(120e-3)(field).data
    np.testing.assert_allclose(lens(field).data.numpy(), expected.numpy(), rtol=1e-12)


def test_a_stretch_moves_the_lenslets(rng):
    lattice = lg.Lattice.square(1e-4, 0.1, (2e-5, 1e-5))
    array = lg.LensletArray(lattice, 5e-3, stretch=1.1)
    expected = lg.LensletArray(lattice.scaled(1.1), 5e-3)
    np.testing.assert_array_equal(
        array.transmission(GRID, WAVELENGTH), expected.transmission(GRID, WAVELENGTH)
    )
    assert array == expected


SCALAR = torch.tensor(1.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: lg.ThinLens(torch.tensor(0.0)), "focal_length is 0 m"),
        (lambda: lg.ThinLens(torch.tensor(float("nan"))), "focal_length is nan"),
        (lambda: lg.Propagate(torch.tensor(float("inf"))), "distance is inf"),
        (lambda: lg.LensletArray(lg.Lattice.square(1e-4), 5e-3, stretch=-SCALAR), "stretch is -1"),
        (lambda: lg.LensletArray(lg.Lattice.square(1e-4), 5e-3, stretch=0.0), "stretch is 0"),
        (
            lambda: lg.LensletArray(lg.Lattice.square(1e-4), 5e-3, fill_factor=0.9, stretch=SCALAR),
            "the lenslets end",
        ),
        (
            lambda: lg.propagate(lg.Field(wave(), GRID, WAVELENGTH), SCALAR, "multi_step_fresnel"),
            "cannot be differentiated by its distance",
        ),
        (lambda: lg.propagate(lg.Field(wave(), GRID, WAVELENGTH), 0 * SCALAR), "a distance of 0 m"),
    ],
)
def test_what_cannot_be_differentiated_is_refused(call, message):
    with pytest.raises(lg.LumigraphError, match=message):
        call()
