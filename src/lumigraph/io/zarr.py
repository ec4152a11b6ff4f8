"""Zarr v3 stores, a folder or one `.zarr.zip`: named axes, coordinates with units, exact round trips."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.codecs import ZstdCodec
from zarr.storage import LocalStore, ZipStore

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import header, source, target

_SIDE = 1024  # pixels of a chunk along each axis of a raw image


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> RawImage | LightField:
    """The raw image or the light field in a Zarr store that lumigraph wrote.

    Raises
    ------
    FormatError
        No Zarr store, one by another program, damaged, or too large.
    """
    path = source.existing(path)
    if path.is_dir() and not (path / "zarr.json").is_file():
        raise FormatError(f"{path} is a folder without zarr.json: no Zarr v3 store. Check the path.")
    if path.is_file():
        source.regular_file(path)
        with path.open("rb") as file:
            source.check_signature(path, file.read(8), "ZIP")
    with source.decoding(path, "a Zarr v3 store"), _reading(path) as group:
        found: dict[str, Any] = dict(group.attrs)
        if "lumigraph" not in found:
            raise FormatError(f"{path} was not written by lumigraph. Only its own stores are read.")
        data = _values(path, group, max_pixels)
        if found.get("kind") == "LightField":
            return LightField(data, _grid(found["aperture"]), _grid(found["lenslets"]), found["separation"])
        if found.get("kind") == "RawImage":
            return header.restore(data, found, None)
        raise FormatError(f"{path} holds a {found.get('kind')!r}, which this lumigraph does not know.")


def save_raw(raw: RawImage, path: Path) -> None:
    """Write a raw image, with coordinates from the first pixel in metres where the pitch is known."""
    data = to_numpy(raw.data)
    pitch, unit = (raw.pixel_pitch, "m") if raw.pixel_pitch else (1.0, "px")
    coordinates = {name: np.arange(n) * pitch for name, n in zip("yx", data.shape, strict=False)}
    attributes = {"kind": "RawImage", **header.describe(raw)}
    chunks = tuple(min(n, _SIDE) for n in data.shape[:2]) + data.shape[2:]
    _write(path, data, chunks, ("y", "x", "c")[: data.ndim], coordinates, unit, attributes)


def save_light_field(views: LightField, path: Path) -> None:
    """Write a light field, with the coordinates of its four axes in metres."""
    data = to_numpy(views.data)
    attributes = {
        "lumigraph": header.FORMAT,
        "kind": "LightField",
        "aperture": _plain(views.aperture),
        "lenslets": _plain(views.lenslets),
        "separation": float(views.separation),
    }
    coordinates = {"v": views.aperture.y, "u": views.aperture.x, "t": views.lenslets.y, "s": views.lenslets.x}
    chunks = (1, *data.shape[1:])
    _write(path, data, chunks, ("v", "u", "t", "s", "c")[: data.ndim], coordinates, "m", attributes)


def _write(
    path: Path, data: np.ndarray, chunks: tuple[int, ...], names: tuple[str, ...],
    coordinates: dict[str, np.ndarray], unit: str, attributes: dict[str, Any],
) -> None:  # fmt: skip
    if data.dtype.kind not in "iufbc":
        raise FormatError(f"a Zarr store cannot hold {data.dtype} here. Save numbers.")
    with target.replacing(path) as temporary, _writing(temporary, path.suffix == ".zip") as store:
        group = zarr.create_group(store, zarr_format=3, attributes=attributes)
        _add(group, "data", data, chunks, names, {})
        for name, values in coordinates.items():
            _add(group, name, values, values.shape, (name,), {"units": unit})


def _add(
    group: zarr.Group, name: str, values: np.ndarray, chunks: tuple[int, ...], names: tuple[str, ...],
    attributes: dict[str, Any],
) -> None:  # fmt: skip
    # A checksum, and chunks of zeros written out: a damaged or missing chunk is an error, not zeros.
    array = group.create_array(
        name, shape=values.shape, dtype=values.dtype, chunks=chunks, dimension_names=names,
        attributes=attributes, compressors=[ZstdCodec(level=3, checksum=True)],
        config={"write_empty_chunks": True},
    )  # fmt: skip
    array[...] = values


def _values(path: Path, group: zarr.Group, max_pixels: int) -> np.ndarray:
    array = group["data"]
    if not isinstance(array, zarr.Array):
        raise FormatError(f"{path} has no array named data. Save it again.")
    source.check_size(path, array.shape, max_pixels)
    source.check_size(path, array.chunks, max(max_pixels, 1 << 24))
    if array.nchunks_initialized != array.nchunks:
        raise FormatError(
            f"{path} is incomplete: {array.nchunks_initialized} of {array.nchunks} chunks are there. Copy it."
        )
    return np.asarray(array[...])


@contextmanager
def _reading(path: Path) -> Iterator[zarr.Group]:
    store = LocalStore(path, read_only=True) if path.is_dir() else ZipStore(path, mode="r", read_only=True)
    try:
        yield zarr.open_group(store, mode="r", zarr_format=3)
    finally:
        store.close()


@contextmanager
def _writing(path: Path, zipped: bool) -> Iterator[LocalStore | ZipStore]:
    store = ZipStore(path, mode="w") if zipped else LocalStore(path)
    try:
        yield store
    finally:
        store.close()


def _plain(grid: Grid) -> dict[str, list[float]]:
    return {"shape": list(grid.shape), "pitch": list(grid.pitch), "center": list(grid.center)}


def _grid(fields: dict[str, Any]) -> Grid:
    return Grid(tuple(fields["shape"]), tuple(fields["pitch"]), tuple(fields["center"]))
