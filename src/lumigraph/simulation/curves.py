"""Spectra and filters that are known as curves, by few wavelengths: Gauss's nodes of their light."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import FormatError, GeometryError, SamplingError
from lumigraph.io import tables

MOST = 40
"""Wavelengths that are tried."""

_SHORTEST, _LONGEST = 1e-10, 1e-2
"""Wavelengths of X-rays and microwaves [m]: no curve of a filter goes beyond."""

FINE = 4000
"""Places on a curve, beside its own, that stand for all of it."""

CHANNELS = (("response",), ("red", "green", "blue"))
"""Columns of a file, beside the wavelength and the light."""

_TITLE = re.compile(r"\s*wavelength\s*\[\s*(nm|um|µm|m)\s*\]\s*")
_METRES = {"nm": 1e-9, "um": 1e-6, "µm": 1e-6, "m": 1.0}


def read(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Wavelengths (n,) [m], responses (n, channels) and light (n,) of a CSV file; see `Spectrum.load`."""
    titles, rows = tables.read(path, "wavelength [nm], light, red, green, blue")
    names, unit = [title.strip() for title in titles], _TITLE.fullmatch(titles[0])
    channels = tuple(name for name in names[1:] if name != "light")
    if unit is None or channels not in CHANNELS or len(set(names)) != len(names):
        raise FormatError(
            f"{str(path)!r} has columns {', '.join(names)}. Name them 'wavelength [nm]', then 'response' or "
            "'red', 'green' and 'blue', and 'light' where that is not even."
        )
    columns = dict(zip(names, np.array(rows).T, strict=True))
    responses = np.stack([columns[name] for name in channels], axis=1)
    return columns[names[0]] * _METRES[unit[1]], responses, columns.get("light")


def checked(
    wavelengths: Sequence[float] | np.ndarray, responses: Any, light: Sequence[float] | np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (n,) [m], and light times response (n, channels), the largest of each channel 1.

    Raises
    ------
    GeometryError
        Other lengths, wavelengths that do not rise or that no light has, values below 0, or a dark channel.
    """
    at, values = np.asarray(wavelengths, np.float64), np.asarray(responses, np.float64)
    values = values[:, None] if values.ndim == 1 else values
    lit = np.ones(at.shape) if light is None else np.asarray(light, np.float64)
    fit = lit.shape == at.shape and values.shape in ((len(at), 1), (len(at), 3))
    if not fit or at.ndim != 1 or len(at) < 2:
        raise GeometryError(
            f"wavelengths have shape {at.shape}, responses {values.shape}, the light {lit.shape}. Give two "
            "wavelengths at least, and for each of them 1 or 3 responses and, if any, a light."
        )
    if not (np.isfinite(at).all() and at[0] > 0 and (np.diff(at) > 0).all()):
        raise GeometryError("the curves' wavelengths must be finite, above 0 m, and rise.")
    if not _SHORTEST <= at[0] < at[-1] <= _LONGEST:
        raise GeometryError(
            f"the curves' wavelengths are {at[0]:.3g} to {at[-1]:.3g} m but must lie from {_SHORTEST:g} to "
            f"{_LONGEST:g} m. Check the unit."
        )
    values = _normalised(values) * _normalised(lit[:, None])  # at any scale their product is no overflow
    return at, _normalised(values)


def _normalised(values: np.ndarray) -> np.ndarray:
    """Columns (n, channels) over the largest value of each.

    Raises
    ------
    GeometryError
        Values that are not finite or below 0, or nothing above 0.
    """
    if not np.isfinite(values).all() or values.min() < 0 or values.max(0).min() <= 0:
        raise GeometryError("curves must be finite, at least 0, and above 0 somewhere in each channel.")
    return values / values.max(0)


def few(
    wavelengths: np.ndarray, light: np.ndarray, path_difference: float, accuracy: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Wavelengths [m], weights of sum 1, and by how much coherence is off, of light (n,) at wavelengths (n,).

    Raises
    ------
    GeometryError
        An accuracy that is not between 0 and 1.
    SamplingError
        More than 40 wavelengths.
    """
    longest = abs(checks.finite("path_difference", path_difference))
    if not 0 < checks.finite("accuracy", accuracy, "1") < 1:
        raise GeometryError(f"accuracy is {accuracy:g} but must lie between 0 and 1.")
    at = np.union1d(np.linspace(wavelengths[0], wavelengths[-1], FINE), wavelengths)
    steps = np.diff(at)
    share = np.interp(at, wavelengths, light) * (np.append(steps, 0) + np.append(0, steps))
    share /= share.sum()
    turns = longest * (1 / at[0] - 1 / at[-1])
    ways, off = np.linspace(0, longest, 101 + int(min(8 * turns, 1e4))), np.inf
    exact = np.array([np.exp(2j * np.pi * way / at) @ share for way in ways])
    for count in range(1, MOST + 1):
        nodes, weights = gauss(at, share, count)
        off = float(np.abs(np.exp(2j * np.pi * np.outer(ways, 1 / nodes)) @ weights - exact).max())
        if off <= accuracy:
            return nodes, weights, off
    raise SamplingError(
        f"path_difference is {longest * 1e6:.4g} µm, over which {MOST} wavelengths leave {off:.2g} of a "
        f"channel's coherence, not {accuracy:g}. Ask for less of either."
    )


def gauss(at: np.ndarray, share: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss's nodes and weights, of sum 1, for shares (n,) of sum 1 at places (n,): Stieltjes' recurrence.

    Examples
    --------
    >>> nodes, weights = gauss(np.linspace(-1, 1, 4001), np.full(4001, 1 / 4001), 2)
    >>> nodes.round(3), weights.round(3)
    (array([-0.577,  0.577]), array([0.5, 0.5]))
    """
    middle, half = at.mean(), np.ptp(at) / 2
    x, before, last = (at - middle) / half, np.zeros(len(at)), np.ones(len(at))
    diagonal, beside = [], [0.0]
    for _ in range(count):
        diagonal.append(float(share @ (x * last**2)))
        following = (x - diagonal[-1]) * last - beside[-1] * before
        beside.append(float(np.sqrt(share @ following**2)))
        before, last = last, following / max(beside[-1], 1e-300)
    matrix = np.diag(diagonal) + np.diag(beside[1:count], 1) + np.diag(beside[1:count], -1)
    nodes, vectors = np.linalg.eigh(matrix)
    return middle + half * nodes, vectors[0] ** 2
