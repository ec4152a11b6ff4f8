"""Long lists of numbers as text: `listed`, many times as fast as Python writes them."""

import numpy as np

DECIMALS = 6
"""After the point, of numbers that are written fast; others are written with all their digits."""

_LARGEST = 1e9  # whose digits a whole number of 64 bits holds


def listed(values: np.ndarray) -> str:
    """Numbers (k,) or rows of them (k, n) as TOML and JSON write lists, which read back exactly.

    Examples
    --------
    >>> listed(np.array([1.5, -0.25])), listed(np.array([1 / 3]))
    ('[1.500000, -0.250000]', '[0.3333333333333333]')
    >>> print(listed(np.array([[1, 20], [-3, 4]])))
    [
      [1, 20],
      [-3, 4],
    ]
    """
    if not len(values):
        return "[]"
    if (found := _whole(values)) is None:
        return _by_python(values)
    rows = found[0].reshape(len(values), -1)
    columns = [_digits(column, found[1]) for column in rows.T]
    before, after = (b"\n  [", b"],") if values.ndim == 2 else (b"", b", ")
    parts = [_repeated(before, len(rows))]
    for column in columns:
        parts += [column, _repeated(b", ", len(rows))]
    text = np.concatenate([*parts[:-1], _repeated(after, len(rows))]).T.tobytes().translate(None, b"\0")
    return f"[{text.decode()}\n]" if values.ndim == 2 else f"[{text[:-2].decode()}]"


def _by_python(values: np.ndarray) -> str:
    if values.ndim == 1:
        return repr(values.tolist())
    return "[" + "".join(f"\n  {row!r}," for row in values.tolist()) + "\n]"


def _whole(values: np.ndarray) -> tuple[np.ndarray, int] | None:
    """Whole numbers, and how many of their digits stand after the point; None where there are more digits."""
    if values.dtype.kind in "iu":
        return values.astype(np.int64), 0
    if not (np.abs(values) < _LARGEST).all():
        return None
    scaled = np.rint(values * 10.0**DECIMALS)
    return (scaled.astype(np.int64), DECIMALS) if (scaled / 10.0**DECIMALS == values).all() else None


def _digits(values: np.ndarray, decimals: int) -> np.ndarray:
    """Characters (n, k) of whole numbers (k,) with a point before the last of them; 0 for none."""
    rest = np.abs(values)
    count = max(len(str(int(rest.max()))), decimals + 1)
    rows = [np.where(values < 0, ord("-"), 0).astype(np.uint8)[None]]
    found = []
    for place in range(count):
        higher = rest // 10
        digit = (rest - 10 * higher + ord("0")).astype(np.uint8)
        found.append(np.where(rest > 0, digit, 0).astype(np.uint8)[None] if place > decimals else digit[None])
        rest = higher
        if place + 1 == decimals:
            found.append(_repeated(b".", len(values)))
    return np.concatenate(rows + found[::-1])


def _repeated(text: bytes, count: int) -> np.ndarray:
    return np.repeat(np.frombuffer(text, np.uint8)[:, None], count, 1)
