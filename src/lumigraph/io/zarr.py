"""Zarr v3 stores, a folder or one `.zarr.zip`: named axes, coordinates with units, exact round trips.

Volumes are OME-Zarr (NGFF 0.5), which microscopy programs open; those by other programs are read too.
"""

import warnings
from collections.abc import Awaitable, Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.abc.buffer import Buffer
from zarr.codecs import ZstdCodec
from zarr.errors import ZarrUserWarning
from zarr.storage import LocalStore, WrapperStore, ZipStore

from lumigraph.core.arrays import to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError, SamplingWarning
from lumigraph.io import header, ngff, series, source, target, zarr_chunks

_SIDE = 1024  # pixels of a chunk along each axis of a raw image
_SIDES = (16, 256, 256)  # voxels of a chunk of a volume
Names = tuple[str, ...]


def count(path: Path) -> int | None:
    """Frames of a series; None of a store that holds one thing."""
    return series.count(path)


def load(
    path: Path, *, page: int | None = None, max_pixels: int = source.MAX_PIXELS
) -> RawImage | LightField | Volume | DepthMap:
    """Content of a Zarr store by lumigraph, or the volume of any OME-Zarr.

    Of a series `page` chooses the frame, which may be a `Stack`, too.

    Raises
    ------
    FormatError
        No Zarr store, one by another program that is no OME-Zarr volume, damaged, or too large.
    """
    path = source.existing(path)
    if path.is_dir() and not (path / "zarr.json").is_file():
        raise FormatError(f"{path} is a folder without zarr.json: no Zarr v3 store. Check the path.")
    if path.is_file():
        source.regular_file(path)
        with path.open("rb") as file:
            source.check_signature(path, file.read(8), "ZIP")
    frames = series.count(path)
    if (frames is None) != (page is None):
        ask = "page= means nothing for a store of one thing. Leave it out."
        ask = ask if frames is None else f"it has {frames} frames. Choose one by page=0 ... {frames - 1}."
        raise FormatError(f"{path}: {ask}")
    with source.decoding(path, "a Zarr v3 store"):
        if page is not None:
            return series.load(path, page, max_pixels)
        zarr_chunks.check_entries(path, 16 * max_pixels)
        with _reading(path) as group:
            return _noun(path, group, max_pixels)


def save(thing: RawImage | LightField | Volume | DepthMap, path: Path) -> None:
    """Write a raw image, a light field, a volume or a depth map.

    Coordinates are in metres, in pixels where a raw image has no pitch. A volume becomes OME-Zarr.
    """
    if isinstance(thing, LightField):
        _save_light_field(thing, path)
    elif isinstance(thing, Volume):
        data, names = ngff.data(to_numpy(thing.data)), ngff.names(thing)
        attributes = {**header.describe_volume(thing), "ome": ngff.describe(thing)}
        arrays = [(str(k), one, _chunks(one.shape), names, {}) for k, one in enumerate(ngff.pyramid(data))]
        _write(path, arrays, attributes)
    elif isinstance(thing, DepthMap):
        _save_depth(thing, path)
    else:
        _save_raw(thing, path)


def _chunks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Sides of the chunks of a level ([c, ]z, y, x)."""
    return (1,) * (len(shape) - 3) + tuple(min(n, side) for n, side in zip(shape[-3:], _SIDES, strict=True))


def _save_raw(raw: RawImage, path: Path) -> None:
    data = to_numpy(raw.data)
    pitch, unit = (raw.pixel_pitch, "m") if raw.pixel_pitch else (1.0, "px")
    names = ("y", "x", "c")[: data.ndim]
    along = {name: np.arange(n) * pitch for name, n in zip("yx", data.shape, strict=False)}
    chunks = tuple(min(n, _SIDE) for n in data.shape[:2]) + data.shape[2:]
    axes = {"axes": _axes(names, "meter" if raw.pixel_pitch else "pixel")}
    arrays = [("data", data, chunks, names, axes), *_coordinates(along, unit)]
    _write(path, arrays, {"kind": "RawImage", **header.describe(raw)})


def _save_light_field(views: LightField, path: Path) -> None:
    data = to_numpy(views.data)
    names = ("v", "u", "t", "s", "c")[: data.ndim]
    along = {"v": views.aperture.y, "u": views.aperture.x, "t": views.lenslets.y, "s": views.lenslets.x}
    chunks, axes = (1, *data.shape[1:]), {"axes": _axes(names, "meter")}
    arrays = [("data", data, chunks, names, axes), *_coordinates(along, "m")]
    if views.valid is not None:
        arrays.append(("valid", to_numpy(views.valid), (1, *data.shape[1:4]), names[:4], {}))
    _write(path, arrays, header.describe_views(views))


def _save_depth(found: DepthMap, path: Path) -> None:
    frame, units = series.SeriesFrame.of(found), {"confidence": "1"}
    chunks = tuple(min(n, _SIDE) for n in found.shape)
    arrays = [
        (name, array, chunks, frame.axes[name], {"units": units.get(name, found.unit)})
        for name, array in frame.arrays.items()
    ]
    _write(path, arrays, {"lumigraph": header.FORMAT, **frame.attributes})


def _axes(names: Names, unit: str) -> list[dict[str, str]]:
    """The axes as OME-Zarr describes them: a name, a type, a unit."""
    return [
        {"name": name, "type": "channel"} if name == "c" else {"name": name, "type": "space", "unit": unit}
        for name in names
    ]


def _coordinates(along: dict[str, np.ndarray], unit: str) -> list[tuple[Any, ...]]:
    return [(name, values, values.shape, (name,), {"units": unit}) for name, values in along.items()]


def _write(path: Path, arrays: list[tuple[Any, ...]], attributes: dict[str, Any]) -> None:
    for _, data, *_ in arrays:
        if data.dtype.kind not in "iufbc":
            raise FormatError(f"a Zarr store cannot hold {data.dtype} here. Save numbers.")
    zipped = path.suffix == ".zip"
    with target.replacing(path) as temporary, _writing(temporary, zipped) as store:
        group = zarr.create_group(store, zarr_format=3, attributes=attributes)
        for array in arrays:
            if store.failure is None:
                _add(group, array)
        if not zipped and store.failure is None:  # a ZIP would keep the group's description twice
            _consolidate(store)


def _consolidate(store: "_ZarrWriter") -> None:
    """Describe all arrays in the group's own file, so that programs open the store by one request."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Consolidated metadata", ZarrUserWarning)
        zarr.consolidate_metadata(store, zarr_format=3)


def _add(group: zarr.Group, what: tuple[Any, ...]) -> None:
    # A checksum, and chunks of zeros written out: a damaged or missing chunk is an error, not zeros.
    name, values, chunks, names, more = what
    array = group.create_array(
        name, shape=values.shape, dtype=values.dtype, chunks=chunks, dimension_names=names,
        attributes=more, compressors=[ZstdCodec(level=3, checksum=True)],
        config={"write_empty_chunks": True},
    )  # fmt: skip
    array[...] = values


def _noun(path: Path, group: zarr.Group, max_pixels: int) -> RawImage | LightField | Volume | DepthMap:
    found: dict[str, Any] = dict(group.attrs)
    if "lumigraph" not in found:
        if "ome" not in found:
            raise FormatError(
                f"{path} was not written by lumigraph and is not OME-Zarr 0.5. Only those stores are read."
            )
        name, axes, scales = _finest(path, group, found["ome"], max_pixels)
        return ngff.volume(_values(path, group, name, max_pixels), axes, scales)
    if found.get("kind") == "Volume":
        if "ome" in found and (level := _finest(path, group, found["ome"], max_pixels))[0] != ngff.LEVEL:
            coarse = ngff.volume(_values(path, group, level[0], max_pixels), *level[1:])
            return replace(coarse, depths=tuple(found["depths"]))  # which need not be evenly spaced
        values = _values(path, group, ngff.LEVEL, max_pixels)
        restored = header.restore_planes(np.moveaxis(values, 0, -1) if values.ndim == 4 else values, found)
        assert isinstance(restored, Volume)  # restore_planes goes by the kind
        return restored
    if found.get("kind") == "DepthMap":
        values, trust = (_values(path, group, name, max_pixels) for name in ("values", "confidence"))
        error = _values(path, group, "error", max_pixels) if "error" in group else None
        return DepthMap(values, trust, found["quantity"], error)
    data = _values(path, group, "data", max_pixels)
    if found.get("kind") == "LightField":
        aperture, lenslets = header.grid(found.get("aperture")), header.grid(found.get("lenslets"))
        mask = _values(path, group, "valid", max_pixels).astype(bool) if "valid" in group else None
        return LightField(data, aperture, lenslets, found["separation"], mask)
    if found.get("kind") == "RawImage":
        return header.restore(data, found, None)
    raise FormatError(f"{path} holds a {found.get('kind')!r}, which this lumigraph does not know.")


def _finest(path: Path, group: zarr.Group, ome: Any, max_pixels: int) -> ngff.Level:
    """The finest level of an image that may be read; the finest of all if none may.

    Warns
    -----
    SamplingWarning
        It is a coarser one.
    """
    found = ngff.levels(ome)
    for level in found:
        array = group.get(level[0])
        if isinstance(array, zarr.Array) and source.pixels(array.shape) <= max_pixels:
            if level is not found[0]:
                warnings.warn(
                    f"{path} holds more pixels than the {max_pixels:.3g} that are read: level {level[0]} of "
                    f"{len(found)} is opened, {' x '.join(map(str, array.shape))}. Call lumigraph.io.open "
                    "with max_pixels= for a finer one.",
                    SamplingWarning,
                    stacklevel=2,
                )
            return level
    return found[0]


def _values(path: Path, group: zarr.Group, name: str, max_pixels: int) -> np.ndarray:
    array = group.get(name)
    if not isinstance(array, zarr.Array):
        raise FormatError(f"{path} has no array named {name}. Save it again.")
    source.check_size(path, array.shape, max_pixels)
    source.check_size(path, array.chunks, max(max_pixels, 1 << 24))
    if array.dtype.kind not in "biufc":
        raise FormatError(f"{path} holds {array.dtype}, no numbers. Save it again.")
    needed = prod(array.shape) * array.dtype.itemsize
    source.check_held(path, needed, zarr_chunks.check_chunks(path, array, name), max_pixels)
    if array.nchunks_initialized != array.nchunks:
        raise FormatError(
            f"{path} is incomplete: {array.nchunks_initialized} of {array.nchunks} chunks are there. Copy it."
        )
    return np.asarray(array[...])


@contextmanager
def _reading(path: Path) -> Iterator[zarr.Group]:
    store = LocalStore(path, read_only=True) if path.is_dir() else ZipStore(path, mode="r", read_only=True)
    try:
        yield zarr.open_group(store, mode="r", zarr_format=3, use_consolidated=False)
    finally:
        store.close()


class _ZarrWriter(WrapperStore[LocalStore | ZipStore]):
    """Store that hides its failures from zarr, whose other chunks' tasks would complain later."""

    failure: OSError | None = None

    async def set(self, key: str, value: Buffer) -> None:
        """Write one file."""
        await self._remember(super().set, key, value)

    async def set_if_not_exists(self, key: str, value: Buffer) -> None:
        """Write one file if there is none."""
        await self._remember(super().set_if_not_exists, key, value)

    async def _remember(self, write: Callable[[str, Buffer], Awaitable[None]], *what: Any) -> None:
        """Write, or remember why that failed; after that nothing is written."""
        if self.failure is None:
            try:
                await write(*what)
            except OSError as error:
                self.failure = error


@contextmanager
def _writing(path: Path, zipped: bool) -> Iterator[_ZarrWriter]:
    store = _ZarrWriter(ZipStore(path, mode="w") if zipped else LocalStore(path))
    try:
        with closing(store):
            yield store
    finally:
        if store.failure is not None:  # what went wrong later followed from it
            raise store.failure
