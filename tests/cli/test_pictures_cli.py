"""`lumigraph decode` on containers that hold pictures and maps instead of a raw image."""

import numpy as np
import pytest

import lumigraph.io as io
from fuzz import seeds


@pytest.fixture
def container(tmp_path):
    """Two grey pictures at lambda -1.5 and 4, a 2 x 2 and two 4 x 3 maps."""
    rows = [(place, seeds.jpeg(np.full((5, 6, 3), grey, np.uint8))) for place, grey in ((4, 200), (-1.5, 60))]
    depth, lut = np.arange(12, dtype="<f4") - 8, np.array([0, 1, 2, 3], "<f4")
    content = seeds.stack_container(rows, (5, 6), depth.tobytes(), lut.tobytes())
    (tmp_path / "a-stk.lfp").write_bytes(content)
    return depth.reshape(4, 3)


def test_pictures_and_maps_of_a_container_are_written(lumigraph, tmp_path, container):
    result = lumigraph("decode", "a-stk.lfp", "-o", "out")
    assert (result.code, result.err) == (0, "")
    names = ["confidence", "depth", "lut", "stack-000-lambda-1.5000", "stack-001-lambda+4.0000"]
    assert sorted(path.stem for path in (tmp_path / "out").iterdir()) == names
    np.testing.assert_array_equal(io.open(tmp_path / "out" / "depth.tiff").data, container)
    np.testing.assert_allclose(io.open(tmp_path / "out" / "stack-000-lambda-1.5000.png").data, 60, atol=2)
    assert "depth.tiff: 4 x 3 px, -8 to 3 lambda" in result.out


@pytest.mark.usefixtures("container")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "a.zarr"), "holds no raw image but pictures (stack, lut, depth, confidence)"),
        (("-o", "out", "--calibration", "a.toml"), "need neither --calibration nor --white"),
    ],
)
def test_what_a_container_cannot_become_is_refused(lumigraph, tmp_path, words, message):
    result = lumigraph("decode", "a-stk.lfp", *words)
    assert (result.code, result.out) == (1, "")
    assert message in result.err
    assert not (tmp_path / "out").exists()
