r"""Images of points behind the lenslets of a microscope as functions of its pupil's phase, with derivatives.

Before a lattice of square lenslets a plane wave of the pupil becomes a Bloch wave b along each axis. The
field on the sensor is one product of small matrices with the pupil, U = B_y P B_x, and so is its change with
the pupil's phase φ:

.. math:: dU = B_y (i \varphi P) B_x, \quad d|U|^2 = 2 \mathrm{Re}(U^* dU)

Before round lenslets b are plane waves (`round_lenslets`). A point's place changes the phase, too. See
docs/theory/microscope.md.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.cache import remembered
from lumigraph.elements.disc import disc
from lumigraph.elements.objective import Objective
from lumigraph.elements.zernike import noll_to_nm, zernike
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.microscope.bench import fineness
from lumigraph.operators.microscope.building import SampledLenslets
from lumigraph.operators.microscope.cell import Lenslet
from lumigraph.operators.microscope.kernels import KernelAccuracy, margin_of, reach_of
from lumigraph.operators.microscope.pupil_waves import PupilWaves, Told, margin_cells, waves_of
from lumigraph.operators.sampling.resampling import Part, Resampling
from lumigraph.scene import Points

BLOCK = 2**21
"""Numbers of fields that are held at a time."""

Factor = Callable[[Objective, np.ndarray, np.ndarray], np.ndarray]
"""Of the amplitudes (rows, nodes) of an objective's pupil at n sin θ along y and x."""

BRIGHT, AROUND = 0.9, 24
"""Part of the pupil whose light the repeated image must not bring into a window, and nodes more for what is
diffracted beyond: of 40 points drawn before a 20x/0.5, with up to 1 wave rms, none needed more than 24.
"""

PLACES = 3
"""Derivatives by a point's place: y, x, dz."""


@dataclass(frozen=True, slots=True, eq=False)
class PupilPointImage:
    """A point's image in the window around its own cell, and its derivatives.

    Parameters
    ----------
    image
        (count, count).
    changes
        (directions, count, count): by default by each coefficient [1/waves rms], then by y, x and dz [1/m].
    cell
        Row and column of the point's own cell, in the window's middle; may lie beside the layout's.
    """

    image: np.ndarray
    changes: np.ndarray
    cell: tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class PupilImages:
    r"""Images of points before a microscope, for any Zernike terms c_j of its pupil, with derivatives by c_j.

    .. math:: I(c) = \sum_p o_p |U_p(c)|^2, \quad
              \frac{\partial I}{\partial c_j} = \sum_p o_p\, 2 \mathrm{Re}(U_p^* \partial_j U_p)

    Points shine as samples of `object_grid` of intensity 1 do. What light leaves a window of cells around the
    point's own is left out: a share of the accuracy.

    Parameters
    ----------
    objectives
        One for each wavelength, with the aberrations that are known already.
    lenslet, layout
        The array, and the pixels.
    terms
        Noll indices of the coefficients.
    accuracy
        Relative rms error of points' images.
    double
        Whether to compute in double precision; for checks.

    Raises
    ------
    GeometryError
        Rays, terms that repeat.
    """

    objectives: tuple[Objective, ...]
    lenslet: Lenslet
    layout: SampledLenslets
    terms: tuple[int, ...]
    accuracy: float = 1e-2
    double: bool = False

    def __post_init__(self) -> None:
        require_phase(self.objectives)
        for j in self.terms:
            noll_to_nm(j)
        if len(set(self.terms)) < len(self.terms):
            raise GeometryError(f"terms are {self.terms} but each must stand once.")

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (ny, nx) of a raw image."""
        if self.layout.placement is not None:
            ny, nx = self.layout.placement.shape[0]
            return ny, nx
        return self.samples

    @property
    def samples(self) -> tuple[int, int]:
        """Samples (y, x) of the layout."""
        N = self.layout.sampling.pixels
        return self.layout.cells[0] * N, self.layout.cells[1] * N

    def fixed(self, coefficients: np.ndarray) -> "PupilImages":
        """The same with these coefficients (terms,) [waves rms] among the known ones, and no terms left."""
        c = self._checked("coefficients", coefficients)
        objectives = []
        for objective in self.objectives:
            known = dict(objective.aberrations)
            for j, waves in zip(self.terms, c, strict=True):
                known[j] = known.get(j, 0.0) + float(waves)
            objectives.append(replace(objective, aberrations=known))
        return replace(self, objectives=tuple(objectives), terms=())

    def forward(self, points: Points, coefficients: np.ndarray) -> np.ndarray:
        """Raw image (ny, nx) of points, for coefficients (terms,) [waves rms]."""
        whole = np.zeros(self.samples)
        for light, lit in self._each(points, coefficients, np.zeros((0, 0))):
            self.add(whole, light * lit.image, lit.cell)
        return self.placed(whole)

    def derivative(self, points: Points, coefficients: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Change (ny, nx) of `forward` per unit of a change (terms,) of the coefficients."""
        direction = np.append(self._checked("change", change), np.zeros(PLACES))
        whole = np.zeros(self.samples)
        for light, lit in self._each(points, coefficients, direction[None]):
            self.add(whole, light * lit.changes[0], lit.cell)
        return self.placed(whole)

    def gradient(self, points: Points, coefficients: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivative`: (terms,) from weights (ny, nx) of the raw image's pixels."""
        if weights.shape != self.shape:
            raise GeometryError(f"weights have shape {weights.shape} but the raw image {self.shape}.")
        plane = weights if self.layout.placement is None else self.layout.placement.adjoint(weights)
        found = np.zeros(len(self.terms))
        for waves, pupil, phases, numbers in self._groups(points, coefficients):
            for p in numbers:
                place, cell = self._place(points.positions[p])
                own = _moved(pupil, phases, np.append(coefficients, place))
                seen = self.cut(plane, cell, waves.sampled.shape[0])
                fields = waves.fields(own)
                fields *= waves.spread(seen.astype(np.real(fields).dtype))
                # Re(conj(G) i φ P) = φ Im(G conj(P)): the phases are real.
                turned = np.imag(waves.back(fields) * own.conj()).sum(0, dtype=np.float64)
                light = 2 * self.unit * points.intensities[p]
                found += light * np.tensordot(phases[: len(found)], turned, 2)
        return found

    def lit(
        self, points: Points, coefficients: np.ndarray, directions: np.ndarray | None = None
    ) -> Iterator[PupilPointImage]:
        """Image and derivatives of each point of intensity 1, in order of the points.

        Along directions (k, terms + 3), the last three of y, x and dz; all single ones if left out.
        """
        along = np.eye(len(self.terms) + PLACES) if directions is None else directions
        return (lit for _, lit in self._each(points, coefficients, along))

    def through(self, position: np.ndarray, factor: Factor, away: float) -> np.ndarray:
        """Samples of the layout, of a point of 1 whose pupil's amplitudes are multiplied by a factor.

        Its image's window, and its pupil's nodes, are those of a point `away` [m] from the focused plane.
        """
        whole, (place, cell) = np.zeros(self.samples), self._place(position)
        for objective in self.objectives:
            size = self._size(objective, away)
            waves, phases = self._waves(objective, *size), self.phases(objective, size[2])
            pupil = objective.pupil(*waves.q, 0.0) * waves.area * factor(objective, *waves.q)
            own = _moved(pupil.astype(waves.across.even.dtype), phases, place)
            self.add(whole, self._one(waves, own, phases[:0])[0] * self.unit, cell)
        return whole

    def cells_at(self, dz: float) -> int:
        """Number of cells along the window of a point's image at a depth [m], without coefficients."""
        return max(self._size(objective, dz)[0] for objective in self.objectives)

    def share(self, dz: float) -> float:
        """Part of the layout that the window of a point at a depth [m] takes, without coefficients."""
        return min(1.0, self.cells_at(dz) ** 2 / math.prod(self.layout.cells))

    def placed(self, samples: np.ndarray) -> np.ndarray:
        """Raw image (ny, nx) of samples of the layout."""
        return samples if self.layout.placement is None else self.layout.placement.forward(samples)

    def seen(self, images: np.ndarray, cell: tuple[int, int]) -> tuple[Part, np.ndarray]:
        """Part of the raw image that images (k, n, n) of a window around a cell light, and its pixels.

        Rows and columns, and (k, rows, columns).
        """
        (rows, own_rows), (columns, own_columns) = self._window(cell, images.shape[-1])
        own, placement = images[:, own_rows, own_columns], self.layout.placement
        if placement is None:
            return (rows, columns), own
        if isinstance(placement, Resampling):
            return placement.of_part((rows, columns), own)
        planes = np.zeros((len(own), *self.samples))
        planes[:, rows, columns] = own
        pixels = np.stack([placement.forward(plane) for plane in planes])
        lit = np.abs(pixels).sum(0)
        part = _between(lit.sum(1)), _between(lit.sum(0))
        return part, pixels[:, part[0], part[1]]

    def _each(
        self, points: Points, coefficients: np.ndarray, directions: np.ndarray
    ) -> Iterator[tuple[float, PupilPointImage]]:
        found: list[PupilPointImage | None] = [None] * len(points.intensities)
        for waves, pupil, phases, numbers in self._groups(points, coefficients):
            along = directions.astype(phases.dtype)
            combined = np.tensordot(along, phases, 1) if directions.size else phases[:0]
            for p in numbers:
                place, cell = self._place(points.positions[p])
                own = _moved(pupil, phases, np.append(coefficients, place))
                one = self._one(waves, own, combined)
                image, changes = (part * self.unit for part in one)
                before = found[p]
                if before is not None:
                    image, changes = before.image + image, before.changes + changes
                found[p] = PupilPointImage(image, changes, cell)
        return ((float(light), lit) for light, lit in zip(points.intensities, found, strict=True) if lit)

    def _one(self, waves: PupilWaves, pupil: np.ndarray, phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Image of a pupil (modes, rows, nodes) and its derivatives by phases (k, rows, nodes)."""
        fields = waves.fields(pupil)
        image = waves.samples(np.sum([_crossed(field.copy(), field) for field in fields], axis=0))
        changes = np.zeros((len(phases), *image.shape), image.dtype)
        step = max(1, BLOCK // fields.size)
        for first in range(0, len(phases), step):
            some = phases[first : first + step]
            for field, mode in zip(fields, pupil, strict=True):
                moved = waves.fields(some * (2j * mode).astype(mode.dtype))
                changes[first : first + step] += waves.samples(_crossed(moved, field))
        return image, changes

    def _groups(
        self, points: Points, coefficients: np.ndarray
    ) -> Iterator[tuple[PupilWaves, np.ndarray, np.ndarray, list[int]]]:
        """Groups of points whose windows are alike: waves, known pupil (modes, rows, nodes), phases."""
        for objective, bent in zip(self.objectives, self.fixed(coefficients).objectives, strict=True):
            alike: dict[tuple[int, int, int], list[int]] = {}
            for p, (_, _, dz) in enumerate(points.positions):
                alike.setdefault(self._size(bent, float(dz)), []).append(p)
            for size, numbers in alike.items():
                waves = self._waves(objective, *size)
                pupil = self.pupil(objective, size[2])
                yield waves, pupil, self.phases(objective, size[2]), numbers

    def _size(self, objective: Objective, dz: float) -> tuple[int, int, int]:
        """Cells along a window, samples of the light along a lenslet, nodes along the pupil's diameter.

        A sum over N nodes repeats the image after 2 N/(k NA), which must keep the light out of the window.
        """
        limit = math.ceil(1.5 * max(self.layout.cells))
        cells = 2 * reach_of(objective, self.lenslet, dz, KernelAccuracy(self.accuracy, limit)) + 1
        away = cells / 2 * self.lenslet.pitch / self.lenslet.magnification
        nodes = objective.steepest(away, dz, BRIGHT) / 2 + AROUND
        margin = margin_of(objective, self.lenslet, dz, KernelAccuracy(self.accuracy, 1))
        return cells, fineness(objective, self.lenslet, margin), 24 * math.ceil(nodes / 24)

    def sampled(self, objective: Objective, dz: float) -> tuple[Told, PupilWaves]:
        """Sampling of a window of a point at a depth, and its waves."""
        cells, fine, nodes = self._size(objective, dz)
        return (cells, fine, nodes, self._dtype), self._waves(objective, cells, fine, nodes)

    @property
    def _dtype(self) -> str:
        return "complex128" if self.double else "complex64"

    def pupil(self, objective: Objective, nodes: int) -> np.ndarray:
        """Amplitudes (modes, rows, nodes), their areas in them."""
        return _pupil(objective, nodes, self._dtype)

    def phases(self, objective: Objective, nodes: int) -> np.ndarray:
        """Phase [rad] per unit of each term, of y, x and dz (k, rows, nodes)."""
        plain = replace(objective, aberrations=())
        return _phases(plain, nodes, self.terms, "float64" if self.double else "float32")

    def _waves(self, objective: Objective, cells: int, fine: int, nodes: int) -> PupilWaves:
        dtype = self._dtype
        wide = cells + 2 * margin_cells(objective, self.lenslet)
        terms, fields = len(self.terms) + PLACES, objective.modes * (wide * fine) ** 2
        needed = np.dtype(dtype).itemsize * ((12.0 + terms) * nodes**2 + 4.0 * (fields + BLOCK))
        what = f"the pupil's waves behind {cells} x {cells} lenslets"
        memory.require(needed, what, "Use points nearer to the focused plane.", SamplingError)
        plain = replace(objective, aberrations=())
        return waves_of(plain, self.lenslet, self.layout.sampling, (cells, fine, nodes, dtype))

    @property
    def unit(self) -> float:
        """Area of a sample of the object, shared among wavelengths, that pixels take light of [m²]."""
        sampling = self.layout.sampling
        pitch = self.lenslet.pitch / self.lenslet.magnification / sampling.points
        return sampling.light * pitch**2 / len(self.objectives)

    def _place(self, position: np.ndarray) -> tuple[np.ndarray, tuple[int, int]]:
        cell = self.cell_of(position)
        return self.within(position, cell), cell

    def cell_of(self, position: np.ndarray) -> tuple[int, int]:
        """Row and column of the cell that a point (y, x, dz) stands in."""
        y, x = np.floor(self._cells(position) + 0.5).astype(int).tolist()
        return y, x

    def within(self, position: np.ndarray, cell: tuple[int, int]) -> np.ndarray:
        """A point (y, x) from a cell's middle, and dz [m]."""
        size = self.lenslet.pitch / self.lenslet.magnification
        return np.append((self._cells(position) - cell) * size, position[2])

    def _cells(self, position: np.ndarray) -> np.ndarray:
        """A point's (y, x), from the first cell's middle [cells]."""
        size, center = self.lenslet.pitch / self.lenslet.magnification, np.array(self.layout.center)
        return (position[:2] - center) / size + (np.array(self.layout.cells) - 1) / 2

    def _window(self, cell: tuple[int, int], count: int) -> list[tuple[slice, slice]]:
        """Part of a window around a cell, along y and x: the layout's samples, and its own."""
        found, N = [], self.layout.sampling.pixels
        for k, n in zip(cell, self.samples, strict=True):
            first = k * N - (count - N) // 2
            start, stop = (min(max(at, 0), n) for at in (first, first + count))
            found.append((slice(start, stop), slice(start - first, stop - first)))
        return found

    def add(self, whole: np.ndarray, image: np.ndarray, cell: tuple[int, int]) -> None:
        """Adds images of a window (..., count, count) around a cell to samples of the layout."""
        (rows, own_rows), (columns, own_columns) = self._window(cell, image.shape[-1])
        whole[..., rows, columns] += image[..., own_rows, own_columns]

    def cut(self, whole: np.ndarray, cell: tuple[int, int], count: int) -> np.ndarray:
        """Transpose of `add`."""
        (rows, own_rows), (columns, own_columns) = self._window(cell, count)
        found = np.zeros((count, count))
        found[own_rows, own_columns] = whole[rows, columns]
        return found

    def _checked(self, name: str, values: np.ndarray) -> np.ndarray:
        found = np.asarray(values, np.float64)
        if found.shape != (len(self.terms),):
            raise GeometryError(f"{name} have shape {found.shape} but there are {len(self.terms)} terms.")
        checks.finite_array(name, found, GeometryError)
        return found


def require_phase(objectives: Sequence[Objective]) -> None:
    """Refuse microscopes whose images are no products of waves of the pupil.

    Raises
    ------
    GeometryError
        Rays.
    """
    if any(one.model == "rays" for one in objectives):
        raise GeometryError("model 'rays' has no phase. Use 'scalar', 'vector' or 'paraxial'.")


@remembered
def _phases(objective: Objective, count: int, terms: tuple[int, ...], dtype: str) -> np.ndarray:
    """Phase [rad] per unit of each term, of y, x and dz (k, rows, nodes)."""
    qy, qx, _ = _nodes(objective, count)
    rho, angle = np.hypot(qy, qx) / objective.numerical_aperture, np.arctan2(qy, qx)
    k = 2 * np.pi / objective.wavelength
    own = [2 * np.pi * zernike(j, rho, angle) for j in terms]
    return np.stack([*own, -k * qy, -k * qx, k * objective.depth_path(qy, qx)]).astype(dtype)


@remembered
def _pupil(objective: Objective, count: int, dtype: str) -> np.ndarray:
    """Amplitudes (modes, rows, nodes) of nodes, their areas in them."""
    qy, qx, area = _nodes(objective, count)
    return (objective.pupil(qy, qx, 0.0) * area).astype(dtype)


def _nodes(objective: Objective, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places n sin θ (rows, nodes) along y and x, and areas."""
    y, x, area = disc(count, count)
    a = objective.aperture
    return np.broadcast_to(a * y, x.shape), a * x, area * a**2


def _between(lit: np.ndarray) -> slice:
    """Slice from the first element that is not dark to the last."""
    found = np.flatnonzero(lit)
    return slice(int(found[0]), int(found[-1]) + 1) if len(found) else slice(0, 0)


def _crossed(fields: np.ndarray, field: np.ndarray) -> np.ndarray:
    """Re(a* b) of fields a (..., y, x), which are used up, and a field b."""
    numbers = fields.view(np.real(field).dtype)
    numbers *= field.view(numbers.dtype)
    return numbers[..., 0::2] + numbers[..., 1::2]


def _moved(pupil: np.ndarray, phases: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The pupil with so much of the last phases, such as of a point's place (y, x, dz)."""
    turn = np.tensordot(by.astype(phases.dtype), phases[-len(by) :], 1)
    turned = np.empty(turn.shape, pupil.dtype)
    turned.real, turned.imag = np.cos(turn), np.sin(turn)  # 4 times as fast as np.exp(1j * turn)
    return pupil * turned
