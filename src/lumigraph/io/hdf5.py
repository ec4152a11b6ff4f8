"""HDF5: what lumigraph writes, Heidelberg light fields (datasets LF, GT_DEPTH), and any array of numbers.

Files by MATLAB (`h5write`, and .mat files of version 7.3, which have a block of text in front) hold arrays in
reverse order.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from math import prod
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io import arrays, header, source, target

_KEY, _DATA, _VALID = "lumigraph", "data", "valid"
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_PACKING: dict[str, Any] = {"compression": "gzip", "shuffle": True, "fletcher32": True}
SIGNATURE = b"\x89HDF\r\n\x1a\n"
_BLOCKS = tuple(512 << k for k in range(8))  # bytes of text that may stand in front
_MOST = 10_000  # datasets listed
_SMALL = 64 << 20  # bytes of one chunk that may be inflated without counting first
Noun = RawImage | LightField | Volume | Stack


def load(
    path: Path, *, what: str | None = None, axes: str | None = None, max_pixels: int = source.MAX_PIXELS
) -> Noun:
    """Content of an HDF5 file: an object that lumigraph saved, a Heidelberg light field, or one array.

    Parameters
    ----------
    path
        An HDF5 file.
    what
        Name of a dataset, where the file is by another program and holds several. Its axes say what it is:
        (y, x) or (y, x, 3) a raw image, (v, u, y, x[, c]) a light field of cameras, (n, y, x[, c]) a stack.
    axes
        What they are, in the order stored, such as "cxyuv", where the shape does not say.
    max_pixels
        Larger ones are refused.

    Raises
    ------
    FormatError
        Not HDF5, damaged, too large, several datasets and no choice, several orders that the axes can have,
        or filters that are not read.
    """
    with _reading(path) as file:
        found = _header(path, file)
        if what is None and found is not None:
            valid = _values(path, _dataset(path, file, _VALID), max_pixels) if _VALID in file else None
            return _restored(_values(path, _dataset(path, file, _DATA), max_pixels), found, valid)
        name = what if what is not None else _only(path, file)
        dataset, known = _dataset(path, file, name), dict(_numbers(file))
        order = _order(path, file, name, dataset, axes)
        data = _values(path, dataset, max_pixels)
        return arrays.as_noun(data, order, known, weighted=_is_matlab(dataset))


def save(thing: RawImage | LightField | Volume, path: Path) -> None:
    """Write a raw image, a light field or a volume; Deflate, with checksums, axes named and with units."""
    data = to_numpy(thing.data)
    if data.dtype.kind not in "iufb":
        raise FormatError(f"HDF5 cannot hold {data.dtype} here. Save real numbers.")
    scales: dict[str, np.ndarray] = {}
    if isinstance(thing, RawImage):
        fields, names = {"kind": "RawImage", **header.describe(thing)}, "yxc"
    elif isinstance(thing, LightField):
        fields, names = header.describe_views(thing), "vutsc"
        a, b = thing.aperture, thing.lenslets
        scales = {"v": a.y, "u": a.x, "t": b.y, "s": b.x}
    else:
        fields, names = header.describe_volume(thing), "zyxc"
        scales = {"z": np.asarray(thing.depths), "y": thing.grid.y, "x": thing.grid.x}
    with target.replacing(path) as temporary, _writing(temporary) as file:
        # Bytes, not a string attribute: libhdf5 keeps those in heaps, which it follows for ever when damaged.
        file[_KEY] = np.frombuffer(json.dumps(fields).encode("ascii"), np.uint8)
        dataset = file.create_dataset(_DATA, data=data, chunks=_chunks(data), **_PACKING)
        if isinstance(thing, LightField) and thing.valid is not None:
            mask = to_numpy(thing.valid).astype(np.uint8)
            file.create_dataset(_VALID, data=mask, chunks=_chunks(mask), **_PACKING)
        for k, name in enumerate(names[: data.ndim]):
            dataset.dims[k].label = name
            if name in scales:
                scale = file.create_dataset(name, data=scales[name])
                scale.attrs["units"] = np.bytes_("m")
                scale.make_scale(name)
                dataset.dims[k].attach_scale(scale)


@contextmanager
def _writing(path: Path) -> Iterator[h5py.File]:
    with _Spool(path, "w+") as spool:
        with h5py.File(spool, "w", track_order=True) as file:
            yield file
        spool.settle()


class _Spool(FileIO):
    """File that hides its failures from libhdf5, which crashes on a full disk."""

    failure: OSError | None = None

    def write(self, content: Any) -> int:
        """Write all of it, or remember why not."""
        rest = memoryview(content).cast("B")
        size = len(rest)
        try:
            while len(rest) and self.failure is None:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self.failure = error
        return size

    def truncate(self, size: int | None = None) -> int:
        """Cut or extend the file, or remember why not."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.failure = error
            return size or 0

    def settle(self) -> None:
        """Raise what went wrong."""
        if self.failure is not None:
            raise self.failure


def contents(path: Path) -> list[tuple[str, str, str]]:
    """The datasets of a file: (name, noun, about) each."""
    with _reading(path) as file:
        found = _header(path, file)
        if found is not None:
            return [("", str(found.get("kind")), _about(_dataset(path, file, _DATA)))]
        return [(name, _noun(each), _about(each)) for name, each in _datasets(file)]


@contextmanager
def _reading(path: Path) -> Iterator[h5py.File]:
    path = source.regular_file(path)
    with path.open("rb") as file:
        starts = [_at(file, at) for at in (0, *_BLOCKS)]
    if not any(start == SIGNATURE for start in starts[1:]):
        source.check_signature(path, starts[0], "HDF5")
    with source.decoding(path, "an HDF5 file"), h5py.File(path, "r", locking=False) as file:
        yield file


def _at(file: BinaryIO, place: int) -> bytes:
    file.seek(place)
    return file.read(len(SIGNATURE))


def _header(path: Path, file: h5py.File) -> dict[str, Any] | None:
    """Header that lumigraph saved beside the pixels; None in files by others."""
    if not isinstance(file.get(_KEY, getlink=True), h5py.HardLink):
        return None
    text = file[_KEY]
    if not isinstance(text, h5py.Dataset) or text.dtype != np.uint8 or text.ndim != 1 or len(text) > 1 << 24:
        raise FormatError(f"{path} has a damaged lumigraph header. Copy or save it again.")
    source.check_stored(path, len(text), min(text.id.get_storage_size(), path.stat().st_size), 1)
    found = header.loads(bytes(text[...]))
    if found is None:
        raise FormatError(f"{path} has a damaged lumigraph header. Copy or save it again.")
    return found


def _datasets(file: h5py.File) -> list[tuple[str, h5py.Dataset]]:
    """Datasets of numbers of 2 to 5 axes in the file and its groups; soft and outer links are left."""
    found: list[tuple[str, h5py.Dataset]] = []
    groups: list[tuple[str, Any, int]] = [("", file, 0)]
    while groups and len(found) < _MOST:
        prefix, group, depth = groups.pop(0)
        for name in list(group)[:_MOST]:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            each = group[name]
            if isinstance(each, h5py.Dataset) and 2 <= each.ndim <= 5 and each.dtype.kind in "iufb":
                found.append((prefix + name, each))
            elif isinstance(each, h5py.Group) and depth < 8:
                groups.append((f"{prefix}{name}/", each, depth + 1))
    return found


def _only(path: Path, file: h5py.File) -> str:
    names = [name for name, _ in _datasets(file)]
    if "LF" in names:
        return "LF"
    if len(names) == 1:
        return names[0]
    if not names:
        raise FormatError(f"{path} holds no array of 2 to 5 axes. Check the file.")
    raise FormatError(f"{path} holds {', '.join(names[:8])}. Choose one by what=.")


def _dataset(path: Path, file: h5py.File, name: str) -> h5py.Dataset:
    node: Any = file
    for part in str(name).split("/"):
        link = node.get(part, getlink=True) if isinstance(node, h5py.Group) and part else None
        if not isinstance(link, h5py.HardLink):
            near = ", ".join(each for each, _ in _datasets(file)[:8]) or "nothing that is read"
            raise FormatError(f"{path} has no dataset {name!r}. It holds {near}.")
        node = node[part]
    if not isinstance(node, h5py.Dataset) or node.dtype.kind not in "iufb" or not 2 <= node.ndim <= 5:
        raise FormatError(f"{path}: {name} is not an array of numbers with 2 to 5 axes.")
    return node


def _values(path: Path, dataset: h5py.Dataset, max_pixels: int) -> np.ndarray:
    """The array, after its size, its filters and what its chunks become have been checked."""
    source.check_size(path, dataset.shape, max_pixels)
    if dataset.is_virtual or dataset.external:
        raise FormatError(f"{path} keeps its pixels in other files. Copy them into one.")
    plist, needed = dataset.id.get_create_plist(), prod(dataset.shape) * dataset.dtype.itemsize
    filters = {plist.get_filter(k)[0] for k in range(plist.get_nfilters())}
    if not filters <= _FILTERS:
        raise FormatError(f"{path} is packed with filters {sorted(filters)}; only Deflate is read.")
    stored = min(dataset.id.get_storage_size(), path.stat().st_size)
    source.check_stored(path, needed, stored, 1 if not filters else source.MOST_INFLATED)
    source.check_held(path, needed, stored, max_pixels)
    if dataset.chunks is not None:
        _check_chunks(path, dataset, dataset.chunks, deflated=h5py.h5z.FILTER_DEFLATE in filters)
    return np.asarray(dataset[...])


def _check_chunks(path: Path, dataset: h5py.Dataset, chunks: tuple[int, ...], *, deflated: bool) -> None:
    limit = prod(chunks) * dataset.dtype.itemsize
    source.check_size(path, chunks, max(1 << 24, 2 * prod(dataset.shape)))
    wanted = prod(-(-n // c) for n, c in zip(dataset.shape, chunks, strict=True))
    count = dataset.id.get_num_chunks()
    if count != wanted:
        raise FormatError(f"{path} is incomplete: {count} of {wanted} chunks are there. Copy it again.")
    size, most = path.stat().st_size, max(limit + 1024, _SMALL)
    for k in range(count):
        chunk = dataset.id.get_chunk_info(k)
        if chunk.byte_offset is None or chunk.byte_offset + chunk.size > size:
            raise FormatError(f"{path} is cut short: a chunk ends behind its {size} bytes. Copy it again.")
        if deflated and chunk.size * source.MOST_INFLATED > most:
            with path.open("rb") as file:
                file.seek(chunk.byte_offset)
                source.check_inflated(path, file.read(chunk.size), most)


def _restored(data: np.ndarray, found: dict[str, Any], valid: np.ndarray | None) -> Noun:
    kind = found.get("kind")
    if kind == "RawImage":
        return header.restore(data, found, None)
    if kind == "LightField":
        grids = header.grid(found.get("aperture")), header.grid(found.get("lenslets"))
        mask = None if valid is None else valid.astype(bool)
        return LightField(data, *grids, found.get("separation", 0.0), mask)
    return header.restore_planes(data, found)


def _order(path: Path, file: h5py.File, name: str, dataset: h5py.Dataset, axes: str | None) -> str:
    """Axes of a dataset by another program."""
    heidelberg = {"dH", "dV", "focalLength"} & set(list(file.attrs)[:200])
    reverse = True if _is_matlab(dataset) else False if heidelberg else None
    what = f"{name} of {path}"
    return arrays.arrangement(what, dataset.shape, axes=axes, reverse=reverse, weighted=_is_matlab(dataset))


def _is_matlab(dataset: h5py.Dataset) -> bool:
    """Whether MATLAB itself wrote it, by `save` with -v7.3: `h5write` leaves no mark."""
    return "MATLAB_class" in dataset.attrs


def _noun(dataset: h5py.Dataset) -> str:
    try:
        reverse = True if _is_matlab(dataset) else None
        return arrays.noun_of(arrays.arrangement("", dataset.shape, reverse=reverse, weighted=bool(reverse)))
    except FormatError:
        return "array"


def _numbers(file: h5py.File) -> Iterator[tuple[str, float]]:
    """Attributes that are one number; strings are not read, see `save`."""
    for name in list(file.attrs)[:200]:
        stored = file.attrs.get_id(name)
        if stored.dtype.kind in "iuf" and stored.shape in ((), (1,)):
            value = float(np.asarray(file.attrs[name]).ravel()[0])
            if np.isfinite(value):
                yield name, value


def _chunks(data: np.ndarray) -> tuple[int, ...]:
    """About a MiB: whole rows of the last axes."""
    sides, size = list(data.shape), data.dtype.itemsize
    for k in range(len(sides)):
        if prod(sides) * size <= 1 << 20:
            break
        rest = prod(sides[k + 1 :]) * size
        sides[k] = max(1, min(sides[k], (1 << 20) // max(rest, 1)))
    return tuple(sides)


def _about(dataset: h5py.Dataset) -> str:
    return f"{' x '.join(map(str, dataset.shape))}, {dataset.dtype}"
