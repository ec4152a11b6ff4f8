"""Plenoptic 2.0 pictures finer than one micro-image samples them, from all that show a place."""

import math
import warnings
from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_matrix, diags, vstack
from scipy.sparse.linalg import LinearOperator, cg

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, like, namespace, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.matrix import Matrix
from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.rendering.decode import check_raw
from lumigraph.rendering.interpolate import as_float
from lumigraph.rendering.patches import Layout, Patches

_MOST = 8  # times finer
_ENOUGH = 1.6  # the widest gap between samples, over the finer picture's pitch, that still resolves it


def super_resolve(
    raw: RawImage | Array,
    calibration: Calibration,
    patch: float | Array,
    *,
    factor: int = 2,
    iterations: int = 30,
    smoothness: float = 0.02,
    progress: Progress | None = None,
) -> Array:
    r"""Picture (y, x[, c]) with `factor` times as many samples as `render`'s, that explains all pixels best.

    A place shows in about (P/patch)² micro-images, whose pixels fall between each other's. Each pixel of
    value r is the mean of the picture E over its own width, P/patch, where it looks at; E minimises

    .. math:: \sum_{pixels} (A E - r)^2 + \lambda^2 \int |\nabla E|^2

    by conjugate gradients. Pixels within two of a micro-image's edge are left out.

    Parameters
    ----------
    raw, calibration, patch
        As for `render`: one patch, or a map of them.
    factor
        Samples of the picture per pixel of a patch, 1 to 8. Diffraction ends what can be gained.
    iterations
        Of the conjugate gradients.
    smoothness
        λ² over the mean square of A's columns: more for noisy raw images.
    progress
        Called as ``progress(fraction)``.

    Warns
    -----
    SamplingWarning
        The pixels of all micro-images fall on nearly the same places, so that they hold no finer detail.

    Raises
    ------
    GeometryError
        A factor outside 1 to 8, no iterations, smoothness below 0, or a patch as `render` refuses it.
    CalibrationError
        The raw image does not belong to the calibration.
    LumigraphError
        It would not fit in memory.

    References
    ----------
    Georgiev, Chunev and Lumsdaine, "Superresolution with the focused plenoptic camera", Proc. SPIE 7873,
    78730X (2011), with least squares in place of interlacing.
    """
    raw = raw if isinstance(raw, RawImage) else RawImage(raw)
    check_raw(raw, calibration)
    if not 1 <= checks.whole("factor", factor) <= _MOST:
        raise GeometryError(f"factor is {factor} but must be from 1 to {_MOST}.")
    checks.whole("iterations", iterations)
    if checks.finite("smoothness", smoothness, "1") < 0:
        raise GeometryError(f"smoothness is {smoothness:g} but must be at least 0.")
    sizes = Patches.of(patch, calibration)
    _warn_if_alike(calibration, sizes, factor)
    layout = Layout.of(calibration, sizes, max(1, round(abs(sizes.middle) * factor)))
    projection, used = _projection(calibration, sizes, layout)
    data = to_numpy(as_float(raw.data))
    flat = data.reshape(data.shape[0] * data.shape[1], -1)[used].astype(float)
    steps, total = [0], iterations * flat.shape[1]

    def stepped(_: np.ndarray) -> None:
        steps[0] += 1
        if progress is not None:
            progress(steps[0] / total)

    channels = [_solved(projection, channel, (iterations, smoothness), stepped) for channel in flat.T]
    picture = np.stack(channels, -1).reshape(*projection.object_shape, *data.shape[2:])
    return like(picture, as_float(namespace(raw.data).asarray(raw.data)))


def sample_gap(calibration: Calibration, patch: float) -> float:
    """Widest gap between the pixels of all micro-images that show a place, in pixels: 1 is no gain at all.

    A pixel n of the micro-image at C looks at Y = C - P/patch (n - C): in units of its width it falls on
    C (1 + patch/P), up to whole numbers, whose fractions count.
    """
    lattice = calibration.lattice
    across = math.ceil(lattice.pitch / abs(patch) / 2)
    middle = np.array(calibration.shape) / 2
    around = np.stack(lattice.index(*middle), -1)
    near = [(i, j) for i in range(-across, across + 1) for j in range(-across, across + 1)]
    centers = calibration.position(around + np.array(near))
    close = np.hypot(*(centers - calibration.position(around)).T) <= (across + 0.01) * lattice.pitch
    widest = 0.0
    for axis in (0, 1):
        places = np.sort(np.mod(centers[close, axis] * (1 + patch / lattice.pitch), 1.0))
        gaps = np.diff(np.concatenate([places, places[:1] + 1]))
        widest = max(widest, float(gaps.max()))
    return widest


def _warn_if_alike(calibration: Calibration, sizes: Patches, factor: int) -> None:
    gap = sample_gap(calibration, sizes.middle)
    if gap * factor > _ENOUGH and factor > 1:
        warnings.warn(
            f"pixels of neighbouring micro-images leave gaps of {gap:.2f} px, too wide for a picture "
            f"{factor} times finer. Use factor={max(1, int(_ENOUGH / gap))}, or a slightly different patch.",
            SamplingWarning,
            stacklevel=3,
        )


def _projection(calibration: Calibration, sizes: Patches, layout: Layout) -> tuple[Matrix, np.ndarray]:
    """Matrix from a picture to means over the pixels' widths (pixels,), and those pixels' flat indices."""
    lattice, (ny, nx) = calibration.lattice, calibration.shape
    y, x = np.meshgrid(np.arange(ny, dtype=float), np.arange(nx, dtype=float), indexing="ij")
    i, j = calibration.index(y, x)
    indices = np.stack([i, j], -1)
    on_sensor, flat = calibration.position(indices), lattice.position(indices)
    dy, dx = y - on_sensor[..., 0], x - on_sensor[..., 1]
    ratio = lattice.pitch / sizes.at(i, j)
    rows = (flat[..., 0] - ratio * dy - layout.y[0]) / layout.step
    columns = (flat[..., 1] - ratio * dx - layout.x[0]) / layout.step
    width = np.abs(ratio) / layout.step
    used = np.hypot(dy, dx) <= max(0.5 * lattice.pitch - 2, 0.25 * lattice.pitch)
    for place, count in ((rows, len(layout.y)), (columns, len(layout.x))):
        used &= (place >= 0) & (place <= count - 1)
    used = np.flatnonzero(used)
    width = np.broadcast_to(width, rows.shape).ravel()[used]
    down = _overlaps(rows.ravel()[used], width, len(layout.y))
    right = _overlaps(columns.ravel()[used], width, len(layout.x))
    taps = down[0].shape[1]
    memory.require(20.0 * len(used) * taps**2, "the super-resolution", "Use a smaller factor.")
    index = (down[0][:, :, None] * len(layout.x) + right[0][:, None, :]).reshape(len(used), -1)
    weight = (down[1][:, :, None] * right[1][:, None, :]).reshape(len(used), -1)
    start = np.arange(len(used) + 1) * taps**2
    picture = len(layout.y), len(layout.x)
    matrix = csr_matrix((weight.ravel(), index.ravel(), start), (len(used), math.prod(picture)))
    return Matrix(matrix, (len(used),), picture), used


def _overlaps(place: np.ndarray, width: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Samples (k, taps) that intervals of a width about places [samples] cover, and the part of each."""
    taps = math.ceil(float(width.max())) + 1
    first = np.floor(place - width / 2 + 0.5).astype(np.int64)
    index = first[:, None] + np.arange(taps)
    low = np.maximum(index - 0.5, (place - width / 2)[:, None])
    high = np.minimum(index + 0.5, (place + width / 2)[:, None])
    part = np.clip(high - low, 0, None) / width[:, None]
    return np.clip(index, 0, count - 1), part


def _solved(
    projection: Matrix, values: np.ndarray, how: tuple[int, float], stepped: Callable[[np.ndarray], None]
) -> np.ndarray:
    """Picture whose projection is nearest to the values, smooth where they say nothing."""
    (iterations, smoothness), shape = how, projection.object_shape
    slopes, columns = _slopes(shape), math.prod(shape)
    weight = max(smoothness, 1e-9) * float((projection.matrix.data**2).sum()) / columns

    def normal(flat: np.ndarray) -> np.ndarray:
        picture = flat.reshape(shape)
        found = projection.adjoint(projection.forward(picture))
        return (found + weight * slopes.adjoint(slopes.forward(picture))).ravel()

    seen, back = projection.adjoint(np.ones(len(values))).ravel(), projection.adjoint(values).ravel()
    mean = float(values.mean()) if len(values) else 0.0
    start = np.where(seen > 1e-3, back / np.maximum(seen, 1e-3), mean)
    operator = LinearOperator((columns, columns), matvec=normal, dtype=float)  # pyright: ignore
    return cg(operator, back, x0=start, rtol=1e-5, maxiter=iterations, callback=stepped)[0]


def _slopes(shape: tuple[int, ...]) -> Matrix:
    """Differences to the next sample down and to the right."""
    ny, nx = shape
    size = ny * nx
    down = diags([-1.0, 1.0], [0, nx], (size - nx, size))  # pyright: ignore
    keep = np.arange(size) % nx != nx - 1
    right = diags([-1.0 * keep, 1.0 * keep[:-1]], [0, 1], (size, size))  # pyright: ignore
    matrix = csr_matrix(vstack([down, right]))
    return Matrix(matrix, (2 * size - nx,), shape)
