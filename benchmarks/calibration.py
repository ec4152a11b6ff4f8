"""White images of every size, pitch, angle and fault, drawn from a known lattice: right, refused or wrong.

Each case is drawn by its own number: a lattice of one of 12 pitches (6 to 80 px), square or hexagonal, turned
by up to 5 deg; discs, or squares with thin gaps; noise, dead lenslets, specks of dust, vignetting. Right is a
lattice of the same cells with each true centre within 0.02 of a pitch, or 0.1 px. Results are kept in a file
of JSON lines, so that a run goes on where it was stopped.

    python -m benchmarks.calibration [first:last] [--size 3000] [-o results.jsonl]
"""

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import lumigraph as lg

PITCHES = (6.0, 7.3, 9.1, 11.4, 15.3, 17.2, 21.7, 27.9, 35.0, 48.2, 63.5, 80.0)
ANGLE = 5.0
NOISE = (0.0, 0.03, 0.1)
_BLOCK = 256  # rows that are drawn at a time


@dataclass(frozen=True)
class Case:
    """A white image."""

    number: int
    size: int
    pitch: float
    layout: str
    angle: float
    square: bool
    fill: float
    noise: float
    dead: float
    specks: int
    vignetting: float

    @classmethod
    def of(cls, number: int, size: int) -> "Case":
        """The case of a number: pitches and layouts in turn, the rest by chance."""
        rng = np.random.default_rng(number)
        pitch, layout = PITCHES[number % 12], ("square", "hex")[number // 12 % 2]
        square = layout == "square" and rng.random() < 0.4
        return cls(
            number, size, pitch * float(rng.uniform(0.97, 1.03)), layout, float(rng.uniform(-ANGLE, ANGLE)),
            square, float(rng.uniform(0.6, 1 - 1.2 / pitch if square else 0.98)), float(rng.choice(NOISE)),
            float(rng.choice([0, 0.01])), int(rng.choice([0, 30])), float(rng.uniform(0, 0.7)),
        )  # fmt: skip

    @property
    def lattice(self) -> lg.Lattice:
        """Where its micro-images stand."""
        rng = np.random.default_rng([self.number, 1])
        origin = tuple(float(v) for v in rng.uniform(0, self.pitch, 2))
        return getattr(lg.Lattice, self.layout)(self.pitch, np.radians(self.angle), origin)

    def drawn(self) -> np.ndarray:
        """The picture (size, size), uint16."""
        rng, lattice = np.random.default_rng([self.number, 2]), self.lattice
        x = np.arange(self.size, dtype=float)
        specks = rng.uniform(0, self.size, (self.specks, 2)), rng.uniform(5, 60, self.specks)
        picture = np.empty((self.size, self.size), np.uint16)
        for first in range(0, self.size, _BLOCK):
            y = np.arange(first, min(first + _BLOCK, self.size), dtype=float)
            light = self._lit(y[:, None], x[None], lattice)
            light *= 1 - self.vignetting / 2 * sum(
                (2 * k / self.size - 1) ** 2 for k in (y[:, None], x[None])
            )
            for (cy, cx), radius in zip(*specks, strict=True):
                rows, columns = np.abs(y - cy) < radius, np.abs(x - cx) < radius
                if rows.any():
                    light[np.ix_(rows, columns)] *= 0.3
            light += self.noise * rng.standard_normal(light.shape)
            picture[first : first + _BLOCK] = np.clip(1e4 * light + 1500, 0, 65535)
        return picture

    def _lit(self, y: np.ndarray, x: np.ndarray, lattice: lg.Lattice) -> np.ndarray:
        """Part of each pixel that its micro-image covers, to a hundredth; dead ones cover none."""
        dy, dx = lattice.offset(y, x)
        if self.square:
            cos, sin = np.cos(lattice.rotation), np.sin(lattice.rotation)
            away = np.maximum(np.abs(dy * cos - dx * sin), np.abs(dx * cos + dy * sin))
        else:
            away = np.hypot(dy, dx)
        light = np.clip(self.fill * self.pitch / 2 - away + 0.5, 0, 1)
        if self.dead:
            i, j = lattice.index(y, x)
            chance = (i * 73856093 ^ j * 19349663) % 9973 / 9973
            light[chance < self.dead] = 0
        return light


@dataclass(frozen=True)
class Row:
    """What came of a case: `found` is "right", "wrong" or "refused"; `off` in px."""

    case: Case
    found: str
    off: float
    cpu: float
    message: str = ""


def judged(case: Case) -> Row:
    """The case, drawn and calibrated."""
    picture = case.drawn()
    start = time.process_time()
    try:
        found = lg.calibrate(picture)
    except lg.CalibrationError as error:
        return Row(case, "refused", 0.0, time.process_time() - start, str(error))
    cpu, truth = time.process_time() - start, case.lattice
    centers = truth.centers((0, case.size - 1), (0, case.size - 1))
    off = float(np.hypot(*np.array(found.offset(*centers[:: max(1, len(centers) // 20000)].T))).max())
    alike = abs(found.lattice.cell_area / truth.cell_area - 1) < 0.01
    right = alike and off < max(0.02 * case.pitch, 0.1)
    return Row(case, "right" if right else "wrong", off, cpu, "; ".join(found.notes))


def run(numbers: Iterable[int] = range(12), size: int = 3000, kept: Path | None = None) -> list[Row]:
    """Rows of cases; those in the file `kept` are not done again."""
    rows = read(kept) if kept is not None and kept.exists() else []
    done = {(row.case.number, row.case.size) for row in rows}
    for number in numbers:
        if (number, size) in done:
            continue
        rows.append(judged(Case.of(number, size)))
        if kept is not None:
            with kept.open("a") as file:
                file.write(json.dumps(asdict(rows[-1])) + "\n")
    return rows


def read(kept: Path) -> list[Row]:
    """Rows of a file of results."""
    found = [json.loads(line) for line in kept.read_text().splitlines()]
    return [Row(**{**each, "case": Case(**each["case"])}) for each in found]


def show(rows: Sequence[Row]) -> None:
    """Counts by size, and every case that is not right."""
    for size in sorted({row.case.size for row in rows}):
        these = [row for row in rows if row.case.size == size]
        counts = Counter(row.found for row in these)
        worst = max((row.off for row in these if row.found == "right"), default=0.0)
        print(
            f"{size:6} px: {counts['right']} right (to {worst:.3f} px), {counts['refused']} refused, "
            f"{counts['wrong']} wrong; {np.median([row.cpu for row in these]):.1f} CPU s"
        )
    for row in rows:
        if row.found != "right":
            print(row.found, f"{row.off:.2f} px", row.case, row.message)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("numbers", nargs="?", default="0:12")
    parser.add_argument("--size", type=int, default=3000)
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    first, last = (int(k) for k in given.numbers.split(":"))
    show(run(range(first, last), given.size, given.output))


if __name__ == "__main__":
    main()
