"""Bundle adjustment: camera and poses that explain all corners best, and how well each is known."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from lumigraph.core import memory
from lumigraph.errors import CalibrationError
from lumigraph.metric import geometry
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import Board, Corners
from lumigraph.metric.noise import Noise

_ROUNDS = 3
"""Adjustments, each with the noise of the one before."""

_WILD = 6.0
"""Standard deviations beyond which a place is another corner's."""


@dataclass(frozen=True, slots=True, eq=False)
class Adjusted:
    """A camera and poses, with their covariance.

    Parameters
    ----------
    camera
        With everything adjusted.
    poses
        (frames, 6) As `geometry.moved` takes them.
    covariance
        Of `camera.numbers`, then of the poses, row by row.
    noise
        Of the corners.
    residual
        (n, 2) Computed minus measured [px], of all corners that were given.
    kept
        (n,) Whether they took part.
    """

    camera: MetricCamera
    poses: np.ndarray
    covariance: np.ndarray
    noise: Noise
    residual: np.ndarray
    kept: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Residuals and their derivatives by scaled unknowns.

    Parameters
    ----------
    corners, board
        What was seen, of what.
    frame
        (n,) Index of each corner's picture among the poses.
    camera
        Gives the pixel pitch, and scales.
    priors
        (index, value, standard deviation) of the camera's numbers.
    noise
        Of the corners.
    sight
        (n,) Which places are of one corner on one picture.
    """

    corners: Corners
    board: Board
    frame: np.ndarray
    camera: MetricCamera
    priors: list[tuple[int, float, float]]
    noise: Noise
    sight: np.ndarray

    @property
    def frames(self) -> int:
        """Number of poses."""
        return int(self.frame.max()) + 1

    @property
    def free(self) -> np.ndarray:
        """See `freedom`."""
        return freedom(self.camera)

    def split(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the camera, and poses (frames, 6)."""
        free = self.free
        numbers = self.camera.numbers + free @ unknowns[: free.shape[1]]
        return numbers, unknowns[free.shape[1] :].reshape(self.frames, 6)

    def misfit(self, unknowns: np.ndarray) -> np.ndarray:
        """(n, 2) Computed minus measured [px]: places, or centres of corners in views."""
        numbers, poses = self.split(unknowns)
        flat, pitch, seen = self.board.points()[self.corners.corner], self.camera.pixel_pitch, self.corners
        if radius := self.board.radius:
            points = geometry.dots(numbers, flat, poses[self.frame], radius, in_views=seen.in_views)
        else:
            points = geometry.moved(flat, poses[self.frame])
        if seen.in_views:
            return (
                geometry.centers(numbers, points, (seen.place, seen.center), seen.kind, pitch) - seen.center
            )
        return geometry.project(numbers, points, seen.center, seen.kind, pitch) - seen.place

    def slopes(self, unknowns: np.ndarray) -> np.ndarray:
        """(n, 2, unknowns) Derivatives of `misfit`."""
        camera = self.free.shape[1]
        result = np.zeros((len(self.corners), 2, len(unknowns)))
        for k in range(camera):
            result[..., k] = geometry.slope(self.misfit, unknowns, np.s_[k])
        rows = np.arange(len(self.corners))
        for k in range(6):  # those of all poses at once: each place depends on one
            column = camera + 6 * self.frame + k
            result[rows, :, column] = geometry.slope(self.misfit, unknowns, np.s_[camera + k :: 6])
        return result

    def residual(self, unknowns: np.ndarray) -> np.ndarray:
        """Of the corners, in standard deviations, and of what is known beforehand."""
        numbers, _ = self.split(unknowns)
        known = [(numbers[k] - value) / error for k, value, error in self.priors]
        return np.concatenate([self._white(self.misfit(unknowns)).ravel(), known])

    def jacobian(self, unknowns: np.ndarray) -> np.ndarray:
        """Derivatives of `residual`."""
        slopes = self._white(self.slopes(unknowns)).reshape(-1, len(unknowns))
        known = np.zeros((len(self.priors), len(unknowns)))
        for row, (k, _, error) in zip(known, self.priors, strict=True):
            row[: self.free.shape[1]] = self.free[k] / error
        return np.concatenate([slopes, known])

    def _white(self, values: np.ndarray) -> np.ndarray:
        return self.noise.whitened(values, self.sight, self.corners.kind, self.corners.way)


def freedom(camera: MetricCamera) -> np.ndarray:
    """Numbers of the camera (all) by unknowns, scaled: the gains keep their mean."""
    kinds, plain = len(camera.gains), len(geometry.NAMES)
    f, _, b, *_ = camera.numbers
    scale = [0.1 * f, 0.1 * f, 0.1 * b, 0.1, 100, 100, 1e-2, 1e-2, 0.1, 1, 10, 1e-2, 1e-2]
    free = np.zeros((plain + kinds, plain + kinds - 1))
    free[:plain, :plain] = np.diag(scale)
    free[plain:-1, plain:], free[-1, plain:] = 0.1 * np.eye(kinds - 1), -0.1
    return free


def adjust(
    corners: Corners, board: Board, nominal: Nominal, camera: MetricCamera, poses: np.ndarray
) -> Adjusted:
    """Camera and poses from first ones.

    Parameters
    ----------
    corners, board
        What was seen, of what.
    nominal
        What is known of the camera.
    camera, poses
        To start from; poses (frames, 6) in the order of ``corners.frames``.

    Raises
    ------
    CalibrationError
        More corners than there is memory for, or an adjustment that does not settle.
    """
    frame = np.searchsorted(corners.frames, corners.frame)
    kinds = len(camera.gains)
    even = Noise(np.ones(kinds), 0.0)
    first = Problem(corners, board, frame, camera, nominal.priors(kinds), even, corners.sights())
    unknowns = np.concatenate([np.zeros(first.free.shape[1]), poses.ravel()])
    needed = 6.0 * 8 * 2 * len(corners) * len(unknowns)
    remedy = "Use fewer pictures, or every second corner."
    memory.require(needed, "the adjustment", remedy, CalibrationError)
    problem, kept, misfit = first, np.ones(len(corners), bool), first.misfit(unknowns)
    for number in range(_ROUNDS):
        loss = "linear" if number else "soft_l1"  # until wild corners are known
        jacobian: Any = problem.jacobian  # SciPy's types know names of methods only
        found = least_squares(problem.residual, unknowns, jacobian, x_scale="jac", loss=loss, max_nfev=200)
        if found.status <= 0:
            raise CalibrationError(
                f"the camera did not settle in {found.nfev} steps. Check the board and the nominal lengths."
            )
        unknowns = found.x
        misfit = first.misfit(unknowns)
        problem, kept = _again(first, misfit)
    covariance = _covariance(problem, unknowns)
    numbers, poses = problem.split(unknowns)
    return Adjusted(camera.with_numbers(numbers), poses, covariance, problem.noise, misfit, kept)


def placed(
    corners: Corners, board: Board, camera: MetricCamera, noise: Noise, start: np.ndarray
) -> tuple[Problem, np.ndarray]:
    """One picture's problem before a camera that is known, and its unknowns with the best pose (6,) last.

    Parameters
    ----------
    corners, board
        What was seen on the picture, of what.
    camera, noise
        As they are known.
    start
        A first pose (6,).
    """
    frame = np.zeros(len(corners), int)
    problem = Problem(corners, board, frame, camera, [], noise, corners.sights())
    fixed = np.zeros(problem.free.shape[1])

    def unknowns(pose: np.ndarray) -> np.ndarray:
        return np.concatenate([fixed, pose])

    def slopes(pose: np.ndarray) -> np.ndarray:
        return problem.jacobian(unknowns(pose))[:, len(fixed) :]

    jacobian: Any = slopes  # SciPy's types know names of methods only
    found = least_squares(lambda p: problem.residual(unknowns(p)), start, jacobian, x_scale="jac")
    return problem, unknowns(found.x)


def _again(first: Problem, misfit: np.ndarray) -> tuple[Problem, np.ndarray]:
    """The problem with the noise of a misfit (n, 2), without its wild corners."""
    kind = first.corners.kind
    typical = np.array([
        np.median(np.abs(misfit[kind == k])) if np.any(kind == k) else 1.0 for k in range(int(kind.max()) + 1)
    ])  # fmt: skip
    kept = np.abs(misfit).max(axis=1) < _WILD * 1.48 * typical[kind]
    corners = first.corners[kept]
    if len(np.unique(first.frame[kept])) != first.frames:
        raise CalibrationError(
            "the corners of a picture fit no position of the board. Leave it out, or number them again."
        )
    sight = corners.sights()
    noise = Noise.of(misfit[kept], sight, corners.kind, corners.way)
    return replace(first, corners=corners, frame=first.frame[kept], noise=noise, sight=sight), kept


def _covariance(problem: Problem, unknowns: np.ndarray) -> np.ndarray:
    """Of the camera's numbers and the poses."""
    camera = problem.free.shape[1]
    jacobian = problem.jacobian(unknowns)
    scale = np.linalg.norm(jacobian, axis=0)
    if not scale.all():
        raise CalibrationError(
            "one of the camera's numbers has no effect on these corners. Use more pictures."
        )
    inner = np.linalg.inv((jacobian / scale).T @ (jacobian / scale))
    inner /= np.outer(scale, scale)
    out = np.zeros((len(problem.camera.numbers) + len(unknowns) - camera, len(unknowns)))
    out[: len(problem.camera.numbers), :camera] = problem.free
    out[len(problem.camera.numbers) :, camera:] = np.eye(len(unknowns) - camera)
    return out @ inner @ out.T
