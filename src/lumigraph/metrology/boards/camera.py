"""A plenoptic camera as a geometry of rays: `MetricCamera`, and what is known of one beforehand."""

from dataclasses import dataclass, fields

import numpy as np

from lumigraph.core import checks
from lumigraph.core.checks import Pair
from lumigraph.errors import CalibrationError, GeometryError
from lumigraph.instruments import LensletCamera
from lumigraph.metrology.boards import geometry

_COUNTS = {"axis": (2,), "tilt": (2,), "radial": (3,), "tangential": (2,), "gains": (1, 2, 3)}


@dataclass(frozen=True, slots=True)
class MetricCamera:
    """Main lens, lenslets and sensor, with their lengths.

    Parameters
    ----------
    focal_length
        Of the main lens, f [m].
    separation
        Main lens (its image-side principal plane) to lenslets, L [m].
    lenslet_distance
        Lenslets to sensor, b [m].
    exit_pupil
        From the main lens' exit pupil to the lenslets, E [m]: micro-images stand (1 + b/E) times as far apart
        as the lenslets. That of a thin lens is L.
    pixel_pitch
        [m]
    axis
        Where the optical axis meets the sensor (y, x) [px].
    tilt
        Of the array against the main lens: how much farther a lenslet is for each metre along y and x.
    radial, tangential
        Distortion of the main lens by field angle, k1 to k3 and p1, p2 (Brown's).
    gains
        How far each kind of lenslet moves a point from its micro-image's centre, over b's; their mean is 1.

    Raises
    ------
    GeometryError
        A length that is not above 0, or a number that is not finite, too few or too many.
    """

    focal_length: float
    separation: float
    lenslet_distance: float
    exit_pupil: float
    pixel_pitch: float
    axis: Pair
    tilt: Pair = (0.0, 0.0)
    radial: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tangential: Pair = (0.0, 0.0)
    gains: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        for name in ("focal_length", "separation", "lenslet_distance", "exit_pupil", "pixel_pitch"):
            object.__setattr__(self, name, checks.positive(name, getattr(self, name)))
        for name, counts in _COUNTS.items():
            values = np.asarray(getattr(self, name))
            if values.ndim != 1 or len(values) not in counts:
                wanted = " or ".join(map(str, counts))
                raise GeometryError(f"{name} has shape {values.shape} but must be {wanted} numbers.")
            for value in getattr(self, name):
                checks.finite(name, value, "1")

    @classmethod
    def of(cls, camera: LensletCamera) -> "MetricCamera":
        """The ideal one that a camera file describes: a thin lens, nothing tilted or distorted."""
        y, x = ((n // 2) for n in camera.sensor.shape)
        L, pitch, gains = camera.separation, camera.sensor.pixel_pitch, (1.0,) * camera.lattice.kinds
        f, b = camera.main_lens.focal_length, camera.lenslet_distance
        return cls(f, L, b, L, pitch, (float(y), float(x)), gains=gains)

    @property
    def numbers(self) -> np.ndarray:
        """All that can be adjusted, in the order of `geometry.NAMES`, the gains last."""
        ends = self.exit_pupil / self.separation
        lengths = (self.focal_length, self.separation, self.lenslet_distance, 1 / ends)
        return np.array([*lengths, *self.axis, *self.tilt, *self.radial, *self.tangential, *self.gains])

    def with_numbers(self, numbers: np.ndarray) -> "MetricCamera":
        """The camera with other `numbers`."""
        f, L, b, ratio, *rest = np.asarray(numbers, float).tolist()
        y, x, down, across, k1, k2, k3, p1, p2, *gains = rest
        return MetricCamera(
            f, L, b, L / ratio, self.pixel_pitch, (y, x), (down, across), (k1, k2, k3), (p1, p2), tuple(gains)
        )

    def project(self, points: np.ndarray, center: np.ndarray, kind: np.ndarray | int = 0) -> np.ndarray:
        """Places (n, 2), (y, x), at which lenslets show points [px].

        Parameters
        ----------
        points
            (n, 3) or one (3,), as (z, y, x) from the main lens [m]: x to the right, y down, z forward.
        center
            (n, 2) centres (y, x) of the micro-images [px].
        kind
            Of the lenslets, (n,) or one for all.

        Returns
        -------
        numpy.ndarray
            (n, 2) places (y, x) [px], whether or not the micro-image reaches as far.
        """
        points, center = np.atleast_2d(points), np.atleast_2d(center)
        kinds = np.broadcast_to(np.asarray(kind), len(center))
        return geometry.project(self.numbers, points, center, kinds, self.pixel_pitch)

    def magnification(self, distance: float) -> float:
        """Magnification of the lenslets, m = b/a, at a distance from the main lens [m]; negative if Galilean.

        Raises
        ------
        GeometryError
            A distance that is not above the focal length.
        """
        distance = checks.positive("distance", distance - self.focal_length) + self.focal_length
        image = self.focal_length * distance / (distance - self.focal_length)
        return self.lenslet_distance / (self.separation - image)


@dataclass(frozen=True, slots=True)
class Nominal:
    """Data sheet values of a camera, and their standard deviations.

    Parameters
    ----------
    focal_length
        Of the main lens [m].
    pixel_pitch
        Of the sensor [m].
    shape
        Rows and columns of the raw images: the axis is near their middle.
    focal_length_error
        Of the focal length, over it. Lens makers round to some percent.
    axis_error
        Of the axis [m].
    tilt_error
        Of the array against the lens [rad].
    exit_pupil_error
        Of L/E, which is 1 for a thin lens: real ones, and telecentric ones above all, are far from it.
    distortion_error
        At the corner of the picture, over the distance from the axis.
    decentring_error
        Of p1 and p2: lenses are centred to some thousandths.
    gain_error
        Of the kinds' gains.
    lenslet_distance, lenslet_distance_error
        Lenslets to sensor, b [m], and how well it is known, over itself: of a camera 1.0 the lenslets' focal
        length. None if it is not known; then a board whose squares are not as wide as they are said to be
        cannot be recognised.
    pitch_ratio, pitch_ratio_error
        Of the micro-images' pitch on the sensor to the lenslets', 1 + b/E, and how well it is known. It gives
        the exit pupil, and so f, L and distances. None if the lenslets' pitch is not known.

    Raises
    ------
    GeometryError
        A value that is not above 0.
    """

    focal_length: float
    pixel_pitch: float
    shape: tuple[int, int]
    focal_length_error: float = 0.02
    axis_error: float = 0.5e-3
    tilt_error: float = 5e-3
    exit_pupil_error: float = 1.0
    distortion_error: float = 0.05
    decentring_error: float = 5e-3
    gain_error: float = 0.2
    lenslet_distance: float | None = None
    lenslet_distance_error: float = 0.05
    pitch_ratio: float | None = None
    pitch_ratio_error: float = 3e-4

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", checks.shape("shape", self.shape))
        for one in fields(self):
            if one.name != "shape" and getattr(self, one.name) is not None:
                checks.positive(one.name, getattr(self, one.name), "1")

    @property
    def apart(self) -> Pair | None:
        """Pitch of micro-images over lenslets', and its standard deviation, if it is known."""
        return None if self.pitch_ratio is None else (self.pitch_ratio, self.pitch_ratio_error)

    @property
    def middle(self) -> Pair:
        """Middle of the sensor (y, x) [px]."""
        return (self.shape[0] - 1) / 2, (self.shape[1] - 1) / 2

    def priors(self, kinds: int) -> list[tuple[int, float, float]]:
        """(index, value, standard deviation) of what is known of a camera's `numbers`."""
        if not 1 <= kinds <= 3:
            raise CalibrationError(f"{kinds} kinds of lenslets but there must be 1 to 3.")
        axis = self.axis_error / self.pixel_pitch
        corner = np.hypot(*self.shape) / 2 * self.pixel_pitch / self.focal_length
        known = {
            "f": (self.focal_length, self.focal_length_error * self.focal_length),
            "L/E": (1.0, self.exit_pupil_error),
            "axis y": (self.middle[0], axis),
            "axis x": (self.middle[1], axis),
            "tilt y": (0.0, self.tilt_error),
            "tilt x": (0.0, self.tilt_error),
            "k1": (0.0, self.distortion_error / corner**2),
            "k2": (0.0, self.distortion_error / corner**4),
            "k3": (0.0, self.distortion_error / corner**6),
            "p1": (0.0, self.decentring_error),
            "p2": (0.0, self.decentring_error),
        }
        if self.lenslet_distance is not None:
            known["b"] = self.lenslet_distance, self.lenslet_distance_error * self.lenslet_distance
        gains = [(len(geometry.NAMES) + k, 1.0, self.gain_error) for k in range(kinds)]
        return [(geometry.NAMES.index(name), *values) for name, values in known.items()] + gains
