"""Doubts about a propagation's result: light that left the window, samples or angles beyond a method.

Rows and columns through the bright parts of a field stand for all of it.
"""

import math

import numpy as np

from lumigraph.core.arrays import Array, namespace, to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid

LEFT = 1e-2
"""Part of the light that may leave the window without a word."""

LARGEST_ERROR = 1e-2
"""Relative rms error by the Fresnel approximation that is let pass."""

NEARLY_HALF_A_TURN = 0.9
"""Of half a turn from sample to sample: waves that turn faster may as well turn the other way."""

SMOOTH = 0.15
"""Of half a turn: third differences of a smooth wave's phase. Of random phases 15 % are as small."""

UNDERSAMPLED = 0.05
"""Part of the light that may turn so fast; of a lens that is sampled too coarsely it is 10 % and more, of
random phases, whose samples are points, 1.5 %."""

FEWEST_SAMPLES = 16
"""Along an axis, to say anything about it."""

_LINES, _PLANES, _BINS = 48, 4, 65


def light_left(field: Field, power: Array, distance: float) -> str | None:
    """Warning where light has left the field's own window, else None; `power` (...) is what arrived in it."""
    before, after = (float(to_numpy(one).sum(dtype=np.float64)) for one in (field.power, power))
    if not before > 0 or not (lost := 1 - after / before) > LEFT:
        return None
    size = " x ".join(f"{1e3 * width:.4g}" for width in field.grid.size)
    return (
        f"{100 * lost:.3g} % of the light left the window of {size} mm over {abs(distance):.4g} m. "
        "Give grid= where it goes, or the field on a larger window; with grid=field.grid the rest is not "
        "missed."
    )


def undersampled(field: Field) -> str | None:
    """Warning where a smooth wave turns by nearly half a turn from sample to sample, or more; else None."""
    for axis, name in ((0, "y"), (1, "x")):
        if field.grid.shape[axis] < FEWEST_SAMPLES:
            continue
        steps = np.conj(lines := _lines(field, axis))[..., :-1] * lines[..., 1:]
        share = _turning_fast(steps)
        if share > UNDERSAMPLED:
            return (
                f"the field is sampled too coarsely along {name}: {100 * share:.3g} % of its light turns by "
                f"{NEARLY_HALF_A_TURN:g} of half a turn or more from sample to sample, "
                f"{field.grid.pitch[axis]:.4g} m apart, and what turns faster looks as if it turned the "
                "other way. Use a finer pitch."
            )
    return None


def _turning_fast(steps: np.ndarray) -> float:
    """Part of the light of products of neighbours (lines, n) that turns fast and smoothly."""
    one, two, three = steps[..., :-2], steps[..., 1:-1], steps[..., 2:]
    bend = three * np.conj(two) ** 2 * one
    fast = np.abs(np.angle(two)) > NEARLY_HALF_A_TURN * math.pi
    smooth = np.abs(np.angle(bend)) < SMOOTH * math.pi
    weights = np.abs(two)
    return float((weights * (fast & smooth)).sum() / (weights.sum() or 1.0))


def beyond_paraxial(method: str, field: Field, distance: float, output: Grid | None) -> str | None:
    r"""Warning where the Fresnel approximation turns the light that reaches the output too far; else None.

    A wave of frequency f moves by r = λ z f and turns by

    .. math:: \varphi = \frac{2\pi}{\lambda} \frac{r^4}{8 z^3}

    less than it lets it (Goodman, section 4.2.1); a turn that all waves have in common does not matter. With
    P the power of waves, :math:`e^2 = 2 (1 - |\sum P e^{i\varphi}|)`.

    Parameters
    ----------
    method
        Its name.
    field, distance
        The input, and the distance [m].
    output
        Output grid; None for one that all of the light reaches.
    """
    found = [_spectrum(field, axis, distance, output) for axis in (0, 1)]
    (fy, py), (fx, px) = found
    if not py.sum() * px.sum() > 0:
        return None
    squares = (field.wavelength**2 * (fy[:, None] ** 2 + fx**2)) ** 2
    phase = math.pi * abs(distance) / (4 * field.wavelength) * squares
    power = py[:, None] * px
    error = math.sqrt(max(0.0, 2 - 2 * abs((power * np.exp(1j * phase)).sum()) / power.sum()))
    if error <= LARGEST_ERROR:
        return None
    bright = phase[power > 1e-3 * power.max()].max()
    return (
        f"{method} over {abs(distance):.4g} m goes beyond the Fresnel approximation: k r⁴/(8 z³) is "
        f"{bright:.2g} rad at the edge of the light's spectrum, which makes some {100 * error:.2g} % rms of "
        'the field wrong. Use method="band_limited", or "zoom" with a grid.'
    )


def _spectrum(field: Field, axis: int, distance: float, output: Grid | None) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies along an axis [1/m] and the power there, of waves that reach the output."""
    n, pitch = field.grid.shape[axis], field.grid.pitch[axis]
    power = (np.abs(np.fft.fft(_lines(field, axis), axis=-1)) ** 2).sum((0, 1))
    f = np.fft.fftfreq(n, pitch)
    if output is not None:
        farthest = abs(output.center[axis] - field.grid.center[axis])
        farthest += (output.size[axis] + field.grid.size[axis]) / 2
        power = np.where(np.abs(f) <= farthest / (field.wavelength * abs(distance)), power, 0.0)
    if n <= _BINS:
        return f, power
    edges = np.linspace(-0.5 / pitch, 0.5 / pitch, _BINS + 1)
    seen, total = (np.histogram(f, edges, weights=w)[0] for w in (power * f, power))
    return seen / np.where(total > 0, total, 1.0), total


def _lines(field: Field, axis: int) -> np.ndarray:
    """Some lines (planes, lines, n) of samples along an axis, through its light, complex128."""
    xp, data = namespace(field.data), field.data
    planes = xp.reshape(data, (-1, *field.grid.shape))
    planes = planes[:: -(-planes.shape[0] // _PLANES), :, :]
    bright = to_numpy(xp.sum(xp.abs(planes) ** 2, axis=(0, 1 + axis))).astype(np.float64)
    total = np.cumsum(bright)
    wanted = (np.arange(_LINES) + 0.5) / _LINES * total[-1]
    chosen = np.unique(np.searchsorted(total, wanted).clip(0, len(total) - 1))
    kept = [planes[:, :, int(k)] if axis == 0 else planes[:, int(k), :] for k in chosen]
    return to_numpy(xp.stack(kept, axis=1)).astype(np.complex128)
