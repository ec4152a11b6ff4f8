"""Files: `open` reads one, `save` writes one; one format, one file.

- `formats`: `open`, `save` and the table of extensions
- `tiff`: TIFF, 8 and 16 bits or floats, grey or colour; several pages for a stack
- `png`: PNG, 8 and 16 bits grey, 8 bits colour
- `zarr`: Zarr v3 stores, a folder or one `.zarr.zip`, with named axes and coordinates
- `calibration`: a `Calibration` as TOML
- `source`: what is checked before a file is decoded
- `target`: where a result may be written, and atomic writing
- `header`: what lumigraph writes beside the pixels, as JSON
"""

from lumigraph.io.calibration import load_calibration, save_calibration
from lumigraph.io.formats import open, save  # noqa: A004  lumigraph.open is meant to read like the builtin
from lumigraph.io.target import check_target

__all__ = ["check_target", "load_calibration", "open", "save", "save_calibration"]
