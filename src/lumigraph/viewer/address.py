"""The same address for the same file, so that links copied from a page open it again the next time."""

import base64
import hmac
import os
import secrets
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from lumigraph import store

_SECRET = 32  # bytes
_FIRST_PORT, _PORTS = 49152, 16384  # those that no service is registered for


@dataclass(frozen=True, slots=True)
class Address:
    """Address of a page: token and port.

    Parameters
    ----------
    token
        First part of every path, which only the holder of the secret can derive.
    port
        Tried first; any free one where it is taken.
    """

    token: str
    port: int


def address_of(paths: Sequence[Path], folder: Path | None = None) -> Address | None:
    """The address of these files on this computer for this user; None where no secret can be kept.

    Parameters
    ----------
    paths
        What the page shows.
    folder
        Where the secret lies; the user's cache folder if left out.
    """
    secret = _secret(folder or store.folder())
    if secret is None:
        return None
    names = b"\0".join(os.fsencode(path.absolute()) for path in paths)
    digest = hmac.digest(secret, names, "sha256")
    token = base64.urlsafe_b64encode(digest[:24]).decode()
    return Address(token, _FIRST_PORT + int.from_bytes(digest[24:28], "big") % _PORTS)


def _secret(folder: Path | None) -> bytes | None:
    """Random bytes of the user, created on first use; None where others could read them."""
    if folder is None:
        return None
    path = folder / "viewer.key"
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        with suppress(FileExistsError):
            made = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(made, "wb") as file:
                file.write(secrets.token_bytes(_SECRET))
        about = path.lstat()
        private = os.name == "nt" or (about.st_uid == os.getuid() and not about.st_mode & 0o077)
        found = path.read_bytes() if private and path.is_file() and not path.is_symlink() else b""
        return found if len(found) == _SECRET else None
    return None
