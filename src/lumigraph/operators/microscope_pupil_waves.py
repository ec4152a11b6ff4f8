r"""Sums of a pupil's plane waves behind a lattice of lenslets, as products of small matrices.

A sum over the nodes of a disc, of amplitudes times Bloch waves b(X; q), is one product along y and one along
x: amplitudes are spread onto an even grid along x that all rows share,

.. math:: b(X; q) \approx \sum_g w_g(q)\, b(X; q_g)

with weights of least squares (docs/theory/microscope.md). Where lenslets are not square waves have no axes
behind them: b are plane waves before them, whose sum goes on from there.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_array

from lumigraph.core.cache import remembered
from lumigraph.core.mirrored import Mirrored
from lumigraph.elements.disc import disc
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope_bench import factors, faded, finest_of, guard, transmission
from lumigraph.operators.microscope_cell import CellSampling, Lenslet
from lumigraph.operators.microscope_round import LensletWindow
from lumigraph.operators.microscope_waves import bloch, centred, over_cells

FINER = 2.0
"""Waves of an even grid, over as many as would just tell them apart."""

NEAR = 10
"""Waves of the grid that make one between them; fields err by 2 to 6 in 100,000."""

EDGES = 1
"""Lenslets beyond, to each side, from which their edges scatter light into a window."""


@dataclass(frozen=True, slots=True, eq=False)
class Waves:
    """Plane waves of a pupil behind the lenslets of a window, and their sampling.

    Parameters
    ----------
    q
        Of the nodes (rows, nodes), along y and x.
    area
        (rows, nodes).
    onto
        From the nodes of all rows to an even grid of each, (rows grid, rows nodes).
    down, across
        Waves (samples, rows) and (samples, grid), alike from both ends as the window and the nodes are: Bloch
        waves behind lenslets, or plane ones before a wider `window` of them.
    sampled
        From the fine grid to samples of the image (count, samples), along an axis.
    window
        Of lenslets that are not square.
    """

    q: tuple[np.ndarray, np.ndarray]
    area: np.ndarray
    onto: csr_array
    down: Mirrored
    across: Mirrored
    sampled: Mirrored
    window: LensletWindow | None

    @property
    def nbytes(self) -> int:
        """Memory of all arrays [bytes]."""
        return (
            self.down.nbytes + self.across.nbytes + self.sampled.nbytes + 3 * self.area.nbytes
            + self.onto.data.nbytes + self.onto.indices.nbytes
            + (self.window.nbytes if self.window else 0)
        )  # fmt: skip

    def fields(self, pupils: np.ndarray) -> np.ndarray:
        """Fields on the fine grid (k, n, n), of pupils (k, rows, nodes)."""
        even = of_each(self.onto, pupils, self.across.shape[1])
        return self.behind(self.down.down(self.across.right(even)))

    def behind(self, before: np.ndarray) -> np.ndarray:
        """Fields on the sensor (..., n, n), from those before a `window` of lenslets, if there is one."""
        return before if self.window is None else self.window.forward(before)

    def back(self, fields: np.ndarray) -> np.ndarray:
        """Conjugate transpose of `fields`."""
        seen = fields.conj()  # the waves are large: not they are conjugated
        if self.window is not None:
            seen = self.window.transposed(seen)
        rows = self.across.transposed.right(self.down.transposed.down(seen))
        return of_each(self.onto.T, rows, self.area.shape[1]).conj()

    def samples(self, light: np.ndarray) -> np.ndarray:
        """Samples (..., count, count) of intensities (..., n, n) on the fine grid."""
        return self.sampled.right(self.sampled.down(light))

    def spread(self, samples: np.ndarray) -> np.ndarray:
        """Transpose of `samples`."""
        back = self.sampled.transposed
        return back.right(back.down(samples))


def of_each(matrix: csr_array, planes: np.ndarray, columns: int) -> np.ndarray:
    """A real matrix times complex planes (k, rows, n): (k, rows, columns)."""
    k, rows, _ = planes.shape
    flat = np.ascontiguousarray(planes.reshape(k, -1).T).view(np.real(planes).dtype)
    found = (matrix @ flat).view(planes.dtype)
    return np.ascontiguousarray(found.T).reshape(k, rows, columns)


Told = tuple[int, int, int, str]
"""Cells of a window, samples of the light along a lenslet, nodes along a diameter, precision."""


@remembered
def waves_of(objective: Objective, lenslet: Lenslet, sampling: CellSampling, told: Told) -> Waves:
    """Waves of a window."""
    cells, fine, count, dtype = told
    real = "float64" if dtype == "complex128" else "float32"
    qy, qx, area = disc(count, count)
    onto = _onto(_turns(objective, lenslet) * qx, *_even(objective, lenslet, told))
    down, across = behind((objective, lenslet), (objective, lenslet), told)
    a = objective.aperture
    places = np.broadcast_to(a * qy, qx.shape), a * qx
    return Waves(
        (places[0], places[1]), area * a**2, csr_array(onto, dtype=real), Mirrored.of(down),
        Mirrored.of(across), Mirrored.of(sampling_matrix(cells, fine, sampling).astype(real)),
        window_of((objective, lenslet), (objective, lenslet), told),
    )  # fmt: skip


def behind(
    own: tuple[Objective, Lenslet], like: tuple[Objective, Lenslet], told: Told
) -> tuple[np.ndarray, np.ndarray]:
    """Waves (samples, rows) and (samples, grid) of an objective and lenslets, as `Waves` has them.

    At places in the pupil, and with as fine a series of a lenslet, as `like` others ask for, which hardly
    differ.
    """
    (objective, lenslet), (cells, fine, count, dtype) = own, told
    step, number = _even(*like, told)
    wide = cells + 2 * margin_cells(*like)
    turns = _turns(objective, lenslet)
    grid = (np.arange(number) - number // 2) * step * (turns / _turns(*like))
    rows = turns * disc(count, count)[0][:, 0]

    def waves(at: np.ndarray) -> np.ndarray:
        if lenslet.is_round:
            found = np.exp(2j * np.pi * np.outer(at, centred(fine)))
        else:
            found = bloch(lenslet, objective.wavelength, at, finest_of(*like, fine), centred(fine))
        return over_cells(found.astype(dtype), at, wide).T

    return waves(rows), waves(grid)


def window_of(
    own: tuple[Objective, Lenslet], like: tuple[Objective, Lenslet], told: Told
) -> LensletWindow | None:
    """Lenslets that are not square, as finely as `behind` has it."""
    (objective, lenslet), (cells, fine, _, dtype) = own, told
    if not lenslet.is_round:
        return None
    margin = margin_cells(*like)
    wide = cells + 2 * margin
    border = faded(wide, fine)
    one = transmission(lenslet, objective.wavelength, finest_of(*like, fine), fine)
    lenslets = np.tile(one, (wide, wide)) * np.outer(border, border)
    curve = np.pi * objective.wavelength * lenslet.distance / lenslet.pitch**2
    path = np.exp(-1j * curve * np.fft.fftfreq(wide * fine, 1 / fine) ** 2)
    return LensletWindow(lenslets.astype(dtype), path.astype(dtype), margin * fine)


def margin_cells(objective: Objective, lenslet: Lenslet) -> int:
    """Cells beyond, to each side, whose light is followed on a grid."""
    return guard(objective, lenslet) + EDGES if lenslet.is_round else 0


def _turns(objective: Objective, lenslet: Lenslet) -> float:
    """Periods in a pitch of the wave at the pupil's rim."""
    return objective.aperture * lenslet.pitch / (objective.wavelength * lenslet.magnification)


def _even(objective: Objective, lenslet: Lenslet, told: Told) -> tuple[float, int]:
    """Step of an even grid of turns in a pitch, and how many they are."""
    cells, _, count, _ = told
    step = 1 / (2 * FINER * (cells / 2 + guard(objective, lenslet) + EDGES))
    most = float(np.abs(_turns(objective, lenslet) * disc(count, count)[1]).max())
    return step, 2 * (math.ceil(most / step) + NEAR // 2) + 1


def _onto(turns: np.ndarray, step: float, count: int) -> csr_array:
    """Matrix that spreads amplitudes of nodes of some turns (rows, nodes) onto a grid, row by row."""
    near, at = np.arange(NEAR), turns.ravel() / step + count // 2
    first = np.floor(at).astype(int) - NEAR // 2 + 1
    alike = np.sinc((near[:, None] - near) / FINER)
    weights = np.linalg.solve(alike, np.sinc((at - first - near[:, None]) / FINER))
    row, node = np.repeat(np.arange(len(turns)), turns.shape[1]), np.arange(turns.size)
    places = (row * count + first + near[:, None]).ravel(), np.tile(node, NEAR)
    return csr_array((weights.ravel(), places), (len(turns) * count, turns.size))


@lru_cache(maxsize=8)
def sampling_matrix(cells: int, fine: int, sampling: CellSampling) -> np.ndarray:
    """Matrix (cells N, cells fine) of what samples make of light; dark beyond the window."""
    wide = cells + 2
    n, count = wide * fine, wide * sampling.pixels
    spectrum = factors(n, fine, sampling)[:, None] * np.fft.fft(np.eye(n), axis=0)
    folded = np.zeros((count, n), np.complex128)
    np.add.at(folded, np.rint(np.fft.fftfreq(n) * n).astype(int) % count, spectrum)
    whole = np.fft.ifft(folded, axis=0).real * (count / n)
    return whole[sampling.pixels : -sampling.pixels, fine:-fine]
