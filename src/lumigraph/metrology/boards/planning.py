"""Plans for pictures of a board: the poses that determine the camera's lengths best, and how well."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.result import Quantity
from lumigraph.core.short_repr import brief
from lumigraph.errors import CalibrationError
from lumigraph.metrology.boards import geometry
from lumigraph.metrology.boards.adjustment import AdjustmentProblem, freedom
from lumigraph.metrology.boards.calibration import LEAST_FRAMES
from lumigraph.metrology.boards.camera import MetricCamera, Nominal
from lumigraph.metrology.boards.corners import Board, Corners
from lumigraph.metrology.boards.finding import LEAST_SEEN, clear_radius
from lumigraph.metrology.boards.noise import Noise
from lumigraph.metrology.boards.views import DIRECTIONS, reach
from lumigraph.metrology.boards.windows import LEAST_SQUARE, nearest

Turn = tuple[float, float, float]

_TILTS = (0.0, 0.35, -0.35, 0.7, -0.7)  # rad: beyond, the squares are too narrow
_STEEPEST = 0.8  # rad, about both axes together
_ASLANT = math.radians(18)
"""Angle from edges in views to rows of lenslets: edges that run along them may be anywhere between two."""

_ROLLS = np.array(sorted(np.linspace(-0.8, 0.8, 65), key=abs))
"""Turns about the line of sight that are tried [rad], the smallest first."""

KEPT_TO = (0.02, math.radians(5))
"""Tolerances of a plan: in distance, relative, and in each angle [rad]."""

_RATIOS = (0.08, 0.6)  # how far a corner moves against a lenslet, as `depth.correlation` looks for it
_DISTANCES = 24
_FARTHEST = 200.0  # focal lengths

_MOVED = 3.0
"""Lenslets by which views may move a corner over the stop: so much blurs a seventh of it by half a sample."""

_MARGIN = 4.0
"""Lenslets around a corner that its saddle is looked for in."""

_BESIDE = 1.5
"""Squares beyond the outer corners that finding a board needs."""

_SWAY = 0.01
"""Noise of how far a corner moves from view to view (see `Noise`)."""

_SURE = (0.1, 0.3)
"""Relative uncertainty of L and b without any picture."""


@dataclass(frozen=True, slots=True)
class PlannedPicture:
    """One picture to take.

    Parameters
    ----------
    distance
        Of the board's middle, on the axis, from the main lens [m].
    turn
        Rotation vector (z, y, x) [rad], as that of `Pose`: z turns the board about the line of sight, y
        about its vertical, x about its horizontal middle line.
    places
        Of corners behind lenslets that it gives.
    errors
        Standard deviations (f, L, b) [m] with this picture and those before it.
    distance_error
        Of the distance of a point over itself, with the same pictures, at worst where boards can stand; what
        the point's own places add is not in it.
    """

    distance: float
    turn: Turn
    places: int
    errors: tuple[float, float, float]
    distance_error: float


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Pictures of a board, the most informative first.

    Parameters
    ----------
    camera, board
        Of what, by what.
    steps
        The pictures.
    """

    camera: MetricCamera
    board: Board
    steps: tuple[PlannedPicture, ...]

    __repr__ = brief

    def quantities(self) -> tuple[Quantity, ...]:
        """f, L and b with the 95 % intervals that all pictures together will give, and the pictures."""
        names, numbers = ("focal_length", "separation", "lenslet_distance"), self.camera.numbers.tolist()
        spread = [1.96 * error for error in self.steps[-1].errors]
        lengths = zip(names, numbers, spread, strict=False)
        return (
            *(Quantity(name, value, "m", (value - off, value + off)) for name, value, off in lengths),
            Quantity("distances", tuple(step.distance for step in self.steps), "m"),
            Quantity("turns", tuple(step.turn for step in self.steps), "rad"),
        )

    @property
    def known(self) -> np.ndarray:
        """(steps, 4) Half the 95 % intervals of f, L, b and distances of points over themselves."""
        errors = np.array([(*step.errors, step.distance_error) for step in self.steps])
        return 1.96 * errors / np.append(self.camera.numbers[:3], 1.0)

    def enough(self, part: float) -> tuple[int | None, ...]:
        """Numbers of pictures that determine f, L, b and distances to a part, in 95 of 100 cases.

        None where all pictures do not.

        Parameters
        ----------
        part
            Half the interval's width over the length.
        """
        return tuple(int(np.argmax(one)) + 1 if one.any() else None for one in (self.known <= part).T)

    def table(self) -> list[list[str]]:
        """The pictures as rows of text, their header first."""
        turns = ["turn (sight)", "tilt (vertical)", "tilt (horizontal)"]
        rows = [["picture", "distance", *turns, "places", "f", "L", "b", "distances"]]
        for number, step in enumerate(self.steps, 1):
            tilts = [f"{math.degrees(angle):+.0f}°" for angle in step.turn]
            errors = [f"± {1.96 * error * 1e3:.3g} mm" for error in step.errors]
            errors.append(f"± {196 * step.distance_error:.2g} %")
            rows.append([str(number), f"{step.distance * 1e3:.4g} mm", *tilts, str(step.places), *errors])
        return rows


def plan(
    camera: MetricCamera,
    calibration: Calibration,
    board: Board,
    nominal: Nominal,
    *,
    pictures: int = 8,
    in_views: bool = False,
    noise_px: tuple[float, float] | None = None,
) -> Plan:
    """Poses of a board, one after the other those that determine f, L and b best together.

    Boards stand on the axis where three lenslets or more show each corner, straight or tilted; before a
    camera 1.0, where views over the stop move no corner by more than three lenslets, and turned about the
    line of sight until their edges in the picture run 18° or more from rows of lenslets, where they fit so.
    They can be used 2 % nearer or farther and turned by 5° more or less, too. What a picture tells of
    the camera is known before it is taken: its Fisher information, less what its own pose takes. Each picture
    is the one that makes the sum of the relative variances of f, L and b least.

    Parameters
    ----------
    camera
        As its data sheet says, such as ``MetricCamera.of(camera_file)``.
    calibration
        Where its micro-images stand, and how much of each is lit (`fill`; all of it where that is None).
    board
        To be used.
    nominal
        How well the data sheet is known. L is taken as known to 10 %, b to 30 %.
    pictures
        How many; 3 at least.
    in_views
        Whether it is a camera 1.0, whose views show the corners.
    noise_px
        Of one place, and of what all places of a corner share (see `Noise`) [px]; None for 0.1 and 0.05, in
        views for 1.2 % and 0.4 % of a pitch.

    Raises
    ------
    CalibrationError
        Fewer than three pictures, or no distance at which the board can be used.
    """
    checks.whole("pictures", pictures, LEAST_FRAMES, CalibrationError)
    pitch = calibration.lattice.pitch
    usual = (0.012 * pitch, 0.004 * pitch) if in_views else (0.1, 0.05)
    own, shared = (checks.positive("noise_px", one, "px") for one in noise_px or usual)
    noise = Noise(np.full(len(camera.gains), own), shared, _SWAY if in_views else 0.0)
    before = _Before(camera, calibration, board, noise, in_views)
    distances = _in_views(camera, pitch) if in_views else _distances(camera)
    useful = before.shots(distances, aslant=True) if in_views else []
    useful = useful or before.shots(distances, aslant=False)
    if not useful:
        seen = "in squares 6 samples of a view wide" if in_views else (
            f"and {LEAST_SEEN} lenslets show each corner, in squares {LEAST_SQUARE:.2g} px wide"
        )  # fmt: skip
        raise CalibrationError(
            f"there is no place where the whole {board.what}, {board.spacing * 1e3:.3g} mm, is in the "
            f"picture {seen} or wider. Try squares of another size."
        )
    return Plan(camera, board, tuple(_chosen(useful, camera, nominal, pictures)))


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    """A picture and its information of the camera's unknowns, whatever its pose."""

    distance: float
    turn: Turn
    places: int
    told: np.ndarray


def _distances(camera: MetricCamera) -> list[float]:
    """Distances at which micro-images can be compared, from near to far, evenly in the image."""
    f, low = camera.focal_length, 1.02 * camera.focal_length
    every = 1 / np.linspace(1 / low, 1 / (_FARTHEST * f), 400)
    image = f * every / (every - f)
    ratio = np.abs(camera.lenslet_distance / (camera.separation - image))
    usable = every[(ratio >= _RATIOS[0]) & (ratio <= _RATIOS[1])]
    if not len(usable):
        raise CalibrationError(
            f"nothing in front of the camera is shown {_RATIOS[0]:g} to {_RATIOS[1]:g} times as large as its "
            f"image by a lenslet: L is {camera.separation * 1e3:.4g} mm, b "
            f"{camera.lenslet_distance * 1e3:.4g} mm."
        )
    return usable[np.linspace(0, len(usable) - 1, min(_DISTANCES, len(usable))).astype(int)].tolist()


def _in_views(camera: MetricCamera, pitch: float) -> list[float]:
    """Distances at which views are sharp and can be compared, from near to far, evenly in the image."""
    f = camera.focal_length
    every = 1 / np.linspace(1 / (1.02 * f), 1 / (_FARTHEST * f), 400)
    points = np.stack([every, 0 * every, 0 * every], 1)
    moved = [_centers(camera, points, np.array([0.0, side * pitch / 2])) for side in (1, -1)]
    usable = every[np.abs(moved[0] - moved[1]).max(1) <= _MOVED * pitch]
    return usable[np.linspace(0, len(usable) - 1, min(_DISTANCES, len(usable))).astype(int)].tolist()


def _centers(camera: MetricCamera, points: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Centres (n, 2) of the micro-images that show points (n, 3) at ways from them, (2,) or (n, 2) [px]."""
    ways = np.broadcast_to(way, (len(points), 2))
    kind = np.zeros(len(points), int)
    return geometry.centers(camera.numbers, points, (ways, np.zeros_like(ways)), kind, camera.pixel_pitch)


@dataclass(frozen=True, slots=True, eq=False)
class _Before:
    """A camera before a board, and the noise of its corners."""

    camera: MetricCamera
    calibration: Calibration
    board: Board
    noise: Noise
    in_views: bool

    def shots(self, distances: list[float], *, aslant: bool) -> list[_Shot]:
        """Shots of boards, straight and tilted, aslant to rows or not, where all corners can be used."""
        tilts = [(y, x) for y, x in product(_TILTS, _TILTS) if math.hypot(y, x) <= _STEEPEST]
        every = (
            self.shot(distance, (self.roll(distance, *tilt) if aslant else 0.0, *tilt))
            for distance, tilt in product(distances, tilts)
        )
        return [shot for shot in every if shot is not None]

    def shot(self, distance: float, turn: Turn) -> _Shot | None:
        """A board at a distance; None where not all of its corners can be used."""
        pose = self.pose(np.array([distance]), np.array([turn]))[0]
        points = geometry.moved(self.board.points(), pose)
        if not self.usable(distance, turn):
            return None
        seen = self.by_views(points) if self.in_views else self.by_lenslets(points)
        if seen is None:
            return None
        frame, sights = np.zeros(len(seen), int), seen.sights()
        own_noise = self.noise.each(seen.kind)
        problem = AdjustmentProblem(seen, self.board, frame, self.camera, [], self.noise, sights, own_noise)
        own = problem.free.shape[1]
        slopes = problem.jacobian(np.concatenate([np.zeros(own), pose]))
        of_camera, of_pose = slopes[:, :own], slopes[:, own:]
        across = of_pose.T @ of_camera
        told = of_camera.T @ of_camera - across.T @ np.linalg.solve(of_pose.T @ of_pose, across)
        return _Shot(distance, turn, len(seen), told)

    def pose(self, distance: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Poses (k, 6) of boards whose middles are on the axis, at distances (k,), turned by (k, 3)."""
        still = np.concatenate([turn, np.zeros_like(turn)], 1)
        place = -geometry.moved(self.board.middle, still)
        place[:, 0] += distance
        return np.concatenate([turn, place], 1)

    def usable(self, distance: float, turn: Turn) -> bool:
        """True if a board can be found, also as far from its pose as it may be."""
        sides = np.array([*product((-1, 1), repeat=4), (0, 0, 0, 0)])
        nearer, angle = KEPT_TO
        poses = self.pose(distance * (1 + nearer * sides[:, 0]), turn + angle * sides[:, 1:])
        points = geometry.moved(self.board.points(), poses[:, None])
        if points[..., 0].min() <= 1.02 * self.camera.focal_length or not self.whole(poses):
            return False
        return min(map(self.square, points)) >= LEAST_SQUARE

    def square(self, points: np.ndarray) -> float:
        """Least way between corners (n, 3) behind a lenslet [px], or in a view [samples]."""
        if self.in_views:
            return nearest(_centers(self.camera, points, np.zeros(2))) / self.calibration.lattice.pitch
        axis = np.repeat(np.array([self.camera.axis]), len(points), 0)
        return nearest(self.camera.project(points, axis))

    def whole(self, poses: np.ndarray) -> bool:
        """True if boards (k, 6) are in the picture with what finding them needs.

        That are the outer squares and half a square of white margin; of chessboards in views the corners
        alone, and some lenslets around them.
        """
        alone = self.in_views and self.board.pattern == "corners"
        margin = _MARGIN * self.calibration.lattice.pitch if alone else 0.0
        beside = 0.0 if alone else _BESIDE
        rim = [np.array([-beside, n - 1 + beside]) * self.board.spacing for n in self.board.shape]
        y, x = (one.ravel() for one in np.meshgrid(*rim))
        points = geometry.moved(np.stack([0 * y, y, x], 1), poses[:, None]).reshape(-1, 3)
        at, size = _centers(self.camera, points, np.zeros(2)), np.array(self.calibration.shape)
        return bool(((at > margin) & (at < size - 1 - margin)).all())

    def roll(self, distance: float, y: float, x: float) -> float:
        """The smallest turn about the line of sight that keeps edges far enough from rows of lenslets."""
        tilts = np.full((len(_ROLLS), 2), (y, x))
        poses = self.pose(np.full(len(_ROLLS), distance), np.column_stack([_ROLLS, tilts]))
        down, across = ((n - 1) * self.board.spacing for n in self.board.shape)
        outline = np.array([(0, 0, 0), (0, 0, across), (0, down, across), (0, down, 0), (0, 0, 0)])
        points = geometry.moved(outline, poses[:, None]).reshape(-1, 3)
        sides = np.diff(_centers(self.camera, points, np.zeros(2)).reshape(-1, 5, 2), axis=1)
        edges = np.arctan2(*np.moveaxis(sides, -1, 0))
        lattice = self.calibration.lattice
        apart = math.pi / (3 if lattice.layout == "hex" else 2)
        away = np.abs((edges - lattice.rotation + apart / 2) % apart - apart / 2).min(1)
        return float(_ROLLS[np.argmax(np.minimum(away, _ASLANT).round(6))])

    def by_lenslets(self, points: np.ndarray) -> Corners | None:
        """Places of all corners behind lenslets; None where one cannot be found."""
        camera, calibration = self.camera, self.calibration
        rows, columns = calibration.shape
        index = calibration.indices_within((0, rows - 1), (0, columns - 1))
        center, kinds = calibration.position(index), calibration.lattice.kind(*index.T)
        corner, lenslet = (each.ravel() for each in np.indices((len(points), len(center))))
        place = camera.project(points[corner], center[lenslet], kinds[lenslet])
        ratio = geometry.magnification(camera.numbers, points[:, 0])
        shown = np.hypot(*(place - center[lenslet]).T) <= clear_radius(calibration, ratio)[corner]
        if np.bincount(corner[shown], minlength=len(points)).min() < LEAST_SEEN:
            return None
        corner, lenslet, place = corner[shown], lenslet[shown], place[shown]
        return Corners(np.zeros(len(corner), int), corner, place, center[lenslet], kinds[lenslet])

    def by_views(self, points: np.ndarray) -> Corners | None:
        """Centres of micro-images showing the corners in each view; None where one is not in the picture."""
        pitch, size = self.calibration.lattice.pitch, np.array(self.calibration.shape)
        at = (np.arange(DIRECTIONS) - DIRECTIONS // 2) * pitch / DIRECTIONS
        ways = np.stack(np.meshgrid(at, at, indexing="ij"), -1).reshape(-1, 2)
        ways = ways[np.hypot(*ways.T) <= reach(self.calibration, DIRECTIONS)]
        corner, view = (each.ravel() for each in np.indices((len(points), len(ways))))
        center = _centers(self.camera, points[corner], ways[view])
        margin = _MARGIN * pitch
        if not ((center > margin) & (center < size - 1 - margin)).all():
            return None
        frame = np.zeros(len(corner), int)
        return Corners(frame, corner, center + ways[view], center, frame, in_views=True)


def _chosen(
    shots: list[_Shot], camera: MetricCamera, nominal: Nominal, pictures: int
) -> Iterator[PlannedPicture]:
    free, lengths = freedom(camera), camera.numbers[:3]
    beforehand = [(k, error) for k, _, error in nominal.priors(len(camera.gains))]
    beforehand += [(k + 1, share * lengths[k + 1]) for k, share in enumerate(_SURE)]
    known = [free[k] / error for k, error in beforehand]
    if nominal.apart is not None:
        known.append(geometry.slopes_of_pitch_ratio(camera.numbers) @ free / nominal.apart[1])
    known = np.array(known)
    told = known.T @ known

    def covariance(told: np.ndarray) -> np.ndarray:
        return (free @ np.linalg.inv(told) @ free.T)[:3, :3]

    def unsure(shot: _Shot) -> float:
        return float(np.sum(np.diag(covariance(told + shot.told)) / lengths**2))

    slopes = _slopes_of_distance(camera, np.unique([shot.distance for shot in shots]))
    for _ in range(pictures):
        shot = min(shots, key=unsure)
        told = told + shot.told
        now = covariance(told)
        f, L, b = np.sqrt(np.diag(now)).tolist()
        far = np.sqrt(np.einsum("ka,ab,kb->k", slopes, now, slopes)).max()
        yield PlannedPicture(shot.distance, shot.turn, shot.places, (f, L, b), float(far))


def _slopes_of_distance(camera: MetricCamera, distance: np.ndarray) -> np.ndarray:
    """(k, 3) Of what lenslets say of distances (k,), over them, by f, L and b: b / (L - image) is seen."""
    f, L, b = camera.numbers[:3]
    image = f * distance / (distance - f)
    of_image = -((f / (image - f)) ** 2)
    of_f = (image / (image - f)) ** 2
    return np.stack([of_f, of_image, -of_image * (L - image) / b], 1) / distance[:, None]
