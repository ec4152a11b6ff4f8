"""Surfaces of glass against published indices, Snell's law, Malus and Kirchhoff's integral over the glass."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from lumigraph.elements.surface import GlassSurface, index_at
from lumigraph.errors import GeometryError

WAVELENGTH = 550e-9
K = 2 * np.pi / WAVELENGTH
NODES, WEIGHTS = leggauss(220)


@pytest.mark.parametrize(("line", "n"), [(435.83e-9, 1.52668), (486.13e-9, 1.52238), (656.27e-9, 1.51432)])
def test_indices_are_those_of_bk7(line, n):
    assert index_at(line, 1.51680, 64.17) == pytest.approx(n, abs=4e-4)


def test_a_hyperbola_brings_light_to_its_focus():
    heights, f = np.linspace(0, 7e-6, 20), 35e-6
    path = GlassSurface(1.5, conic=-(1.5**2)).path(heights**2, 7e-6, f)
    np.testing.assert_allclose(path, np.hypot(f, heights) - f, atol=1e-15)
    assert np.abs(GlassSurface(1.5).path(heights**2, 7e-6, f) - path).max() > 1e-8


def through(surface, focal_length, height):
    """Directions and places in the vertex' plane, of rays at heights (n,): Snell's law by vectors."""
    n, radius = surface.index, (surface.index - 1) * focal_length
    root = np.sqrt(radius**2 - (1 + surface.conic) * height**2)
    sag, normal = height**2 / (radius + root), np.stack([height, root]) / np.hypot(height, root)
    ray = np.stack([0 * height, 0 * height + 1])
    if surface.thickness is None:
        ray = refracted(ray, normal, n)
        return ray, height + ray[0] / ray[1] * sag
    ray = refracted(ray, normal * [[-1], [1]], 1 / n)
    at = height + ray[0] / ray[1] * (surface.thickness - sag)
    ray = refracted(ray, np.stack([0 * height, 0 * height + 1]), n)
    return ray, at - ray[0] / ray[1] * surface.thickness / n


def refracted(ray, normal, ratio):
    along = (ray * normal).sum(0)
    return ratio * ray + (np.sqrt(1 - ratio**2 * (1 - along**2)) - ratio * along) * normal


@pytest.mark.parametrize(
    "surface", [GlassSurface(1.5), GlassSurface(1.46, -0.6), GlassSurface(1.5, 0.3, 20e-6)]
)
def test_rays_are_normal_to_the_wave_and_lose_no_power(surface):
    f, half = 56e-6, 7e-6
    height = np.linspace(0.5e-6, half, 9)
    ray, place = through(surface, f, height)
    step = 1e-9
    rising = [surface.path((place + s) ** 2, half, f) for s in (step, -step)]
    np.testing.assert_allclose((rising[0] - rising[1]) / (2 * step), -ray[0], rtol=2e-5)
    nodes, weights = (NODES + 1) / 2 * place[-1], WEIGHTS * place[-1] / 2
    cosine = np.sqrt(1 - np.interp(nodes, np.append(0, place), np.append(0, ray[0])) ** 2)
    power = np.sum(surface.amplitude(nodes**2, half, f) ** 2 * cosine * 2 * nodes * weights)
    assert power == pytest.approx(height[-1] ** 2, rel=2e-4)
    assert abs(place[-1] ** 2 / height[-1] ** 2 - 1) > 4e-3


def square(half):
    y, x = np.meshgrid(NODES * half, NODES * half, indexing="ij")
    return y, x, np.outer(WEIGHTS, WEIGHTS) * half**2


def behind_glass(surface, half, f, places):
    """Intensity at places (n, 2) in focus: Kirchhoff's integral over the curved side of a square."""
    y, x, weight = square(half)
    n, radius = surface.index, (surface.index - 1) * f
    root = np.sqrt(radius**2 - (1 + surface.conic) * (y * y + x * x))
    sag, inside = (y * y + x * x) / (radius + root), np.arctan(np.hypot(y, x) / root)
    outside = np.arcsin(n * np.sin(inside))
    light = np.exp(-1j * K * n * sag) * np.sqrt(np.cos(inside) / np.cos(outside))
    found = []
    for v, u in places:
        dy, dx, dz = v - y, u - x, f + sag
        way = np.sqrt(dy**2 + dx**2 + dz**2)
        towards = np.cos(inside) * (dy * y / root + dx * x / root + dz) / way
        wave = light * np.exp(1j * K * way) / (4 * np.pi * way)
        slope = 1j * K * (towards + np.cos(outside)) - towards / way
        found.append(np.sum(wave * slope * weight / np.cos(inside)))
    return np.abs(found) ** 2


def behind_plane(path, amplitude, half, f, places):
    """The same by Rayleigh and Sommerfeld's integral over the plane of the vertex."""
    y, x, weight = square(half)
    light = amplitude(y * y + x * x) * np.exp(-1j * K * path(y * y + x * x)) * weight
    found = []
    for v, u in places:
        way = np.sqrt((v - y) ** 2 + (u - x) ** 2 + f * f)
        found.append(np.sum(light * f / way**2 * (1 + 1j / (K * way)) * np.exp(1j * K * way)))
    return np.abs(np.array(found) / WAVELENGTH) ** 2


@pytest.mark.parametrize(
    ("f_number", "conic", "within", "ideal"),
    [(8, 0.0, 6e-4, 8e-3), (4, 0.0, 1.2e-2, 0.12), (4, -2.25, 1.2e-3, 2.5e-2)],
)
def test_a_lenslet_is_its_glass(f_number, conic, within, ideal):
    half, f, surface = 20e-6, f_number * 40e-6, GlassSurface(1.5, conic)
    at = np.linspace(-8, 8, 25) * WAVELENGTH * f_number
    places = np.stack([0.8 * at, 0.6 * at], axis=1)[np.abs(at) < half]
    truth = behind_glass(surface, half, f, places)
    seen = behind_plane(
        lambda q: surface.path(q, half, f), lambda q: surface.amplitude(q, half, f),
        surface.seen(half, f), f, places,
    )  # fmt: skip
    perfect = behind_plane(lambda q: np.sqrt(f * f + q) - f, np.ones_like, half, f, places)
    off, others = (np.linalg.norm(image - truth) / np.linalg.norm(truth) for image in (seen, perfect))
    assert off < within < ideal < others


def test_glass_has_to_reach_the_corners():
    with pytest.raises(GeometryError, match=r"radius \(n - 1\) f is 14 µm, on which the corner, 9.8995 µm"):
        GlassSurface(1.5).check(7e-6, 28e-6)
    with pytest.raises(GeometryError, match=r"thickness is 0\.5 µm but must be from 0\.88238 µm"):
        GlassSurface(1.5, thickness=5e-7).check(7e-6, 112e-6)
    GlassSurface(1.5, thickness=1e-6).check(7e-6, 112e-6)
