r"""`reconstruction_slopes`: derivatives of the error of reconstructed scenes by an instrument's parts.

With u = P z, the covariance that is left times one of the objects z of `reconstruction_error`,

.. math:: \delta(z^T P z) = -2 (N^{-1} A u)^T \delta A\, u + \left((A u)^2 / N^2\right)^T \delta A\, 1

the latter since photons of the mean scene are noise. No system of equations is solved anew, and all objects
go backwards through the instrument at once.
"""

from collections.abc import Sequence
from typing import cast

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import GeometryError
from lumigraph.information.bounds import Light, checked_depths
from lumigraph.information.followed import Pair, require_alike, require_followed
from lumigraph.information.imaging import Imaging, electrons, imaging
from lumigraph.information.points import collected, near_axis
from lumigraph.information.reconstruction import probed
from lumigraph.information.scenes import Scenes
from lumigraph.information.slopes import Sloping
from lumigraph.instruments import Camera
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.sees_volumes import SeesVolumes
from lumigraph.operators.part_volume import PartVolume


def reconstruction_slopes(
    camera: Instrument,
    pairs: Sequence[Pair],
    depths: Sequence[float],
    scenes: Scenes,
    light: Light | None = None,
    *,
    volume: bool = False,
    accuracy: float = 1e-2,
) -> Sloping:
    """`reconstruction_error` over depths, and how it changes with an instrument's parts.

    The scenes stay as they are before all instruments, who collect as much of their light as their apertures
    do.

    Parameters
    ----------
    camera
        Or a microscope: one that has `part_plane`.
    pairs
        (n,), cameras or microscopes a little to either side of it.
    depths, scenes, light, volume
        As of `reconstruction_error`.
    accuracy
        Of raw images, relative, rms: the camera's, and of those that are differentiated.

    Raises
    ------
    GeometryError
        As of `reconstruction_error`; another instrument; cameras between which the sensor's noise or a number
        of parts differs.

    Examples
    --------
    >>> import lumigraph as lg
    >>> camera = lg.load_camera("thesis-plenoptic-2-m050").replace(main_lens={"diameter": "1 mm"})
    >>> pair = (camera.replace(lenslets={"focal_length": f}) for f in ("5.1999 mm", "5.2001 mm"))
    >>> scenes = lg.information.Scenes(100e-6, 8)
    >>> error, changes = lg.information.reconstruction_slopes(camera, [tuple(pair)], [2e-3], scenes)
    >>> 0 < error < 1, len(changes)
    (True, 1)
    """
    light = Light() if light is None else light
    checks.instance("light", light, Light)
    checks.instance("scenes", scenes, Scenes)
    require_planes(camera)
    for end in (end for pair in pairs for end in pair):
        require_planes(end)
        require_alike(camera, end)
    planes = checked_depths(depths)
    some = [planes] if volume else list(planes[:, None])
    found = [_at(camera, pairs, group, (scenes, light), accuracy) for group in some]
    value = float(np.sqrt(sum(square for square, _ in found) / len(planes)))
    return Sloping(value, np.sum([changes for _, changes in found], axis=0) / len(planes) / (2 * value))


def require_planes(instrument: Instrument) -> None:
    """Refuse an instrument whose raw images of planes have no derivatives by its parts.

    Raises
    ------
    GeometryError
        As of `require_followed`; one without `part_plane`.
    """
    require_followed(instrument)
    if not isinstance(instrument, SeesVolumes):
        raise GeometryError(
            "only cameras and microscopes have derivatives of the error of scenes. For others, use search "
            "'local'."
        )


def _at(
    instrument: Instrument,
    pairs: Sequence[Pair],
    depths: np.ndarray,
    of: tuple[Scenes, Light],
    accuracy: float,
) -> tuple[float, np.ndarray]:
    """Sum of the squares of errors at depths that shine at once, and its changes (n,)."""
    scenes, light = of
    seen = imaging(instrument, depths, scenes, light, accuracy)
    grid, own, cut = seen.operator.object_grid, instrument, list(pairs)
    assert grid is not None  # as imaging has it
    if isinstance(instrument, Camera):
        whole = cast(Sequence[tuple[Camera, Camera]], pairs)
        own = like = near_axis(instrument, depths, scenes.size)
        cut = [(near_axis(a, depths, like=like), near_axis(b, depths, like=like)) for a, b in whole]
    part = cast(SeesVolumes, own).part_volume(
        cast(Sequence[tuple[SeesVolumes, SeesVolumes]], cut), grid, depths.tolist(), accuracy=accuracy
    )
    ends = ([_electrons(end, instrument, depths, of) for end in pair] for pair in cut)
    brighter = np.array([high - low for low, high in ends]).reshape(-1, len(depths))
    left, _, found = probed(seen, scenes.samples)
    share = scenes.contrast**2
    return float(left.sum()) / share, sloped(seen, part, found, brighter) / share


def _electrons(
    end: Instrument, instrument: Instrument, depths: np.ndarray, of: tuple[Scenes, Light]
) -> np.ndarray:
    """Electrons of a pixel for 1 of the operator (nz,): an instrument gets its light by its aperture."""
    scenes, light = of
    photons = light.photons * collected(end) / collected(instrument)
    return electrons(end, depths, scenes, Light(photons, light.background))


def sloped(seen: Imaging, part: PartVolume, found: Sequence[np.ndarray], brighter: np.ndarray) -> np.ndarray:
    """Changes (n,) of the mean of zᵀ P z over the samples of a plane; `found`, P z (nz, n, n) of each z.

    `brighter`, by how many electrons more a pixel has for 1 of the operator (n, nz).
    """
    scenes, noise, (y, x) = [*found, np.ones_like(found[0])], seen.noise**2, seen.across
    raws = [seen.electrons(one) for one in found]
    weights = [-2 * raw / noise / len(found) for raw in raws]
    weights.append(np.mean([raw**2 for raw in raws], axis=0) / noise**2)
    both = zip(weights, scenes, strict=True)
    by_light = np.sum([np.sum(seen.returned(weight) * one, axis=(1, 2)) for weight, one in both], axis=0)
    objects = np.stack([seen.light[:, None, None] * (y @ one @ x.T) for one in scenes])
    changes = part.gradient(objects, np.stack(weights)) + brighter @ (by_light / seen.light)
    return changes / scenes[0][0].size
