"""Checks of requests, and the headers of every answer."""

import hmac
from collections.abc import Iterable, Mapping

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy of served pages: nothing inline, nothing from elsewhere."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
"""Sent with every answer, refusals too."""

LARGEST_CALL = 64 * 1024
"""Bytes that the body of a call may have."""


def hosts(port: int) -> frozenset[str]:
    """Values of the Host header under which the server answers: any other name points here by a trick."""
    return frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]"))


def refusal(headers: Iterable[tuple[bytes, bytes]], known: frozenset[str]) -> str | None:
    """Reason to refuse a request before its path is looked at; None where there is none.

    Parameters
    ----------
    headers
        As ASGI gives them: names in small letters.
    known
        Hosts under which the server answers; empty answers under every name.
    """
    found: dict[str, list[str]] = {}
    for name, value in headers:
        found.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1").lower())
    if known and (len(found.get("host", [])) != 1 or found["host"][0] not in known):
        return "foreign host"
    allowed = {f"http://{host}" for host in (known or found.get("host", []))}
    if any(origin not in allowed for origin in found.get("origin", [])):
        return "foreign origin"
    return None


def body_size(headers: Mapping[str, str]) -> int | None:
    """Bytes of the body that a request announces, 0 without one; None where it does not say or is wrong."""
    if "transfer-encoding" in headers:
        return None
    text = headers.get("content-length", "0")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 12 else None


def inside(path: str, token: str) -> str | None:
    """Rest of a path after `/token/`; None where the token is missing or wrong."""
    first, slash, rest = path.removeprefix("/").partition("/")
    right = hmac.compare_digest(first.encode("utf-8", "replace"), token.encode())
    return rest if right and slash and path.startswith("/") else None
