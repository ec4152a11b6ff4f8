"""MATLAB files of version 5: what SciPy writes comes back as SciPy reads it; what is damaged is refused."""

import struct
import tracemalloc
import zlib

import numpy as np
import pytest
import scipy.io

import lumigraph as lg
from lumigraph.errors import FormatError
from lumigraph.io import mat, mat5

TYPES = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
SHAPES = ((3, 4), (3, 4, 5), (2, 3, 4, 5), (2, 3, 4, 5, 3))
BESIDE = {"s": {"a": 1.0, "b": "text"}, "c": np.array([1, "x"], object), "t": "text", "z": np.eye(3) * 1j}
PICTURE = np.arange(12, dtype=np.uint8).reshape(3, 4)
STORED = PICTURE.T.tobytes()


def part(kind, content, order="<"):
    return struct.pack(f"{order}II", kind, len(content)) + content + bytes(-len(content) % 8)


def variable(numbers=STORED, *, code=9, kind=2, lengths=(3, 4), name=b"a", flags=0, order="<", more=b""):
    """A variable by hand; its default is PICTURE."""
    inner = part(6, struct.pack(f"{order}II", code | flags, 0), order)
    inner += part(5, struct.pack(f"{order}{len(lengths)}i", *lengths), order) + part(1, name, order)
    return part(14, inner + part(kind, numbers, order) + more, order)


def packed(content):
    content = zlib.compress(content)
    return struct.pack("<II", 15, len(content)) + content


def written(tmp_path, *elements, order="<"):
    path = tmp_path / "a.mat"
    end = b"\0\1IM" if order == "<" else b"\1\0MI"
    path.write_bytes(b"MATLAB 5.0".ljust(124) + end + b"".join(elements))
    return path


def numbers(path, name="a"):
    (found,) = [each for each in mat5.variables(path) if each.name == name]
    return mat5.values(path, found)


@pytest.mark.parametrize("do_compression", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_arrays_of_every_type_come_back_as_scipy_reads_them(tmp_path, shape, do_compression):
    rng, path = np.random.default_rng(len(shape)), tmp_path / "a.mat"
    arrays = {f"a_{dtype}": (rng.random(shape) * 200 - 100).astype("i8").astype(dtype) for dtype in TYPES}
    scipy.io.savemat(
        path, {**BESIDE, **arrays, "bool": rng.random(shape) > 0.5}, do_compression=do_compression
    )
    expected, found = scipy.io.loadmat(path), {each.name: each for each in mat5.variables(path)}
    for name in (*arrays, "bool"):
        value = mat5.values(path, found[name])
        np.testing.assert_array_equal(value, expected[name])
        assert value.dtype == expected[name].dtype
    kinds = {name: found[name].kind for name in (*BESIDE, "bool")}
    assert kinds == {"s": "struct", "c": "cell", "t": "char", "z": "complex double", "bool": "logical"}
    assert all(found[name].dtype is None for name in BESIDE)


@pytest.mark.parametrize(
    ("code", "kind", "stored"), [(6, 2, "u1"), (6, 5, "i4"), (7, 4, "u2"), (11, 2, "u1")]
)
def test_numbers_stored_in_fewer_bytes_have_the_type_of_their_class(tmp_path, code, kind, stored):
    content = PICTURE.astype(stored).T.tobytes()
    path = written(tmp_path, variable(content, code=code, kind=kind))
    found = numbers(path)
    np.testing.assert_array_equal(found, PICTURE)
    assert found.dtype == {6: "f8", 7: "f4", 11: "u2"}[code]
    assert found.dtype == scipy.io.loadmat(path, mat_dtype=True)["a"].dtype


def test_files_of_the_other_byte_order_are_read(tmp_path):
    content = PICTURE.astype(">u2").T.tobytes()
    path = written(tmp_path, variable(content, code=6, kind=4, order=">"), order=">")
    found = numbers(path)
    np.testing.assert_array_equal(found, PICTURE)
    assert found.dtype.isnative


def test_small_parts_lie_inside_their_tags(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"ab": np.array([[1, 2]], np.uint8)})
    assert struct.pack("<I", 2 << 16 | 2) in path.read_bytes()
    np.testing.assert_array_equal(numbers(path, "ab"), [[1, 2]])


def test_what_matlab_keeps_for_its_objects_is_no_variable(tmp_path):
    path = written(tmp_path, variable(), variable(name=b""))
    assert [each.name for each in mat5.variables(path)] == ["a"]
    np.testing.assert_array_equal(lg.open(path).data, PICTURE)


DAMAGED = {
    "has 3 x 5 = 15 numbers but 12 bytes of 1 each": variable(lengths=(3, 5)),
    "has 3 x 3 = 9 numbers but 12 bytes": variable(lengths=(3, 3)),
    r"has dimensions \(3,\)": variable(lengths=(3,)),
    r"has dimensions \(-3, -4\)": variable(lengths=(-3, -4)),
    "a part has type 5 and 132 bytes, not type 5 and up to 128": variable(lengths=(1,) * 33),
    "is uint8 but stored as type 4": variable(PICTURE.astype("u2").T.tobytes(), kind=4),
    "is uint8 but stored as type 77": variable(kind=77),
    "is stored as int8 that uint8 cannot hold": variable(bytes([255] * 12), kind=1),
    r"a variable is called 'a\\nb'": variable(name=b"a\nb"),
    "does not end with its numbers": variable(more=bytes(8)),
    "has type 3, not 14": part(3, bytes(8)),
    "has type 16, not 14": packed(part(16, bytes(64))),
    "cut short: a variable ends behind its": variable()[:-1],
    "cut short: a variable lacks": packed(variable()[:-9]),
    "a variable needs 4 bytes where 0 are left": part(14, b""),
    "a small part has 5 bytes": part(14, struct.pack("<II", 5 << 16 | 6, 0)),
    "a packed variable is not zlib's: Error -3": packed(variable())[:-1] + b"?",
    "cut short or damaged: it declares 100000000 bytes": variable(lengths=(10000, 10000)),
    r"2 variables are called 'a'": variable() * 2,
}


@pytest.mark.parametrize("message", DAMAGED)
def test_damaged_files_are_refused_by_what_is_wrong(tmp_path, message):
    with pytest.raises(FormatError, match=message) as refused:
        mat.load(written(tmp_path, DAMAGED[message]))
    assert "\n" not in str(refused.value)


def test_other_versions_and_cut_headers_are_refused(tmp_path):
    path = tmp_path / "a.mat"
    for head in (b"MATLAB 5.0", b"MATLAB 5.0".ljust(124) + b"\0\3IM", b"MATLAB 5.0".ljust(124) + b"\0\1XX"):
        path.write_bytes(head + variable())
        with pytest.raises(
            FormatError, match=r"no MATLAB file of version 5: its version and byte order are b"
        ):
            mat.load(path)


def test_the_limits_of_pixels_and_of_variables_hold(tmp_path):
    path = written(tmp_path, variable())
    mat.load(path, max_pixels=12)
    with pytest.raises(FormatError, match=r"declares 3 x 4 = 12 pixels but at most 11 are read"):
        mat.load(path, max_pixels=11)
    path = written(tmp_path, variable() * 10_001)
    with pytest.raises(FormatError, match="holds more than 10000 variables"):
        mat.load(path)


@pytest.mark.parametrize("shape", [(3, 4), (7000, 8000)])
def test_a_small_file_that_inflates_without_end_takes_no_memory(tmp_path, shape):
    """60 MB of zeros from 60 kB: more than a small array declares, less than a large one does."""
    path = written(tmp_path, packed(variable(bytes(60_000_000), lengths=shape, code=15)))
    found = mat5.variables(path)[0]
    tracemalloc.start()
    with pytest.raises(FormatError, match=r"60000000 bytes|declares 4.48e\+08 bytes of pixels from"):
        mat5.values(path, found)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 4 << 20


def test_what_is_no_array_of_real_numbers_is_named(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, BESIDE)
    others = r"s \(1 x 1 struct\), c \(1 x 2 cell\), t \(1 x 4 char\), z \(3 x 3 complex double\)"
    with pytest.raises(FormatError, match=f"no array of 2 to 5 axes of real numbers, only {others}"):
        mat.load(path)
    scipy.io.savemat(path, {**BESIDE, "LF": np.ones((3, 4)) * 1j, "a": PICTURE})
    assert mat.contents(path) == [("a", "RawImage", "3 x 4, uint8")]
    for what in (None, "LF"):  # not the other array instead
        with pytest.raises(FormatError, match=r"'LF': it is 3 x 4 complex double. It holds a\."):
            mat.load(path, what=what)
    with pytest.raises(FormatError, match=r"no array of numbers 's': it is 1 x 1 struct. It holds a\."):
        mat.load(path, what="s")
    with pytest.raises(FormatError, match=r"no array of numbers 'b'. It holds a\."):
        mat.load(path, what="b")
    np.testing.assert_array_equal(mat.load(path, what="a").data, PICTURE)
