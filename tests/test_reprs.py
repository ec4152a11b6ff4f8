"""Every public object shows itself in ten lines, however large it is."""

import inspect
from dataclasses import fields, is_dataclass

import numpy as np
import pytest

import cameras
import lumigraph as lg
from lumigraph.core.linear import Linear
from lumigraph.core.matrix import Matrix
from lumigraph.core.prepared import PreparedImage
from lumigraph.deconvolution import Exposure
from lumigraph.metrology.scanning import FoundShifts
from lumigraph.operators import periodic_operator, single_lens_operator

N = 700
PICTURE = np.random.default_rng(1).random((N, N))
GRID = lg.Grid.square(N, 1e-6)
CAMERA = cameras.focused(count=(31, 31))
SINGLE = lg.load_camera("thesis-2f").replace(sensor={"shape": (50, 50)})
SCOPE = lg.LightFieldMicroscope.from_catalogue("lfm-worm").replace(lenslets={"count": (5, 5)})
LARGE = [
    lg.RawImage(PICTURE, 5e-6, metadata={"a long note": "word " * 999, "numbers": list(range(999))}),
    lg.Field(PICTURE + 0j, GRID, 5e-7),
    lg.CoherentModes(lg.Field(PICTURE + 0j, GRID, 5e-7)),
    lg.LightField(PICTURE.reshape(7, 10, 70, 100), lg.Grid((7, 10), 1e-3), lg.Grid((70, 100), 1e-4), 0.1),
    lg.Volume(np.broadcast_to(PICTURE, (90, N, N)), GRID, np.linspace(0, 1e-3, 90)),
    lg.Medium(np.broadcast_to(PICTURE * 1e-9, (90, N, N)), GRID, np.linspace(0, 1e-3, 90)),
    lg.Stack(np.broadcast_to(PICTURE, (90, N, N)), np.linspace(0, 1, 90)),
    lg.depth.DepthMap(PICTURE, PICTURE, "depth"),
    lg.PointCloud(PICTURE[:, :3], PICTURE[:, :3]),
    lg.Slice(PICTURE, GRID),
    lg.Scene([lg.Slice(PICTURE, GRID, dz) for dz in np.linspace(0, 1e-3, 50)]),
    lg.targets.points([(y, 0.0) for y in np.linspace(0, 1e-3, 999)]).parts[0],
    CAMERA.calibration,
    CAMERA.describe(),
    PreparedImage(PICTURE, 5e-6, calibration=CAMERA.calibration, reasons=np.zeros((N, N), np.uint8)),
    Exposure(background=PICTURE, response=PICTURE),
    Matrix(PICTURE, (N,), (N,)),
    periodic_operator(cameras.focused(count=(4, 4)), lg.Grid.square(40, 1e-5), accuracy=1e-2),
    single_lens_operator(SINGLE, lg.Grid.square(9, 1e-5)),
    SCOPE.operator(None, 1, pixels=3),
    FoundShifts(PICTURE[:, :2], PICTURE[:, :2], PICTURE, 1.0),
]  # fmt: skip
SMALL = {
    lg.CircularAperture, lg.Coherent, lg.Grid, lg.Incoherent, lg.Lattice, lg.LensletArray, lg.Propagate,
    lg.ExtendedSource, lg.GaussianSchell, lg.PartiallyCoherent, lg.RectangularAperture, lg.Sensor,
    lg.SpectralLine, lg.Snapshots, lg.Spectrum, lg.ThinLens, lg.TiltedWaves, lg.Train,
    lg.Goal, lg.ZernikePlate,
}  # fmt: skip
"""Of numbers alone."""


@pytest.mark.parametrize("thing", LARGE, ids=lambda thing: type(thing).__name__)
def test_a_large_object_shows_itself_in_ten_lines(thing):
    told = repr(thing)
    assert type(thing).__name__ in told
    assert told.count("\n") < 10
    assert max(map(len, told.splitlines())) <= 130
    for name in ("array(", "0x"):
        assert name not in told


def test_arrays_are_told_by_type_and_shape():
    assert "data=float64 (700, 700), pixel_pitch=5e-06" in repr(LARGE[0])


def test_no_public_class_is_left_out():
    public = {
        thing for name in lg.__all__ if inspect.isclass(thing := getattr(lg, name)) and is_dataclass(thing)
    }
    assert public - SMALL <= {type(thing) for thing in LARGE}
    for kind in SMALL:
        assert not any("ndarray" in str(field.type) for field in fields(kind))


def test_every_operator_is_a_linear_map_and_tells_memory_and_error():
    for thing in LARGE:
        if isinstance(thing, Linear) and not isinstance(thing, Matrix):
            assert "samples" in repr(thing)
            assert " MB, estimated error " in repr(thing)
            assert thing.memory_bytes > 4 * np.prod(thing.shape[0])
