"""Files: `open` reads one, `save` writes one; one format, one file.

- `formats`: `open`, `save`, `contents` and the table of formats
- `tiff`, `tiff_pixels`, `ome`: TIFF of any bit depth; OME-TIFF for stacks and volumes
- `png`: PNG, 1 to 16 bits; `jpeg`: photos, read only
- `zarr`, `zarr_chunks`, `ngff`: Zarr v3 stores, a folder or one `.zarr.zip`; OME-Zarr for volumes
- `series`: results of one shape as one Zarr v3 store, a shard for each, written one by one
- `hdf5`: HDF5, our own, Heidelberg light fields, arrays by others
- `lytro`, `lytro_metadata`, `bits`: Lytro containers, packed raw frames, what the camera recorded
- `views`, `eslf`, `cameras`: folders of views, ESLF mosaics; which camera is which view
- `pfm`, `ply`: maps of floats; clouds of points
- `movie`: GIF and MP4
- `calibration`, `raytrix`, `plenoptomos`: a `Calibration` as TOML; calibrations by others
- `source`: what is checked before a file is decoded
- `target`: where a result may be written, and atomic writing
- `header`: what lumigraph writes beside the pixels, as JSON
"""

from lumigraph.io.calibration import load_calibration
from lumigraph.io.formats import FORMATS, contents, open, opens_pages, pages, save  # noqa: A004
from lumigraph.io.target import check_target

__all__ = [
    "FORMATS",
    "check_target",
    "contents",
    "load_calibration",
    "open",
    "opens_pages",
    "pages",
    "save",
]


def __dir__() -> list[str]:
    return __all__
