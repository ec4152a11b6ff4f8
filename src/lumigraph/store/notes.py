"""One JSON value in a file of its own with a checksum over every byte, written in one step.

The file is JSON itself: ``{"sealed": "9bd3a0f1", "note": ...}``. The digits are the CRC-32 of the note.
"""

import json
import os
import re
import stat
import zlib
from typing import Any

from lumigraph.store.atomic import write_bytes
from lumigraph.store.sealed import DamagedError

_HEAD = re.compile(rb'\{"sealed": "([0-9a-f]{8})", "note": ')
_END = b"}\n"

LARGEST = 1 << 26
"""Bytes of a note that are read at most."""


def write_note(path: str | os.PathLike[str], value: Any, *, flush: bool = True) -> None:
    """Write what JSON can hold, atomically; `flush` as of `write_bytes`.

    Raises
    ------
    FormatError
        The disk is full or may not be written to.
    """
    content = json.dumps(value).encode()
    write_bytes(path, b'{"sealed": "%08x", "note": %b%b' % (zlib.crc32(content), content, _END), flush=flush)


def read_note(path: str | os.PathLike[str]) -> Any:
    """The value of a note, compared with its checksum first.

    Raises
    ------
    DamagedError
        No file, too large, not sealed, or a bit has changed.
    OSError
        There is none, or it may not be read.
    """
    with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
        about = os.fstat(file.fileno())  # a pipe or a device would keep its reader waiting
        if not stat.S_ISREG(about.st_mode) or about.st_size > LARGEST:
            raise DamagedError(f"{path} is no file of at most {LARGEST >> 20} MiB. Remove it.")
        whole = file.read(LARGEST + 1)
    head = _HEAD.match(whole)
    note = whole[head.end() : -len(_END)] if head else b""
    if head is None or not whole.endswith(_END) or int(head[1], 16) != zlib.crc32(note):
        raise DamagedError(f"{path} is damaged: its checksum does not match. Remove it.")
    try:
        return json.loads(note)
    except (ValueError, RecursionError) as error:  # a checksum is no proof that `write_note` wrote it
        raise DamagedError(f"{path} is damaged ({type(error).__name__}). Remove it.") from None
