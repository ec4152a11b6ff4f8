"""Kinds of lenslets of a multi-focus array, matched with their sharp patches by the raw image itself."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from scipy.ndimage import gaussian_filter

from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.errors import GeometryError
from lumigraph.rendering.decode import check_raw
from lumigraph.rendering.interpolate import sample
from lumigraph.rendering.patches import checked_focus, lenslet_indices

_INNER = 0.3  # of the pitch, where detail is measured
_AROUND = 1.5  # lenslets that a lenslet is compared with
_LEAST = 0.2  # correlation from which the picture is believed


def match_kinds(
    raw: RawImage | Array, calibration: Calibration, patch: Array, focus: Sequence[float]
) -> tuple[float, ...]:
    """`focus` for `render` in the order of the kinds that the raw image shows.

    A maker's file says at which depths three kinds of lenslets are sharp, but not which of them stands first
    in a picture that was cropped or turned. Where the patches are known, the kind that shows more detail than
    its neighbours shows it: of all orders, the one whose blur, `|patch - focus|`, fits it best is
    returned, or the given one where the picture has too little detail.

    Parameters
    ----------
    raw, calibration
        Of one camera, with three kinds of lenslets.
    patch
        Map (rows, cols) of `lenslet_indices` [px].
    focus
        Three patches [px], in any order.

    Raises
    ------
    GeometryError
        A lattice of one kind, a map of another shape, or impossible patches.
    """
    raw = raw if isinstance(raw, RawImage) else RawImage(raw)
    check_raw(raw, calibration)
    given = checked_focus(focus, calibration)
    assert given is not None
    indices, sizes = lenslet_indices(calibration), np.asarray(to_numpy(patch), float)
    if calibration.lattice.kinds != 3 or sizes.shape != indices.shape[:2]:
        raise GeometryError(
            f"the map of patches has shape {sizes.shape} and the lattice {calibration.lattice.kinds} kinds, "
            f"but {indices.shape[:2]} lenslets of three kinds are needed."
        )
    detail = np.log(_detail(raw, calibration, indices))
    detail = detail - gaussian_filter(detail, _AROUND)
    kind = calibration.lattice.kind(indices[..., 0], indices[..., 1])

    def agreement(order: tuple[float, ...]) -> float:
        blur = np.abs(sizes - np.array(order)[kind])
        blur = blur - gaussian_filter(blur, _AROUND)
        return -float((blur * detail).sum() / max(np.linalg.norm(blur) * np.linalg.norm(detail), 1e-300))

    best = max(permutations(given.tolist()), key=agreement)
    return best if agreement(best) > _LEAST else tuple(given.tolist())


def _detail(raw: RawImage, calibration: Calibration, indices: np.ndarray) -> np.ndarray:
    """Mean square of the fine detail in the middle of each micro-image (rows, cols)."""
    picture = np.asarray(to_numpy(raw.data), float)
    picture = picture.mean(-1) if picture.ndim == 3 else picture
    fine = (picture - gaussian_filter(picture, 1.0)) ** 2
    half = max(1, int(_INNER * calibration.lattice.pitch))
    offsets, centers = np.arange(-half, half + 1), calibration.position(indices)
    places = centers[..., 0, None, None] + offsets[:, None], centers[..., 1, None, None] + offsets
    power = sample(fine, *places, "linear").mean((-1, -2))
    return power + 1e-6 * max(float(power.max()), 1e-300)
