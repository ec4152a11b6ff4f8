"""Aberrations that change over the field: Zernike terms at some fields, known between them, and their plate.

A field is where light comes from: tangents (y, x) of the angles between the axis and the line from an object
point through the middle of the main lens, (y/z, x/z) of a point at (y, x) and a distance z.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from lumigraph.core import checks
from lumigraph.core.field import Field
from lumigraph.elements.zernike import ZernikePlate, noll_to_nm
from lumigraph.errors import GeometryError

SLACK = 1e-6
"""Part of the last field by which light may come from beyond it: rounding."""

NONE = 1e-6
"""Waves rms that are none."""

Nodes = tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ZernikeMap:
    """Zernike terms of a lens over the field and, where they are known, over wavelengths.

    Between the given fields and wavelengths terms follow splines through them, cubic where there are four or
    more. A line of fields suffices for a round lens: fields in other directions have its terms turned.

    Parameters
    ----------
    terms
        Noll's indices.
    values
        Coefficients (wavelengths, y, x, terms), rms: waves, or metres of path where `metres`. One wavelength
        and, of a round lens, one y where none are given.
    x
        Fields along x, tangents, ascending; of a round lens distances from the axis, the first of them 0.
    y
        Fields along y, tangents, ascending; None for a round lens.
    wavelengths
        Ascending [m]; None where terms are the same for all.
    metres
        True if coefficients are metres of path: waves of others at other wavelengths.

    Raises
    ------
    GeometryError
        Numbers that are not finite, fields or wavelengths that do not ascend, another number of values, terms
        of a round lens that no round lens has.

    Examples
    --------
    >>> values = np.array([[0.0, 0.0], [0.1, -0.2]]).reshape(1, 1, 2, 2)
    >>> coma = ZernikeMap((8, 4), values, x=(0.0, 0.1))
    >>> {j: round(c, 3) for j, c in coma.at(0.1, 0.0, 550e-9).items()}  # along y: Z7 in the place of Z8
    {4: -0.2, 7: 0.1, 8: 0.0}
    """

    terms: tuple[int, ...]
    values: np.ndarray
    x: Nodes
    y: Nodes | None = None
    wavelengths: Nodes | None = None
    metres: bool = False
    _spline: list = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        for j in self.terms:
            noll_to_nm(j)
        shape = (len(self.wavelengths or (0,)), len(self.y or (0,)), len(self.x), len(self.terms))
        if self.values.shape != shape or 0 in shape:
            raise GeometryError(
                f"the map has {self.values.shape} values but its wavelengths, fields and terms "
                f"ask for {shape}."
            )
        checks.finite_array("the map's values", self.values, GeometryError)
        for name, nodes in (
            ("fields along x", self.x),
            ("fields along y", self.y),
            ("wavelengths", self.wavelengths),
        ):
            if nodes is not None and not (np.isfinite(nodes).all() and (np.diff(nodes) > 0).all()):
                raise GeometryError(f"the map's {name} are {nodes} but must be finite and ascend.")
        if self.y is None:
            self._check_round()

    def _check_round(self) -> None:
        """A round lens is the same in a mirror through axis and field, and from all sides on the axis."""
        if self.x[0] != 0:
            raise GeometryError(
                f"the first field of a round lens is {self.x[0]:.6g} but must be 0, the axis. "
                "Give terms there."
            )
        largest = float(np.abs(self.values).max())
        for k, j in enumerate(self.terms):
            _, m = noll_to_nm(j)
            off = self.values[..., k] if m < 0 else self.values[:, :, 0, k] if m else np.zeros(1)
            if (worst := float(np.abs(off).max())) > 1e-6 * largest:
                where = "where the field lies along x" if m < 0 else "on the axis"
                raise GeometryError(
                    f"Noll term {j} is {worst:.6g} {where}, where no round lens has it. Give fields along y "
                    "and x for a lens that is not round."
                )

    @property
    def reach(self) -> tuple[float, float]:
        """Largest fields along y and x, or from the axis, that it knows [tangents]."""
        far = max(map(abs, self.x))
        return (far, far) if self.y is None else (max(map(abs, self.y)), far)

    def check(self, y: np.ndarray, x: np.ndarray) -> None:
        """Refuse fields that lie beyond the map's.

        Raises
        ------
        GeometryError
            There are some.
        """
        far, found = self.x[-1], np.hypot(y, x)
        outside = found > far * (1 + SLACK)
        if self.y is not None:
            outside = _beyond(y, self.y) | _beyond(x, self.x)
        if np.any(outside):
            worst = math.degrees(math.atan(float(np.max(np.where(outside, found, 0)))))
            raise GeometryError(
                f"light comes from {worst:.4g} degrees from the axis but the main lens' aberrations are "
                f"given to {math.degrees(math.atan(math.hypot(*self._ends()))):.4g} degrees. Give them "
                "farther out, or use a smaller object or sensor."
            )

    def nearest(self, y: float, x: float) -> tuple[float, float]:
        """The field nearest to (y, x) that it knows, of a lens that is not round."""
        assert self.y is not None  # asked by those who call
        return min(max(y, self.y[0]), self.y[-1]), min(max(x, self.x[0]), self.x[-1])

    def _ends(self) -> tuple[float, float]:
        return (0.0, self.x[-1]) if self.y is None else self.reach

    def at(self, y: float, x: float, wavelength: float) -> dict[int, float]:
        """Waves rms by Noll's index, of light from a field, tangents, and of a wavelength [m].

        Raises
        ------
        GeometryError
            A field or a wavelength that lies beyond the map's.
        """
        self.check(np.asarray(y), np.asarray(x))
        if self.y is not None:
            return dict(zip(self.terms, self._waves((y, x), wavelength).tolist(), strict=True))
        waves = self._waves((0.0, min(math.hypot(y, x), self.x[-1])), wavelength)
        plate = ZernikePlate(dict(zip(self.terms, waves.tolist(), strict=True)), 1.0)
        return dict(plate.turned(math.atan2(y, x)).coefficients)

    def _waves(self, at: tuple[float, float], wavelength: float) -> np.ndarray:
        values = self._at_wavelength(wavelength)
        for place, nodes in zip(at, (self.y, self.x), strict=True):
            values = values[0] if nodes is None else _through(nodes, values, place, self._parity)
        return values / wavelength if self.metres else values

    def _at_wavelength(self, wavelength: float) -> np.ndarray:
        """Coefficients (y, x, terms)."""
        if self.wavelengths is None:
            return self.values[0]
        if _beyond(np.asarray(wavelength), self.wavelengths).any():
            first, last = (self.wavelengths[k] * 1e9 for k in (0, -1))
            raise GeometryError(
                f"the wavelength is {wavelength * 1e9:.6g} nm but the aberrations of the main lens are given "
                f"from {first:.6g} to {last:.6g} nm. Give them at more wavelengths."
            )
        paths = self.values
        if not self.metres:  # a path is smooth over wavelengths; waves of it are not
            paths = paths * np.reshape(self.wavelengths, (-1, 1, 1, 1))
        found = _through(self.wavelengths, paths, wavelength, None)
        return found if self.metres else found / wavelength

    @property
    def _parity(self) -> np.ndarray | None:
        """Signs of the terms on the other side of a round lens' axis; None if fields lie on both sides."""
        return None if self.y is not None else np.array([(-1) ** (noll_to_nm(j)[1] % 2) for j in self.terms])


def _beyond(value: np.ndarray, nodes: Nodes) -> np.ndarray:
    slack = SLACK * max(map(abs, nodes))
    return (value < nodes[0] - slack) | (value > nodes[-1] + slack)


def _through(nodes: Nodes, values: np.ndarray, at: float, parity: np.ndarray | None) -> np.ndarray:
    """Values (n, ...) at nodes, for a place between them; a parity gives those on the axis' other side."""
    where = np.asarray(nodes)
    if parity is not None and len(nodes) > 1:
        where, values = (
            np.concatenate((-where[:0:-1], where)),
            np.concatenate((values[:0:-1] * parity, values)),
        )
    if len(where) == 1:
        return values[0]
    degree = min(3, len(where) - 1)
    return scipy.interpolate.make_interp_spline(where, values, k=degree)(at)


@dataclass(frozen=True, slots=True, eq=False)
class VignettedPupil:
    """Vignetted pupil of a round lens, seen from the image: an ellipse for each field.

    Parameters
    ----------
    x
        Fields, tangents, ascending from 0.
    wavelengths
        Ascending [m].
    axes
        Widths (wavelengths, fields, 2) along the field and across it, over the stop's diameter.
    middles
        Centres along the fields (fields,), over half of that diameter; None for the axis.
    """

    x: Nodes
    wavelengths: Nodes
    axes: np.ndarray
    middles: np.ndarray | None = None

    def at(self, field: float, wavelength: float) -> tuple[float, float]:
        """Widths along and across a field, a tangent, at one of the wavelengths of the aberrations [m]."""
        axes = _through(self.wavelengths, self.axes, wavelength, None)
        along, across = _through(self.x, axes, min(field, self.x[-1]), np.ones(2))
        return float(along), float(across)

    def middle(self, field: float) -> float:
        """Centre of the opening along a field, a tangent, over half of the stop's diameter."""
        if self.middles is None:
            return 0.0
        return float(_through(self.x, self.middles[:, None], min(field, self.x[-1]), -np.ones(1))[0])


@dataclass(frozen=True, slots=True, eq=False)
class FieldPlate:
    """Plate of a main lens whose aberrations change over the field, in a stop that is round on the axis.

    One field of light behind the lens does not show where each part came from: use the plate `at` a field.

    Parameters
    ----------
    aberrations
        Over the field.
    diameter
        Diameter of the stop and of the unit disc [m].
    more
        Waves rms by Noll's index that all fields have besides.
    openings
        Openings of a round lens whose stop looks different from each field; None for one round stop.
    """

    aberrations: ZernikeMap
    diameter: float
    more: tuple[tuple[int, float], ...] = ()
    openings: VignettedPupil | None = None

    def at(self, y: float, x: float, wavelength: float) -> ZernikePlate:
        """The plate for light from a field, tangents, of a wavelength [m].

        Raises
        ------
        GeometryError
            A field or a wavelength that lies beyond the map's.
        """
        waves = {j: rms for j, rms in self.aberrations.at(y, x, wavelength).items() if abs(rms) > NONE}
        for j, rms in self.more:
            waves[j] = waves.get(j, 0.0) + rms
        plate = ZernikePlate({j: 2 * math.pi * rms for j, rms in waves.items()}, self.diameter)
        if self.openings is None:
            return plate
        field, direction = math.hypot(y, x), math.atan2(y, x)
        away = self.openings.middle(field) * self.diameter / 2
        return replace(
            plate, axes=self.openings.at(field, wavelength), direction=direction,
            center=(away * math.sin(direction), away * math.cos(direction)),
        )  # fmt: skip

    def __call__(self, light: Field) -> Field:
        """Refuse a field: the phase of this plate depends on the direction of light."""
        raise GeometryError(OF_ONE_LENS)


OF_ONE_LENS = (
    "the main lens' aberrations change over the field, and light that interferes, snapshots, opaque slices "
    "and trains go through one lens for all fields. Use Incoherent() light, or leave over_field and "
    "prescription out."
)
