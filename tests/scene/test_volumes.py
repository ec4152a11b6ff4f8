import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, LumigraphError
from lumigraph.scene import Diffuser, Points, Scene, Slice

GRID = Grid((7, 8), (2.0, 0.5), (10.0, -3.0))


def picture(xp=np):
    values = np.zeros((7, 8), np.float32)
    values[1, 6], values[4, 3] = 1, 4
    return xp.asarray(values)


def test_trimming_keeps_every_sample_where_it_was(xp):
    whole = Slice(picture(xp), GRID, dz=0.2)
    part = whole.trimmed()
    assert isinstance(part.intensity, type(whole.intensity))
    assert (part.grid.shape, part.dz) == ((4, 4), 0.2)
    np.testing.assert_allclose(part.grid.y, GRID.y[1:5])
    np.testing.assert_allclose(part.grid.x, GRID.x[3:7])
    assert part.grid.samples_to(GRID) == (1, 3)
    np.testing.assert_array_equal(to_numpy(part.intensity), to_numpy(whole.intensity)[1:5, 3:7])


def test_trimming_a_colour_slice_keeps_what_any_colour_lights():
    colours = np.zeros((7, 8, 3))
    colours[2, 2, 0], colours[5, 4, 2] = 1, 1
    assert Slice(colours, GRID).trimmed().intensity.shape == (4, 3, 3)


def test_a_dark_slice_is_trimmed_to_one_sample():
    assert Slice(np.zeros((7, 8)), GRID).trimmed().intensity.shape == (1, 1)


def test_the_amplitude_is_the_square_root(xp):
    assert float(to_numpy(Slice(picture(xp), GRID).amplitude)[4, 3]) == 2.0


def test_scenes_add_move_and_brighten():
    scene = Scene([Slice(picture(), GRID, 0.1)]) + Scene([Points([(1, 2, 0.3)], [5.0]), Diffuser(2.0)])
    moved = scene.at(0.5).scaled(3.0)
    flat, points, diffuser = moved.parts
    assert flat.dz == pytest.approx(0.6)
    assert flat.intensity.max() == 12
    np.testing.assert_allclose(points.positions, [[1, 2, 0.8]])
    assert points.intensities.tolist() == [15.0]
    assert diffuser == Diffuser(6.0)
    assert scene.parts[0].dz == 0.1


def test_only_scenes_add_to_scenes():
    with pytest.raises(TypeError):
        Scene() + 1


@pytest.mark.parametrize(
    ("build", "error", "message"),
    [
        (lambda: Slice(np.zeros((8, 7)), GRID), GeometryError, r"a slice has shape \(8, 7\) but must be"),
        (lambda: Slice(picture() * 1j, GRID), LumigraphError, "the intensity of a slice is complex"),
        (lambda: Slice(picture() - 1, GRID), LumigraphError, "the intensity of a slice goes down to -1"),
        (lambda: Slice(picture() * np.nan, GRID), LumigraphError, "the intensity of a slice has 56 NaN"),
        (lambda: Slice(picture(), GRID, np.inf), GeometryError, "dz is inf but must be a finite number"),
        (lambda: Points([(0, 0)], [1]), GeometryError, r"positions have shape \(1, 2\)"),
        (lambda: Points([(0, 0, 0)], [1, 2]), GeometryError, r"intensities \(2,\)"),
        (lambda: Points([(0, 0, np.nan)], [1]), LumigraphError, "positions has 1 NaN"),
        (lambda: Points([(0, 0, 0)], [-1]), LumigraphError, "the intensity of points goes down to -1"),
        (lambda: Diffuser(-1.0), LumigraphError, "the intensity of a diffuser goes down to -1"),
        (
            lambda: Scene([picture()]),
            GeometryError,
            "a part of type ndarray but takes Slice, Points and Diffuser",
        ),
    ],
)
def test_impossible_scenes_are_refused(build, error, message):
    with pytest.raises(error, match=message):
        build()
