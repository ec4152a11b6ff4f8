"""A series of results of one shape as one Zarr v3 store: a shard for each frame, written one by one.

Other programs open the store while it grows: frames that are not there yet read as NaN, or 0 of whole
numbers. Volumes become OME-Zarr with an axis of time.
"""

import json
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.abc.buffer import Buffer
from zarr.codecs import ZstdCodec
from zarr.storage import LocalStore, WrapperStore

from lumigraph import store
from lumigraph.core.arrays import to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io import header, ngff, source, zarr_chunks

KIND = "Series"
_SIDE = 256
"""Samples of a chunk along each of the last two axes."""

_DESCRIBED = 1 << 24
"""Bytes of a description that are read at most."""

Checksums = dict[str, tuple[int, int]]
"""Size and CRC-32 of each file, by its name inside the store."""


@dataclass(frozen=True, slots=True)
class SeriesFrame:
    """One result as arrays.

    Parameters
    ----------
    arrays
        Arrays by name; of one shape and type in all frames.
    axes
        Names of their axes.
    attributes
        Other metadata, as JSON values; those of the first frame are kept.
    """

    arrays: dict[str, np.ndarray]
    axes: dict[str, tuple[str, ...]]
    attributes: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, thing: Any) -> "SeriesFrame":
        """A picture, several, views, a volume, a depth map, or arrays by name.

        Raises
        ------
        FormatError
            Something else, or what is no numbers.
        """
        found = cls._of(thing)
        for name, array in found.arrays.items():
            if array.dtype.kind not in "iufb" or array.size == 0:
                raise FormatError(f"{name} is {array.dtype} of shape {array.shape}, which no series holds.")
        return found

    @classmethod
    def _of(cls, thing: Any) -> "SeriesFrame":
        match thing:
            case Volume():
                about = {**header.describe_volume(thing), "ome": ngff.describe(thing, times=True)}
                return cls(
                    {ngff.LEVEL: ngff.data(to_numpy(thing.data))}, {ngff.LEVEL: ngff.names(thing)}, about
                )
            case LightField():
                arrays = {"data": to_numpy(thing.data)}
                if thing.valid is not None:
                    arrays["valid"] = to_numpy(thing.valid)
                axes = {name: ("v", "u", "t", "s", "c")[: array.ndim] for name, array in arrays.items()}
                return cls(arrays, axes, header.describe_views(thing))
            case DepthMap():
                given = {"values": thing.values, "confidence": thing.confidence, "error": thing.error}
                arrays = {name: to_numpy(array) for name, array in given.items() if array is not None}
                about = {"kind": "DepthMap", "quantity": thing.quantity, "unit": thing.unit}
                return cls(arrays, dict.fromkeys(arrays, ("y", "x")), about)
            case RawImage():
                about = {"kind": "RawImage", **header.describe(thing)}
                return cls(
                    {"data": to_numpy(thing.data)}, {"data": ("y", "x", "c")[: len(thing.data.shape)]}, about
                )
            case Stack():
                about = header.describe_stack(thing)
                return cls(
                    {"data": to_numpy(thing.data)}, {"data": ("n", "y", "x", "c")[: thing.data.ndim]}, about
                )
            case list() | tuple() if thing:
                return cls._of(
                    thing[0] if len(thing) == 1 else Stack(np.stack([to_numpy(one) for one in thing]))
                )
            case Mapping():
                arrays = {str(name): np.asarray(to_numpy(array)) for name, array in thing.items()}
                return cls(arrays, {name: _plain_axes(array.ndim) for name, array in arrays.items()})
            case _ if hasattr(thing, "shape") and len(thing.shape) >= 2:
                data = np.asarray(to_numpy(thing))
                return cls({"data": data}, {"data": _plain_axes(data.ndim)})
        raise FormatError(f"a {type(thing).__name__} cannot be a frame of a series. Give arrays by name.")

    @property
    def layout(self) -> dict[str, Any]:
        """Shape and type of each array, as JSON values."""
        return {name: [list(array.shape), str(array.dtype)] for name, array in self.arrays.items()}


def create(
    path: Path, first: SeriesFrame, count: int, describing: Callable[[dict[str, str]], None] | None = None
) -> None:
    """An empty store for `count` frames like the first one; complete, or not there at all.

    Parameters
    ----------
    path, first, count
        Of the store.
    describing
        Called with the files that describe it, by their names inside, before it takes its place.

    Raises
    ------
    FormatError
        It cannot be written.
    """
    with store.replacing(path) as temporary:
        about = {"lumigraph": header.FORMAT, **first.attributes, "of": first.attributes.get("kind", "arrays")}
        about |= {"kind": KIND, "frames": count, "layout": first.layout}
        group = zarr.create_group(LocalStore(temporary), zarr_format=3, attributes=about)
        for name, array in first.arrays.items():
            inner = tuple(min(n, _SIDE) for n in array.shape[-2:])
            inner = array.shape[:-2] + inner if array.ndim > 1 else array.shape
            shard = tuple(-(-n // m) * m for n, m in zip(array.shape, inner, strict=True))
            group.create_array(
                name, shape=(count, *array.shape), dtype=array.dtype, chunks=(1, *inner), shards=(1, *shard),
                dimension_names=(_leading(first), *first.axes[name]),
                compressors=[ZstdCodec(level=3, checksum=True)],
                fill_value=np.nan if array.dtype.kind == "f" else 0, config={"write_empty_chunks": True},
            )  # fmt: skip
        if describing is not None:
            paths = sorted(one for one in temporary.rglob("*") if one.is_file())
            describing({one.relative_to(temporary).as_posix(): one.read_text() for one in paths})


def write(path: Path, number: int, frame: SeriesFrame) -> Checksums:
    """Write one frame into its shards, each in one step.

    Raises
    ------
    FormatError
        Arrays of other names, shapes or types than the store's, or a full disk.
    """
    known = described(path)["layout"]
    if frame.layout != known:
        raise FormatError(f"it gives {_told(frame.layout)} where the first frame gave {_told(known)}.")
    writer = _SeriesWriter(LocalStore(path))
    group = zarr.open_group(writer, mode="r+", zarr_format=3, use_consolidated=False)
    for name, values in frame.arrays.items():
        array = group[name]
        assert isinstance(array, zarr.Array)
        array[number] = values
    return writer.written


def is_whole(path: Path, files: Mapping[str, tuple[int, int]], *, content: bool = True) -> bool:
    """True if files of a store are there, with the noted size and, if `content`, the noted checksum."""
    for name, (size, checksum) in files.items():
        try:
            if (path / name).stat().st_size != size:
                return False
            if content and zlib.crc32((path / name).read_bytes()) != checksum:
                return False
        except OSError:
            return False
    return True


def count(path: Path) -> int | None:
    """Frames of a series; None where a path holds none."""
    try:
        found = described(path)["frames"]
    except FormatError:
        return None
    return found if isinstance(found, int) and found > 0 else None


def load(path: Path, number: int, max_pixels: int = source.MAX_PIXELS) -> Any:
    """Content of one frame: a picture, several, views, a volume or a depth map.

    Raises
    ------
    FormatError
        No series, no such frame, one that is not there yet, or a damaged one.
    """
    found, frames = described(path), count(path)
    if frames is None or isinstance(number, bool) or not 0 <= number < frames:
        raise FormatError(
            f"page is {number!r} but {path} has {frames} frames. Choose 0 ... {(frames or 1) - 1}."
        )
    group = zarr.open_group(LocalStore(path, read_only=True), mode="r", zarr_format=3, use_consolidated=False)
    read = {str(name): _read(path, group, (str(name), number), max_pixels) for name in found["layout"]}
    match found.get("of"):
        case "Volume":
            data = read[ngff.LEVEL]
            data = np.moveaxis(data, 0, -1) if data.ndim == 4 else data
            return header.restore_planes(data, {**found, "kind": "Volume"})
        case "Stack":
            return header.restore_planes(read["data"], {**found, "kind": "Stack"})
        case "RawImage":
            return header.restore(read["data"], found, None)
        case "LightField":
            grids = header.grid(found.get("aperture")), header.grid(found.get("lenslets"))
            return LightField(read["data"], *grids, found["separation"], read.get("valid"))
        case "DepthMap":
            return DepthMap(read["values"], read["confidence"], found["quantity"], read.get("error"))
    if list(read) == ["data"] and read["data"].ndim in (2, 3):
        return RawImage(read["data"])
    raise FormatError(f"{path} holds arrays named {', '.join(read)}, which are read by zarr alone.")


def _read(path: Path, group: zarr.Group, which: tuple[str, int], max_pixels: int) -> np.ndarray:
    name, number = which
    array = group.get(name)
    if not isinstance(array, zarr.Array) or array.dtype.kind not in "iufb" or array.ndim < 2:
        raise FormatError(f"{path} has no series of numbers named {name[:40]}. Make it again.")
    source.check_size(path, array.shape[1:], max_pixels)
    source.check_size(path, array.chunks, max(max_pixels, 1 << 24))
    file = path / name / "c" / str(number) / "/".join(["0"] * (array.ndim - 1))
    if not file.is_file():
        raise FormatError(f"frame {number} of {path} is not there yet. See 'lumigraph batch status {path}'.")
    zarr_chunks.check_shard(path, file, array)
    return np.asarray(array[number])


def described(path: Path) -> dict[str, Any]:
    """Description of a store: frames, layout, and metadata of all of them.

    Raises
    ------
    FormatError
        It is no series.
    """
    try:
        if (path / "zarr.json").stat().st_size > _DESCRIBED:
            raise ValueError
        found = json.loads((path / "zarr.json").read_text())["attributes"]
        if found["kind"] == KIND:
            return found
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        pass
    raise FormatError(f"{path} is not a series of frames. Check the path.")


def _leading(frame: SeriesFrame) -> str:
    return "t" if "ome" in frame.attributes else "frame"


def _plain_axes(count: int) -> tuple[str, ...]:
    return (*(f"axis_{k}" for k in range(count - 2)), *("y", "x")[-count:]) if count else ()


def _told(layout: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} {' x '.join(map(str, shape))} {dtype}" for name, (shape, dtype) in layout.items()
    )


class _SeriesWriter(WrapperStore[LocalStore]):
    """A store that writes each file in one step and notes its checksum."""

    def __init__(self, inner: LocalStore) -> None:
        super().__init__(inner)
        self.written: Checksums = {}

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Buffer | None:
        """Metadata of arrays; None for parts of a shard, which zarr would keep even if damaged."""
        return await super().get(key, prototype, byte_range) if key.endswith("zarr.json") else None

    async def set(self, key: str, value: Buffer) -> None:
        """Write one file."""
        content, place = value.to_bytes(), Path(self._store.root) / key
        place.parent.mkdir(parents=True, exist_ok=True)
        store.write_bytes(place, content, flush=False)
        self.written[key] = len(content), zlib.crc32(content)
