"""Aberrations from the light field of any object, together with its volume or picture."""

import math
from collections.abc import Sequence

import numpy as np

from lumigraph.adaptive.checked import asked_for, bent
from lumigraph.adaptive.clusters import Clusters, widened
from lumigraph.adaptive.field import PRIOR
from lumigraph.adaptive.scene import SETTINGS, Scene, own_defocus
from lumigraph.adaptive.start import starts
from lumigraph.adaptive.voxels import Around, Told, Voxels
from lumigraph.adaptive.wavefront import Wavefront
from lumigraph.adaptive.worth import UNKNOWN, worth
from lumigraph.core import arrays
from lumigraph.core.calibration import Calibration
from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.core.volume import Volume
from lumigraph.deconvolution import Exposure
from lumigraph.deconvolution.problem import values
from lumigraph.instruments import LightFieldMicroscope, PlenopticCamera
from lumigraph.scene import Points

Given = tuple[RawImage | np.ndarray, Exposure | None, Calibration | None]


def of_volume(
    given: Given, instrument: LightFieldMicroscope | PlenopticCamera, depths: Sequence[float],
    terms: Sequence[int], kind: str, progress: Progress,
) -> Wavefront:  # fmt: skip
    """The wavefront of (raw image, exposure, pixels), and the volume or picture; see `estimate`."""
    raw, exposure, pixels = given
    settings = SETTINGS[kind]
    planes, found, untold = asked_for(instrument, depths, terms, settings.kind)
    if exposure is None:
        exposure = Exposure.of(raw) if isinstance(raw, RawImage) else Exposure()
    scene = Scene(instrument, tuple(map(float, planes)), settings, pixels)
    sight, exposure = scene.sight(found), scene.counted(exposure)
    few, many = settings.iterations
    data = values(raw, sight.operator(np.zeros(len(found))), exposure)
    voxels = Voxels(sight, data, exposure, progress, scene.method(sight), settings.least)
    told = voxels.begun(np.zeros(len(found)), few)
    shifted = starts(told.problem, instrument, found, pixels, own_defocus(sight.images, sight.planes[0]))
    tried = (voxels.begun(c, few) for c in shifted)
    told = min([told, *tried], key=lambda one: one.state.deviance)
    told, around = _improved(voxels, told, np.ones(len(found), bool), settings.iterations)
    full, clusters = told.coefficients, scene.clusters(len(found))
    covariance = _covariance(voxels, told, around, clusters, settings.left)
    free = worth(covariance, told.coefficients[None], voxels.counted(told), np.eye(len(found)) / PRIOR**2)
    if not free.all():
        kept = voxels.begun(told.coefficients * free, many, told.steps)
        told, around = voxels.settled(kept, voxels.around(kept), free) if free.any() else (kept, around)
    plain = voxels.begun(np.zeros(len(found)), many, told.steps)
    if not _is_likelier(voxels, told, plain):
        told = plain
    left_out = told.coefficients - full
    covariance += np.outer(left_out, left_out)
    grid, misfit = sight.picture, voxels.misfit(told)
    volume = np.asarray(arrays.to_numpy(told.state.estimate))[(slice(None), *sight.inside)]
    return Wavefront(
        found, told.coefficients.reshape(1, 1, -1), np.sqrt(np.diag(covariance)).reshape(1, 1, -1),
        (np.array([grid.center[0]]), np.array([grid.center[1]])),
        untold | _unknown(found, covariance), Points(np.zeros((0, 3)), np.zeros(0)),
        (plain.state.deviance, told.state.deviance), misfit.pearson, 1, told.steps,
        bent(instrument, found, told.coefficients), covariance,
        Volume(volume, grid, scene.depths), _explained(found, around), misfit.deviation,
    )  # fmt: skip


def _improved(voxels: Voxels, told: Told, free: np.ndarray, iterations: Sequence[int]) -> tuple[Told, Around]:
    """Volume and coefficients after steps with more and more iterations, at last by the slope."""
    found = voxels.improved(told, free)
    for n in iterations[1:]:
        found = voxels.improved(voxels.begun(found[0].coefficients, n, found[0].steps), free)
    return voxels.settled(*found, free)


def _is_likelier(voxels: Voxels, told: Told, plain: Told) -> bool:
    """True if all coefficients together are worth it by Schwarz's criterion.

    Volumes on a grid of samples do not explain raw images to their noise: what they leave, in variances of
    noise, raises the bar.
    """
    count, unknowns = voxels.counted(told), np.count_nonzero(told.coefficients)
    gained = (plain.state.deviance - told.state.deviance) * count
    return gained > unknowns * math.log(count) * max(voxels.misfit(told).pearson, 1.0)


def _covariance(voxels: Voxels, told: Told, around: Around, clusters: Clusters, left: float) -> np.ndarray:
    """Covariance of the coefficients: by noise, unexplained light, model errors and the object's pull."""
    one, pearson = np.eye(len(around.information)), max(voxels.misfit(told).pearson, 1.0)
    known = around.information / pearson + one / PRIOR**2
    scatter = clusters.scatter(around.scores, pearson * around.information)
    pulled = np.linalg.solve(around.information + one / PRIOR**2, around.pull)
    found = widened(around.information + one / PRIOR**2, known, scatter)
    return found + np.outer(pulled, pulled) + left**2 * one


def _unknown(terms: tuple[int, ...], covariance: np.ndarray) -> dict[int, str]:
    deviations = np.sqrt(np.diag(covariance))
    return {j: UNKNOWN for j, d in zip(terms, deviations, strict=True) if d > PRIOR / 2}


def _explained(terms: tuple[int, ...], around: Around) -> dict[int, float]:
    """Part of each term's information that the volume takes, as it explains what the term does."""
    left = np.diag(around.information) / np.diag(around.fixed)
    return {j: float(np.clip(1 - part, 0, 1)) for j, part in zip(terms, left, strict=True)}
