"""Arrays on disk: written whole or not at all, and never read damaged.

- `cabinet`: arrays kept between runs under a key, in the user's cache folder or another; a budget in bytes
- `sealed`: one file of arrays with a checksum over every byte, read as memory maps
- `notes`: one JSON value in a file, with such a checksum
- `atomic`: writing a file or a folder in one step; what killed writers left is removed at the next one

A kill at any moment leaves the old content or the new. What is read back is compared with its checksum
first. Arrays come back with the values, the type and the memory layout (C or Fortran order) in which they
were given, so that a computation gives the same bits whether they were built a moment ago or read.
"""

from lumigraph.store.array_cache import LIMIT, folder, kept
from lumigraph.store.atomic import replacing, restored, sweep, write_bytes
from lumigraph.store.notes import read_note, write_note
from lumigraph.store.sealed import DamagedError, read, write

__all__ = [
    "LIMIT",
    "DamagedError",
    "folder",
    "kept",
    "read",
    "read_note",
    "replacing",
    "restored",
    "sweep",
    "write",
    "write_bytes",
    "write_note",
]
