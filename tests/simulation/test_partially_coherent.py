"""Slices in partially coherent light, against sums of independent references and against its limits."""

import math
import re
from functools import partial

import numpy as np
import pytest
from benchmarks import references

import cameras
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.core.progress import Needs
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.instruments import FocusedPlenopticCamera, LightFieldMicroscope, SingleLensCamera
from lumigraph.scene import ExtendedSource, GaussianSchell, Scene, Slice, SpectralLine, targets
from lumigraph.simulation import Coherent, Incoherent, PartiallyCoherent, Spectrum, TiltedWaves, simulate
from lumigraph.units import mm, nm, um

SINGLE = SingleLensCamera(
    wavelength=633 * nm, object_distance=316 * mm,
    main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
    sensor={"pixel_pitch": 12 * um, "shape": (60, 64)},
)  # fmt: skip
GRID = Grid((24, 26), 20 * um)
PICTURE = np.random.default_rng(2).random(GRID.shape)
focused = partial(cameras.focused, count=(3, 3))


def scene(dz=0.0):
    return Scene([Slice(PICTURE, GRID, dz)])


def relative(image, reference):
    return np.linalg.norm(image - reference) / np.linalg.norm(reference)


def test_a_plane_before_lenslets_is_the_sum_over_its_mutual_intensity():
    """Samples' mutual intensity in closed form, its eigenvectors by NumPy, each through the references.

    A conjugate curvature or a source turned over is tens of percent off.
    """
    camera, dz, na = focused(), 3 * mm, 0.004
    grid = Grid((2, 3), (31 * um, 37 * um), (30 * um, -20 * um))
    amplitude = np.sqrt(np.array([[0.9, 0.4, 0.7], [0.2, 1.0, 0.6]]))
    distance = -camera.object_distance
    y, x = (c.ravel() for c in np.meshgrid(grid.y, grid.x, indexing="ij"))
    k, there = 2 * math.pi / camera.wavelength, distance - dz
    sine, middle = na * distance / there, 0.002 * distance / there
    apart = np.subtract.outer(y, y), np.subtract.outer(x, x)
    mutual = np.sinc(k * sine * apart[0] / np.pi) * np.sinc(k * sine / 2 * apart[1] / np.pi)
    bend = np.exp(1j * k * ((y**2 + x**2) / (2 * there) - middle * x))
    mutual = mutual * np.outer(bend, bend.conj()) * np.outer(amplitude, amplitude) * (distance / there) ** 2
    values, vectors = np.linalg.eigh(mutual)
    truth: np.ndarray = np.zeros(1)
    for value, vector in zip(values, vectors.T, strict=True):
        at = (((v, u), a) for v, u, a in zip(y, x, np.sqrt(max(value, 0)) * vector, strict=True))
        fineness = references.Fineness(32, 4, 400, 32)
        truth = truth + references.coherent(camera, dz, at, float(np.prod(grid.pitch)), fineness)
    truth = truth * (camera.separation / (camera.object_distance + dz)) ** 2
    source = ExtendedSource.picture(np.ones((1, 1)), Grid((1, 1), (2 * na, na), (0.0, 0.002)), distance)
    raw = simulate(camera, Scene([Slice(amplitude**2, grid, dz)]), PartiallyCoherent(source, 1e-5))
    assert relative(raw.data, truth) < 1e-4
    assert raw.metadata["error"]["rms"] < 2e-5


def test_a_point_of_light_far_away_is_coherent():
    coherent = simulate(SINGLE, scene(), Coherent()).data
    for source in (ExtendedSource.disc(1e-7), GaussianSchell(1.0, math.inf)):
        raw = simulate(SINGLE, scene(), PartiallyCoherent(source))
        assert relative(raw.data, coherent) < 1e-5
        assert "1 modes" in raw.metadata["error"]["source"]


def test_time_memory_and_modes_are_said_before_the_light_is_followed():
    told = []
    simulate(SINGLE, scene(), PartiallyCoherent(GaussianSchell(1e-3, 1e-4), 1e-2), progress=told.append)
    needs = [k for k, fraction in enumerate(told) if isinstance(fraction, Needs)]
    assert len(needs) == 1
    assert re.fullmatch(r".*\d+ modes, [\d.]+ [KM]iB, about \d+ s", told[needs[0]].what)
    assert told[needs[0]] < 0.05  # nothing but the first mode is done


def test_a_source_that_fills_all_directions_is_incoherent():
    """Samples do not interfere then; of the light, the pupil's share of the directions arrives."""
    few = Scene([Slice(PICTURE[:12, :12], Grid((12, 12), 20 * um))])
    exact = simulate(SINGLE, few, Incoherent(1e-4)).data
    half = SINGLE.wavelength / (2 * 20 * um)
    light = PartiallyCoherent(ExtendedSource.rectangle(half, -SINGLE.object_distance))
    raw = simulate(SINGLE, few, light)
    arrives = math.pi * SINGLE.pupil_diameter**2 / 4 / (2 * half * SINGLE.object_distance) ** 2
    assert relative(raw.data, exact * arrives) < 1e-3


def test_tilted_waves_approach_it():
    raw = simulate(SINGLE, scene(), PartiallyCoherent(ExtendedSource.disc(0.006, -SINGLE.object_distance)))
    assert raw.metadata["error"]["rms"] < 1e-3
    waves = simulate(SINGLE, scene(), TiltedWaves(60, na=0.006))
    assert relative(waves.data, raw.data) < 1e-2
    other = simulate(SINGLE, scene(), PartiallyCoherent(ExtendedSource.disc(0.005, -SINGLE.object_distance)))
    assert relative(waves.data, other.data) > 2e-2


@pytest.mark.parametrize(
    "source", [ExtendedSource.disc(0.004, -SINGLE.object_distance), GaussianSchell(500 * um, 200 * um)]
)
def test_a_wider_accuracy_takes_fewer_modes_and_states_what_that_does_to_the_image(source):
    """The mutual intensity's own error, at most what was asked, is up to 20,000 times the image's."""
    fine = simulate(SINGLE, scene(), PartiallyCoherent(source, 1e-4)).data
    for accuracy in (1e-1, 1e-2):
        raw = simulate(SINGLE, scene(), PartiallyCoherent(source, accuracy))
        assert 0.5 < raw.metadata["error"]["rms"] / relative(raw.data, fine) < 3


def test_a_wide_object_takes_as_many_waves_as_a_pixel_tells_apart():
    """Said before they are followed; fewer than the modes."""
    grid = Grid((40, 40), 20 * um)
    wide = Scene([Slice(np.random.default_rng(0).random(grid.shape), grid)])
    source, told = ExtendedSource.disc(0.005, -SINGLE.object_distance), []
    raw = simulate(SINGLE, wide, PartiallyCoherent(source, 1e-2), progress=told.append)
    modes = source.modes(grid, SINGLE.wavelength, accuracy=3e-3, dtype=np.complex64)
    exact = simulate(SINGLE, wide, PartiallyCoherent(modes)).data
    assert "waves of the source, coherent over" in raw.metadata["error"]["source"]
    assert relative(raw.data, exact) < 1.3 * raw.metadata["error"]["rms"] < 1.3e-2
    count = re.search(r"(\d+) waves of the source", told[0].what)
    assert count is not None
    assert int(count[1]) < modes.count / 1.5


@pytest.mark.long
def test_a_lamp_before_many_lenslets_is_the_sum_of_its_modes():
    camera = FocusedPlenopticCamera.from_catalogue("thesis-prototype")
    camera = camera.replace(lenslets={"count": (5, 5)}, sensor={"shape": None})
    picture = np.random.default_rng(0).random((60, 60)) > 0.5
    wide = Scene([Slice(picture.astype(float), camera.scene_grid)])
    source = ExtendedSource.disc(0.01, -camera.object_distance)
    raw = simulate(camera, wide, PartiallyCoherent(source, 1e-2))
    modes = source.waves(camera.scene_grid, camera.wavelength, 0.0, 0.7e-3)
    modes = CoherentModes(Field(modes, camera.scene_grid, camera.wavelength), 0.0)
    exact = simulate(camera, wide, PartiallyCoherent(modes)).data
    assert "waves of the source" in raw.metadata["error"]["source"]
    assert relative(raw.data, exact) < 1.3 * raw.metadata["error"]["rms"] < 1.3e-2


def test_modes_may_be_given_and_go_to_the_depth_of_a_slice():
    """Of a Gaussian-Schell beam, whose waist is on the focused plane: by propagation, and by its formula."""
    source, wide = GaussianSchell(150 * um, 120 * um), Grid((80, 80), 20 * um)
    modes = source.modes(wide, SINGLE.wavelength, accuracy=1e-3, dtype=np.complex64)
    for dz in (0.0, 20 * mm):
        given, formula = (
            simulate(SINGLE, scene(dz), PartiallyCoherent(light)).data for light in (modes, source)
        )
        assert relative(given, formula) < 1e-3
    other = simulate(SINGLE, scene(-20 * mm), PartiallyCoherent(source)).data
    assert relative(other, formula) > 0.02


def test_a_narrow_line_is_a_spectrum():
    light = PartiallyCoherent(ExtendedSource.disc(0.002, -SINGLE.object_distance))
    line = Spectrum.line(SpectralLine(SINGLE.wavelength, 10 * nm), 30 * um)
    raw = simulate(SINGLE, scene(), light, spectrum=line)
    assert len(raw.metadata["wavelength"]) > 1
    assert relative(raw.data, simulate(SINGLE, scene(), light).data) < 0.02


def test_points_and_white_in_the_scene_stay_incoherent():
    both = scene() + targets.points([(0.0, 0.0)])
    light = PartiallyCoherent(GaussianSchell(1 * mm, 300 * um), 1e-2)
    apart = simulate(SINGLE, scene(), light).data + simulate(SINGLE, targets.points([(0.0, 0.0)])).data
    np.testing.assert_allclose(simulate(SINGLE, both, light).data, apart, rtol=1e-5, atol=1e-6)


def test_what_cannot_be_lit_is_refused():
    source = GaussianSchell(100 * um, 100 * um)
    with pytest.raises(GeometryError, match="source is of type int"):
        PartiallyCoherent(3)  # type: ignore[arg-type]  # it is refused
    with pytest.raises(GeometryError, match="accuracy is 0"):
        PartiallyCoherent(source, 0)
    with pytest.raises(GeometryError, match="lenslets that are not turned"):
        simulate(focused(rotation=0.1), scene(), PartiallyCoherent(source))
    scope = LightFieldMicroscope.from_catalogue("lfm-worm")
    with pytest.raises(GeometryError, match="does not interfere"):
        simulate(scope, scene(), PartiallyCoherent(source))  # type: ignore[arg-type]  # it is refused
    few = source.modes(Grid((60, 60), 20 * um), 550 * nm)
    with pytest.raises(GeometryError, match="the modes have 550 nm but the camera 633 nm"):
        simulate(SINGLE, scene(), PartiallyCoherent(few))
    small = CoherentModes(source.sampled(Grid((8, 8), 20 * um), 633 * nm, 0.0, 1e-2, complex).fields)
    with pytest.raises(GeometryError, match="reaches beyond the modes' grid of 8 x 8"):
        simulate(SINGLE, scene(), PartiallyCoherent(small))
    wide = Scene([Slice(np.ones((3000, 3000)), Grid((3000, 3000), 2 * um))])
    with pytest.raises(SamplingError, match="could be had"):
        simulate(SINGLE, wide, PartiallyCoherent(ExtendedSource.disc(0.1)))
