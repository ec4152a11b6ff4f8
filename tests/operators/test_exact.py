"""Exact lenslets against direct Rayleigh-Sommerfeld sums over stop and lenslets, which share no code."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.polynomial import chebyshev, legendre

import lumigraph as lg
from lumigraph import FocusedPlenopticCamera, ParaxialWarning, PlenopticCamera
from lumigraph.core.linear import Linear
from lumigraph.operators.lenslets.paraxial_error import (
    field_error,
    interpolated_error,
    paraxial_error,
    resolved,
)
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.periodic import incoherent
from lumigraph.operators.periodic.incoherent import periodic_operator
from lumigraph.operators.periodic.over_field import over_field
from lumigraph.operators.sampling.optics import Optics
from lumigraph.scene import Points, Scene, Slice

PITCH = 14e-6
COUNT = 15


def camera(magnification=None, f_number=4.0, focal_length=4e-3, model="paraxial"):
    """Of lenslets of 14 µm, whose chief rays are oblique by up to 0.02 rad."""
    lenslets = {"pitch": PITCH, "focal_length": f_number * PITCH, "count": [COUNT, COUNT]}
    parts = {
        "wavelength": "550 nm", "object_distance": 2 * focal_length, "model": model,
        "main_lens": {"focal_length": focal_length}, "sensor": {"pixel_pitch": PITCH / 10},
    }  # fmt: skip
    if magnification is None:
        return PlenopticCamera(**parts, lenslets=lenslets)
    return FocusedPlenopticCamera(
        **parts, lenslets=lenslets | {"magnification": magnification}, matching="full"
    )


def light(optics, place, y, x):
    """Wave of a lens that is free of aberration, beside the sphere around its middle, at places (n,)."""
    L, half, k = optics.separation, optics.pupil_diameter / 2, 2 * np.pi / optics.wavelength
    (lens,) = optics.lens.elements
    z = 1 / (1 / lens.focal_length - 1 / optics.object_distance)
    nodes, weight = legendre.leggauss(70)
    rho, angle = half * (nodes + 1) / 2, (np.arange(140) + 0.5) * np.pi / 70
    u, v = (np.outer(rho, turned(angle)).ravel() for turned in (np.sin, np.cos))
    weight = np.repeat(weight * rho, len(angle)) * half / 2 * np.pi / 70
    arrived = np.sqrt(z**2 + (u - place[0] * z / L) ** 2 + (v - place[1] * z / L) ** 2)
    result = np.empty(len(y), complex)
    for k0 in range(0, len(y), 128):
        mine = slice(k0, k0 + 128)
        way = np.sqrt(L**2 + (y[mine, None] - u) ** 2 + (x[mine, None] - v) ** 2)
        around = np.sqrt(L**2 + y[mine] ** 2 + x[mine] ** 2)
        result[mine] = (np.exp(1j * k * (way - arrived - around[:, None])) * L / way**2) @ weight
    return result / (optics.wavelength * half * math.sqrt(np.pi))


def wave(optics, place, lenslet):
    """Places, and the wave behind the lenslet with this centre times the quadrature's weights."""
    nodes = np.cos(np.pi * (np.arange(20) + 0.5) / 20)
    y, x = np.meshgrid(*(c + PITCH / 2 * nodes for c in lenslet), indexing="ij")
    values = light(optics, place, y.ravel(), x.ravel()).reshape(20, 20)
    to = np.cos(np.arange(20)[:, None] * np.arccos(nodes)) / 10
    to[0] /= 2
    at, weight = legendre.leggauss(64)
    path, amplitude = through(optics)
    half = PITCH / 2
    off_y, off_x = np.meshgrid(half * at, half * at, indexing="ij")
    squared, L = off_y**2 + off_x**2, optics.separation
    smooth = chebyshev.chebgrid2d(at, at, to @ values @ to.T)
    y, x = off_y + lenslet[0], off_x + lenslet[1]
    phase = 2 * np.pi / optics.wavelength * (np.sqrt(L**2 + y**2 + x**2) - L - path(squared))
    field = smooth * amplitude(squared) * np.exp(1j * phase) * np.outer(weight, weight) * half**2
    return y.ravel(), x.ravel(), field.ravel(), side(optics, off_y.ravel(), off_x.ravel())


def sphere_of_glass(optics):
    """Radius of the curved side (n - 1) f, index."""
    return (optics.surface.index - 1) * optics.array.focal_length, optics.surface.index


def side(optics, y, x):
    """Sagitta, normal (z, y, x) and its cosine with refracted rays, of a curved side; None of ideal ones."""
    if optics.surface is None:
        return None
    radius, index = sphere_of_glass(optics)
    normal = np.stack([np.sqrt(radius**2 - y**2 - x**2), y, x]) / radius
    return radius * (1 - normal[0]), normal, np.sqrt(1 - index**2 * (1 - normal[0] ** 2))


def through(optics):
    """Path taken away and amplitude, by the squared distance from the middle."""
    f, b = optics.array.focal_length, optics.lenslet_distance
    if optics.surface is not None:
        radius, index = sphere_of_glass(optics)

        def amplitude(q):
            cosine = np.sqrt(1 - q / radius**2)
            return np.sqrt(cosine / np.sqrt(1 - index**2 * (1 - cosine**2))) / cosine

        return lambda q: index * (radius - np.sqrt(radius**2 - q)), amplitude
    inverse = max(1 / f - 1 / b, 1e-9)

    def path(q):
        return np.sqrt(b**2 + q) - b + q / (np.sqrt(inverse**-2 + q) + 1 / inverse)

    return path, np.ones_like


def onwards(wavelength, b, apart, side):
    """Rayleigh and Sommerfeld's kernel from a plane, or Kirchhoff's from a curved side."""
    k, (y, x) = 2 * np.pi / wavelength, apart
    sag, normal, turned = (0.0, None, None) if side is None else side
    way = np.sqrt((b + sag) ** 2 + y**2 + x**2)
    if normal is None:
        return np.exp(1j * k * (way - b)) * b / way**2 * (1 + 1j / (k * way))
    towards = (normal[0] * (b + sag) + normal[1] * y + normal[2] * x) / way
    return np.exp(1j * k * (way - b)) / way * (turned + towards * (1 + 1j / (k * way))) / 2


def reference(camera, place, middle, around=3):
    """Intensity on pixels (n, n) around a lenslet, of a point imaged at a place in the lenslet plane."""
    optics, pixel = camera.optics(), camera.sensor.pixel_pitch
    scale = 1 + optics.lenslet_distance / optics.separation
    first = np.round(np.array(middle) * scale / pixel)
    nodes, weight = legendre.leggauss(3)
    at = (np.arange(-5, 6)[:, None] + nodes / 2).ravel()
    y, x = (g.ravel() for g in np.meshgrid(*((c + at) * pixel for c in first), indexing="ij"))
    b, total = optics.lenslet_distance, np.zeros(len(y), complex)
    for i in range(-around, around + 1):
        for j in range(-around, around + 1):
            v, u, field, curved = wave(optics, place, (middle[0] + i * PITCH, middle[1] + j * PITCH))
            for k0 in range(0, len(y), 256):
                mine = slice(k0, k0 + 256)
                apart = y[mine, None] - v, x[mine, None] - u
                total[mine] += onwards(optics.wavelength, b, apart, curved) @ field
    image = (np.abs(total / optics.wavelength) ** 2).reshape(11, 3, 11, 3)
    return np.einsum("iajb,a,b->ij", image, weight / 2, weight / 2), first.astype(int)


def seen(camera, place, first, accuracy=1e-3):
    """The same pixels of `points_image`, which turns the image by 180°."""
    optics = camera.optics()
    at = -np.array(place) * optics.object_distance / optics.separation
    image = points_image(camera, Points([[*at, 0.0]], [1.0]), accuracy)[::-1, ::-1]
    y, x = (n // 2 + c for n, c in zip(image.shape, first, strict=True))
    share = (optics.object_pitch * optics.separation / optics.object_distance) ** 2
    return image[y - 5 : y + 6, x - 5 : x + 6] / share


def off(image, expected):
    return float(np.linalg.norm(image - expected) / np.linalg.norm(expected))


@pytest.mark.long  # a direct sum over stop and lenslets: 15 s each
@pytest.mark.parametrize(("magnification", "cell"), [(None, (3, 4)), (0.5, (0, -4))])
def test_points_are_those_of_a_direct_sum(magnification, cell):
    middle = (cell[0] * PITCH, cell[1] * PITCH)
    place = (middle[0] + 1.2e-6, middle[1] - 2.1e-6)
    known = camera(magnification)
    expected, first = reference(known, place, middle)
    assert off(seen(known, place, first), expected) > 4e-3
    assert off(seen(known.replace(model="exact"), place, first), expected) < 1e-3


@pytest.mark.long  # a direct sum over stop and lenslets: 15 s
def test_points_behind_glass_are_those_of_a_direct_sum():
    middle = (2 * PITCH, -PITCH)
    place = (middle[0] + 1.2e-6, middle[1] - 2.1e-6)
    ideal = camera(model="exact")
    known = ideal.replace(lenslets={"index": 1.5, "conic": 0.0})
    expected, first = reference(known, place, middle)
    assert off(seen(known, place, first), expected) < 1e-3
    assert off(seen(ideal, place, first), expected) > 3e-2


def test_paraxial_images_say_what_glass_changes():
    ideal = camera(f_number=2.7)
    spheres = ideal.replace(lenslets={"conic": 0.0, "index": 1.5})
    assert paraxial_error(spheres.optics()) > 1.5 * paraxial_error(ideal.optics())
    keys = {Optics.of(known.replace(model="exact"), 8e-3, 1e-2).key for known in (ideal, spheres)}
    assert len(keys) == 2


def test_slow_lenslets_are_paraxial():
    slow = camera(f_number=60.0)
    place, first = (1e-6, 2e-6), np.array([0, 0])
    paraxial, exact = (seen(slow.replace(model=model), place, first) for model in ("paraxial", "exact"))
    assert off(paraxial, exact) < 1e-3
    assert paraxial_error(slow.optics()) < 1e-3


def test_the_operator_is_the_points_images(tmp_path):
    known = camera(model="exact").replace(lenslets={"count": (5, 5)})
    grid = lg.Grid.square(9, known.object_grid.pitch[0])
    operator = periodic_operator(known, grid, accuracy=1e-2, folder=tmp_path)
    plane = np.zeros(grid.shape, np.float32)
    plane[3, 5] = 1
    exact = points_image(known, Points([[grid.y[3], grid.x[5], 0.0]], [1.0]), 1e-2)
    assert off(operator.forward(plane), exact) < 1e-2
    paraxial = periodic_operator(known.replace(model="paraxial"), grid, accuracy=1e-2, folder=tmp_path)
    assert off(paraxial.forward(plane), exact) > 1.3e-2
    other = np.random.default_rng(0).random(operator.shape[0]).astype(np.float32)
    assert np.vdot(operator.forward(plane), other) == pytest.approx(
        np.vdot(plane, operator.adjoint(other)), rel=1e-5
    )


@pytest.mark.parametrize("magnification", [None, 0.5])
def test_the_estimate_is_what_paraxial_images_are_off(magnification):
    known = camera(magnification).replace(lenslets={"count": (9, 9)})
    point = Points([[0.15 * PITCH, 0.15 * PITCH, 0.0]], [1.0])
    paraxial, exact = (
        points_image(known.replace(model=model), point, 1e-2) for model in ("paraxial", "exact")
    )
    assert 0.5 < paraxial_error(known.optics()) / off(paraxial, exact) < 2
    assert field_error(known.optics()) < 0.3 * paraxial_error(known.optics())


def test_auto_is_exact_where_it_has_to_be():
    optics = replace(camera().optics(), model="auto")
    assert (resolved(optics, 1e-2).model, resolved(optics, 1e-1).model) == ("exact", "paraxial")
    assert resolved(camera().optics(), 1e-2).model == "paraxial"


def test_paraxial_images_say_how_far_off_they_are():
    scene = Scene([Points([[0.0, 0.0, 0.0]], [1.0])])
    with pytest.warns(ParaxialWarning, match=r"0.01 was asked for but parabolic lenses .* 0.017 rms"):
        raw = lg.simulate(camera(), scene, lg.Incoherent(accuracy=1e-2))
    assert raw.metadata["error"]["paraxial"] == pytest.approx(paraxial_error(camera().optics()))
    small = camera(model="exact").replace(lenslets={"count": (3, 3)})
    raw = lg.simulate(small, scene, lg.Incoherent(accuracy=1e-2))
    assert "paraxial" not in raw.metadata["error"]


def test_slices_of_exact_cameras_count_what_the_field_changes(monkeypatch, tmp_path):
    monkeypatch.setenv("LUMIGRAPH_CACHE", str(tmp_path))
    known = camera(model="auto", f_number=8.0).replace(lenslets={"count": (3, 3)})
    grid = lg.Grid.square(5, known.object_grid.pitch[0])
    scene = Scene([Slice(np.ones(grid.shape), grid, 0.0)])
    raw = lg.simulate(known, scene, lg.Incoherent(accuracy=5e-3))
    assert raw.metadata["error"]["source"].endswith("alike over the field")
    assert 0.3 * 5e-3 < raw.metadata["error"]["rms"] < 5e-3
    assert "paraxial" not in raw.metadata["error"]
    with pytest.warns(ParaxialWarning):
        lg.simulate(known.replace(model="paraxial"), scene, lg.Incoherent(accuracy=5e-3))


def test_exact_lenslets_are_square_and_alike():
    hexagons = camera(model="exact").replace(lenslets={"layout": "hex"})
    with pytest.raises(lg.GeometryError, match='model is "exact" but the lenslets are hex, of 1 focal'):
        hexagons.optics()
    assert hexagons.replace(model="auto").optics().model == "auto"
    with pytest.raises(lg.GeometryError, match="model: 'wave' is not"):
        camera(model="wave")


def test_optics_of_other_models_have_other_keys():
    keys = {Optics.of(camera(model=model), 8e-3, 1e-2).key for model in ("paraxial", "exact")}
    assert len(keys) == 2


@dataclass(frozen=True, kw_only=True)
class Even(Linear):
    """An even raw image of a brightness."""

    pixels: tuple[int, int]
    brightness: float

    @property
    def shape(self):
        return self.pixels, (1, 1)

    def _forward(self, intensity):
        return np.full(self.pixels, self.brightness) * intensity[0, 0]

    def _adjoint(self, raw):
        return np.full((1, 1), self.brightness * raw.sum())


@pytest.mark.parametrize("rotation", [0.0, 0.3])
def test_the_field_is_interpolated_at_each_pixels_place(rotation):
    known = camera().replace(lenslets={"rotation": rotation}).optics()
    shape, half = known.sensor.shape, COUNT * PITCH / 2

    def law(y, x):
        return 1 + y / half - 0.5 * x / half + (x / half) ** 2 + 2 * y * x / half**2

    whole = over_field(known, lambda place: Even(pixels=shape, brightness=law(*place)))
    y, x = (
        -at / (1 + known.lenslet_distance / known.separation)
        for at in np.meshgrid(known.sensor.grid.y, known.sensor.grid.x, indexing="ij")
    )
    sin, cos = math.sin(rotation), math.cos(rotation)
    expected = law(y * cos - x * sin, y * sin + x * cos)
    np.testing.assert_allclose(whole.forward(np.ones((1, 1))), expected, atol=1e-5)
    other = np.random.default_rng(0).random(shape)
    assert whole.adjoint(other)[0, 0] == pytest.approx((other * expected).sum(), rel=1e-5)


@pytest.mark.long  # nine operators: 40 s
def test_slices_beside_the_axis_are_points_there(tmp_path, monkeypatch):
    known = camera(model="exact", focal_length=1e-3).replace(lenslets={"count": (9, 9)})
    optics = known.optics()
    assert field_error(optics) > 5 * interpolated_error(optics)
    step = optics.object_distance / optics.separation * PITCH
    grid = lg.Grid((5, 5), known.object_grid.pitch, (0.2 * step, -3.3 * step))
    plane = np.zeros(grid.shape, np.float32)
    plane[2, 3] = 1
    exact = points_image(known, Points([[grid.y[2], grid.x[3], 0.0]], [1.0]), 1e-3)
    errors = []
    for interpolated in (False, True):
        monkeypatch.setattr(incoherent, "field_matters", lambda *_, on=interpolated: on)
        operator = periodic_operator(known, grid, accuracy=4e-3, folder=tmp_path)
        errors.append(off(operator.forward(plane), exact))
    assert errors[1] < 4e-3 < 6e-3 < errors[0]
