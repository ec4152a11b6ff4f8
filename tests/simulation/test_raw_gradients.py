"""Derivatives of a loss on the raw image: after the camera's lengths, and after the object."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

import cameras
import lumigraph as lg
from lumigraph.instruments import SingleLensCamera
from lumigraph.scene import sources, targets
from lumigraph.sensor import integrate
from lumigraph.units import mm, nm, um

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    torch = pytest.importorskip("torch", reason="PyTorch is not installed (make torch)")

CAMERA = cameras.focused(count=(3, 3), pixel_pitch=12 * um)
PLACE = (30 * um, -50 * um)
LENGTHS = {
    "main lens": CAMERA.main_lens.focal_length,
    "separation": CAMERA.separation,
    "lenslets": 5.2 * mm,
    "sensor": CAMERA.lenslet_distance,
}


def raw_image(lengths, point):
    """What the camera's pixels get of a point, its lengths and the light being given."""
    lens, way, lenslets, rest = CAMERA.image_train().elements
    train = lg.Train((
        replace(lens, focal_length=lengths["main lens"]),
        replace(way, distance=lengths["separation"]),
        replace(lenslets, focal_length=lengths["lenslets"]),
        lg.Propagate(lengths["sensor"], grid=rest.grid),
    ))  # fmt: skip
    return integrate(train(point).intensity, rest.grid, CAMERA.sensor)


def point(library):
    wave = sources.point_source(CAMERA.pupil_grid, CAMERA.wavelength, CAMERA.object_distance, PLACE)
    return lg.Field(library.asarray(wave.data), wave.grid, wave.wavelength)


def loss(raw, wanted):
    return ((raw - (torch.asarray(wanted) if isinstance(raw, torch.Tensor) else wanted)) ** 2).sum()


def test_it_is_the_raw_image_of_simulate():
    area = math.prod(CAMERA.object_grid.pitch) / (math.pi * CAMERA.pupil_diameter**2 / 4)
    expected = lg.simulate(CAMERA, targets.points([PLACE])).data
    found = raw_image(LENGTHS, point(np)) * area * CAMERA.separation**2
    assert np.linalg.norm(np.maximum(found, 0) - expected) < 5e-2 * np.linalg.norm(
        expected
    )  # its grid: 0.042


@pytest.mark.filterwarnings("ignore::lumigraph.errors.SamplingWarning")
def test_derivatives_after_the_lengths_of_a_camera_are_finite_differences(rng):
    wanted = raw_image(LENGTHS, point(np))
    wanted = wanted[::-1] * rng.random(wanted.shape)
    tensors = {name: torch.tensor(v, dtype=torch.float64, requires_grad=True) for name, v in LENGTHS.items()}
    loss(raw_image(tensors, point(torch)), wanted).backward()
    for name, value in LENGTHS.items():
        step = 1e-6 * value
        ends = [loss(raw_image({**LENGTHS, name: value + s}, point(np)), wanted) for s in (-step, step)]
        expected = (ends[1] - ends[0]) / (2 * step)
        assert float(tensors[name].grad) == pytest.approx(expected, rel=2e-4), name


SINGLE = SingleLensCamera(
    wavelength=633 * nm,
    object_distance=120 * mm,
    main_lens={"focal_length": 60 * mm, "diameter": 3 * mm},
    sensor={"pixel_pitch": 6 * um, "shape": (20, 24)},
)


@pytest.mark.parametrize(
    "model",
    [
        lambda: CAMERA.operator(None, 4, accuracy=1e-2),
        lambda: CAMERA.operator((0.0, 2 * mm), 4, accuracy=1e-2),
        lambda: SINGLE.operator(),
    ],
    ids=["lenslets", "lenslets, two depths", "single lens"],
)
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_the_derivative_after_the_object_is_the_adjoint_and_finite_differences(model, dtype, rng):
    operator = model()
    seen, thing, way = (rng.random(shape) for shape in (operator.shape[0], *[operator.shape[1]] * 2))
    thing = torch.tensor(thing, dtype=dtype, requires_grad=True)
    raw = operator.forward(thing)
    loss(raw, torch.asarray(seen, dtype=dtype)).backward()
    expected = 2 * operator.adjoint((raw - torch.asarray(seen)).detach().to(dtype))
    assert thing.grad.dtype == dtype
    rounding = 1e-12 if dtype == torch.float64 else 2e-6
    assert torch.linalg.norm(thing.grad - expected) < rounding * torch.linalg.norm(expected)
    here = thing.detach().numpy().astype(float)
    ends = [loss(operator.forward(here + s * way), seen) for s in (-1e-3, 1e-3)]
    found = float((thing.grad * torch.asarray(way)).sum())
    assert found == pytest.approx((ends[1] - ends[0]) / 2e-3, rel=1e-8 if rounding < 1e-9 else 2e-4)
