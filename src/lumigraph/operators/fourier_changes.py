r"""Derivatives of images of points before a Fourier microscope, by any part of the microscope.

Behind a lenslet the field is U = D P Dᵀ: P the wave on the lenslet, D the way from there to the pixels. The
derivative by P of a number made of the images and of their derivatives by place follows from one run
backwards, about as long as one forwards. P itself is cheap: its change with a focal length, a place or a mask
is the difference of two microscopes a little apart.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from lumigraph.elements.objective import Objective
from lumigraph.operators.fourier_microscope import Mosaic, View, half_window, legendre
from lumigraph.operators.fourier_points import FourierPoints

APART = 1e-5
"""Relative step of the waves' turn, whose differences are central."""

OF_EACH = ("centers", "focal_lengths")
"""What of a mosaic is the lenslets' own."""


@dataclass(frozen=True, slots=True, eq=False)
class Pupil:
    """Pupil of a lenslet, from which its images of points follow.

    Parameters
    ----------
    waves
        (z, n, n), of points on the axis at some depths; of their images the pixels are parts of the light.
    deeper
        (n, n), change of their phase with depth [rad/m].
    turn
        Of the phase, from side to side of the lenslet, per pixel that the image is away [rad].
    at, per_metre
        Place (y, x) of the image of the axis, from the sensor's middle pixel, and how far it moves as the
        point does [px, px/m].
    half, over
        Pixels to each side, nodes along each of them.
    made_of
        All that the others follow from: of two alike nothing differs.
    """

    waves: np.ndarray
    deeper: np.ndarray
    turn: float
    at: np.ndarray
    per_metre: float
    half: int
    over: int
    made_of: tuple[Any, ...]

    @property
    def across(self) -> np.ndarray:
        """(n,), places of the samples in widths of the lenslet."""
        n = len(self.deeper)
        return (np.arange(n) - (n - 1) / 2) / n

    @classmethod
    def of(
        cls, seen: tuple[Objective, Mosaic, int], depths: np.ndarray, share: float, like: Self | int
    ) -> Self:
        """Pupil of a lenslet at a wavelength, by a share of the light; sampled like another or by window."""
        objective, mosaic, j = seen
        made_of = (
            objective, *mosaic.centers[j].tolist(), float(mosaic.focal_lengths[j]), share,
            *(getattr(mosaic, one.name) for one in fields(mosaic) if one.name not in OF_EACH),
        )  # fmt: skip
        if isinstance(like, int):
            half, fine = like, None
        elif made_of == like.made_of:
            return like
        else:
            half, fine = like.half, (len(like.deeper), like.over)
        view = View.of(objective, mosaic, j, half, fine)
        deeper = 2 * np.pi / objective.wavelength * objective.depth_path(*view.q)
        wave = math.sqrt(share * view.scale) * view.amplitude * np.exp(1j * objective.phase(*view.q, 0.0))
        return cls(
            np.stack([wave * np.exp(1j * float(dz) * deeper) for dz in depths]), deeper,
            view.turn * mosaic.width, mosaic.centers[j] / mosaic.pixel_pitch,
            mosaic.total_magnification / mosaic.pixel_pitch, half, view.over, made_of,
        )  # fmt: skip


def pupils(
    points: FourierPoints,
    depths: np.ndarray,
    lit: np.ndarray,
    share: float = 1.0,
    like: list[Pupil] | None = None,
) -> list[Pupil]:
    """Pupils of each wavelength and lenslet.

    Parameters
    ----------
    points
        The microscope's.
    depths
        (z,) [m].
    lit
        Which lenslets (k,).
    share
        Of the light.
    like
        Of a microscope that hardly differs, to be sampled alike.
    """
    mosaic, share = points.mosaic.of(lit), share / points.whole / len(points.objectives)
    found: list[Pupil] = []
    for objective in points.objectives:
        half = half_window(objective, mosaic, depths.tolist())
        for j in range(len(mosaic.centers)):
            same = half if like is None else like[len(found)]
            found.append(Pupil.of((objective, mosaic, j), depths, share, same))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """Derivatives of a number by a pupil: by its waves (conjugate, halved), and by the rest of it."""

    waves: np.ndarray
    deeper: np.ndarray
    turn: float
    at: np.ndarray
    per_metre: float

    def along(self, first: Pupil, last: Pupil) -> float:
        """Change of the number from one pupil to another close by."""
        if first is last:
            return 0.0
        found = 2 * np.vdot(self.waves, last.waves - first.waves).real
        found += np.vdot(self.deeper, last.deeper - first.deeper)
        found += self.turn * (last.turn - first.turn) + self.at @ (last.at - first.at)
        return float(found + self.per_metre * (last.per_metre - first.per_metre))

    @classmethod
    def none(cls, pupil: Pupil) -> Self:
        """Slopes of a number that does not change."""
        return cls(np.zeros_like(pupil.waves), np.zeros_like(pupil.deeper), 0.0, np.zeros(2), 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Behind:
    """Light of a point behind a lenslet.

    Parameters
    ----------
    pupil, k
        And the number of the point's depth.
    across
        The point's (y, x) [m].
    nearest
        Pixel (y, x) around which the image is known, from the middle one.
    tilts
        (n, n), what a point beside the axis, and beside a pixel, turns the wave by.
    ways
        (m, n), from the samples to the pixels' nodes.
    fields
        (4, m, m), the field, and its changes by y, x and dz.
    """

    pupil: Pupil
    k: int
    across: np.ndarray
    nearest: np.ndarray
    tilts: np.ndarray
    ways: np.ndarray
    fields: np.ndarray

    @classmethod
    def of(cls, pupil: Pupil, k: int, across: np.ndarray, nearest: np.ndarray | None = None) -> Self:
        """Light of a point at (y, x) [m], around the nearest pixel or around one given."""
        at = pupil.at + pupil.per_metre * across
        nearest = np.round(at).astype(int) if nearest is None else nearest
        s, turn = pupil.across, pupil.turn
        nodes = legendre(pupil.over)[0] / 2
        fine = (np.arange(-pupil.half, pupil.half + 1)[:, None] + nodes).ravel()
        ways = np.exp(-1j * turn * np.outer(fine, s))
        down, right = np.exp(1j * turn * np.outer(at - nearest, s))
        tilts, slope = down[:, None] * right, 1j * turn * pupil.per_metre * s
        tilted = pupil.waves[k] * tilts
        rows = tilted @ ways.T
        waves = (
            rows, slope[:, None] * rows, (tilted * slope) @ ways.T, (1j * pupil.deeper * tilted) @ ways.T
        )  # fmt: skip
        return cls(pupil, k, across, nearest, tilts, ways, np.stack([ways @ one for one in waves]))

    @property
    def tilted(self) -> np.ndarray:
        """The wave as the point sends it (n, n)."""
        return self.pupil.waves[self.k] * self.tilts

    @property
    def _weights(self) -> np.ndarray:
        return legendre(self.pupil.over)[1]

    def lit(self) -> np.ndarray:
        """Pixels (4, w, w): the image, and its derivatives by y, x and dz."""
        light = (self.fields[0].conj() * self.fields).real * np.array([1, 2, 2, 2])[:, None, None]
        return self._pixels(light)

    def _pixels(self, light: np.ndarray) -> np.ndarray:
        """(k, w, w) of light on the nodes (k, m, m)."""
        count, weights = 2 * self.pupil.half + 1, self._weights
        nodes = light.reshape(-1, count, len(weights), count, len(weights))
        return np.einsum("kyixj,i,j->kyx", nodes, weights, weights, optimize=True)

    def changed(self, first: Pupil, last: Pupil) -> np.ndarray:
        """Change of the image (w, w) of a point on the axis from one pupil to another close by."""
        pupil, s, (down, right) = self.pupil, self.pupil.across, last.at - first.at
        moved = 1j * pupil.turn * (down * s[:, None] + right * s) * self.tilted
        moved += (last.waves[self.k] - first.waves[self.k]) * self.tilts
        light = 2 * (self.fields[0].conj() * (self.ways @ moved @ self.ways.T)).real
        return self._pixels(light)[0] + (last.turn - first.turn) * self._turned()[0]

    def back(self, given: np.ndarray, slopes: Slopes) -> Slopes:
        """Slopes by the pupil of a number whose slopes by `lit` (4, w, w) are given, beside those of others.

        By `per_metre`, an image stays where it is: places are parts of a pixel.
        """
        pupil, s, weights, back = self.pupil, self.pupil.across, self._weights, self.ways.conj()
        nodes = np.einsum("kyx,i,j->kyixj", given, weights, weights).reshape(self.fields.shape)
        own, slope = self.fields[0], -1j * pupil.turn * pupil.per_metre * s
        left = [back.T @ one for one in ((nodes * self.fields).sum(0), *(nodes[1:] * own))]
        deeper = left[3] @ back
        tilted = (left[0] + slope[:, None] * left[1]) @ back + (left[2] @ back) * slope
        tilted -= 1j * pupil.deeper * deeper
        turned = 2 * pupil.turn * (1j * tilted.conj() * self.tilted).real
        at = np.array([s @ turned.sum(1), s @ turned.sum(0)])
        own_slopes = (given[1:3] * self.lit()[1:3]).sum() / pupil.per_metre
        slopes.waves[self.k] += tilted * self.tilts.conj()
        by_phase = 2 * (1j * deeper.conj() * self.tilted).real
        return Slopes(
            slopes.waves, slopes.deeper + by_phase, slopes.turn + self._by_turn(given), slopes.at + at,
            slopes.per_metre + float(own_slopes),
        )  # fmt: skip

    def _by_turn(self, given: np.ndarray) -> float:
        return float(np.sum(given * self._turned()))

    def _turned(self) -> np.ndarray:
        """Change of `lit` with the waves' turn."""
        step = APART * self.pupil.turn
        sides = (replace(self.pupil, turn=self.pupil.turn + one) for one in (-step, step))
        low, high = (Behind.of(one, self.k, self.across, self.nearest).lit() for one in sides)
        return (high - low) / (2 * step)
