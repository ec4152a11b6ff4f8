"""Text that a terminal only shows: what would move its cursor, change colours or turn lines is escaped."""

import re

_CONTROLS = (
    "\x00-\x1f\x7f-\x9f"  # a terminal's own, among them ESC
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # turn the direction of writing
    "\u2028\u2029"  # end lines
    "\ud800-\udfff"  # bytes of a name that are no text
)
_ANY = re.compile(f"[{_CONTROLS}]")
_OF_JSON = re.compile(f"[{_CONTROLS.replace(chr(0) + '-' + chr(0x1F), '')}]")


def printable(text: object) -> str:
    r"""Text on one line, its control characters written as in Python.

    Names of files, what a ledger says and what files say of themselves come from anywhere.

    Examples
    --------
    >>> print(printable("a\x1b[2Jb\n\u202eé"))
    a\x1b[2Jb\n\u202eé
    """
    return _ANY.sub(lambda found: found[0].encode("unicode_escape").decode(), str(text))


def printable_lines(text: str) -> str:
    """As `printable`, of a text that has lines of its own."""
    return "\n".join(map(printable, text.split("\n")))


def printable_json(text: str) -> str:
    r"""JSON whose control characters are escaped as JSON does it; it holds the same values.

    Examples
    --------
    >>> print(printable_json('{"a": "\x9b2J"}'))
    {"a": "\u009b2J"}
    """
    return _OF_JSON.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def has_controls(text: str) -> bool:
    """Whether a text has characters that `printable` escapes."""
    return _ANY.search(text) is not None
