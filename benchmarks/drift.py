"""Raw images and calibrations that fit each other, and that do not: what the drift check says of them.

Raw images are drawn by rays and boxes: each micro-image shows the scene around its own place, magnified,
behind a stop with soft edges; then the pixels blur and add noise. Scenes are points, beads and stars before a
dark ground, gratings of every pitch, charts, textures, dark ones and a white one. Each is judged with the
right calibration, and with ones whose pitch is 1 % off or that are turned by 0.5 deg. A wrong pair should be
found where the scene lights most of the picture and there are gaps. Real raw images (LUMIGRAPH_DATA), too.

    python -m benchmarks.drift [first:last]
"""

import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage

import lumigraph as lg
from lumigraph.core.calibration import Calibration
from lumigraph.preparation.drift import Drift, drift, verdict

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")
REAL = {
    "guv": ("lfm_guv/Lightfield_GUVExperim1.tif", "lfm_guv/Radiometry_GUVExperim1.tif"),
    "letters": ("letters_plenoptic1/letters_ULF_M1.png", "letters_plenoptic1/letters_ULF_M1_white.png"),
    "brain": ("lfm_mouse_brain/LF_img_train_0.tif",) * 2,
    "worm": ("lfm_worm/20131219WORM2_small_full_neg_X1_N15_cropped_uncompressed.tif",) * 2,
}
NONE = np.zeros((0, 2))

Scene = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _spots(rng: np.random.Generator, count: int, size: float, shape: tuple[int, int]) -> Scene:
    """Blobs of all brightnesses before a dark ground."""
    places, light = rng.uniform(0, 1, (count, 2)) * shape, rng.uniform(0, 1, count) ** 3 + 0.05

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        total = np.zeros(y.shape, np.float32)
        for (cy, cx), one in zip(places, light, strict=True):
            near = (np.abs(y - cy) < 4 * size) & (np.abs(x - cx) < 4 * size)
            total[near] += one * np.exp(-((y[near] - cy) ** 2 + (x[near] - cx) ** 2) / (2 * size**2))
        return total

    return scene


def _grating(rng: np.random.Generator, pitch: float) -> Scene:
    """Bars of a pitch between a third of the lattice's and eight of it, often near a simple part of it."""
    period = pitch * (rng.choice([0.5, 1, 1.5, 2, 3]) * rng.uniform(0.96, 1.04) if rng.random() < 0.5
                      else np.exp(rng.uniform(np.log(0.33), np.log(8))))  # fmt: skip
    angle, depth = rng.uniform(0, np.pi), rng.uniform(0.3, 1)
    hard = rng.random() < 0.5

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        wave = np.sin(2 * np.pi * (y * np.sin(angle) + x * np.cos(angle)) / period)
        return 0.5 + 0.5 * depth * (np.sign(wave) if hard else wave)

    return scene


def _chart(rng: np.random.Generator, pitch: float) -> Scene:
    """Squares of a board, black ones not quite black."""
    period, angle, black = pitch * rng.uniform(0.6, 6), rng.uniform(0, 0.5), rng.uniform(0.02, 0.3)

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        u, v = y * np.cos(angle) - x * np.sin(angle), y * np.sin(angle) + x * np.cos(angle)
        return np.where(np.sin(np.pi * u / period) * np.sin(np.pi * v / period) > 0, 1.0, black)

    return scene


def _texture(rng: np.random.Generator, shape: tuple[int, int]) -> Scene:
    """A surface whose details of all sizes have alike contrast."""
    n = 256
    wave = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.fftfreq(n))
    wave[0, 0] = 1
    noise = np.fft.ifft2(np.fft.fft2(rng.standard_normal((n, n))) / wave).real
    noise = np.exp(0.7 * noise / noise.std())

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        at = np.stack([y * n / shape[0], x * n / shape[1]])
        return ndimage.map_coordinates(noise, at, order=1, mode="grid-wrap")

    return scene


KINDS = ("points", "beads", "stars", "grating", "chart", "texture", "dark", "white")
SAID = ("refused", "warned", "shifted", "fits", "nothing")
LIT = ("grating", "chart", "texture", "white")


@dataclass(frozen=True)
class Pair:
    """A raw image, its own calibration, and whether wrong ones should be found."""

    name: str
    raw: np.ndarray
    right: Calibration
    tells: bool


def drawn(number: int) -> Pair:
    """The raw image of a number."""
    rng = np.random.default_rng(number)
    kind = KINDS[number % len(KINDS)]
    pitch, layout = float(np.exp(rng.uniform(np.log(8), np.log(32)))), ("square", "hex")[number // 8 % 2]
    shape = tuple(int(pitch * rng.uniform(24, 44)) for _ in range(2))
    lattice = getattr(lg.Lattice, layout)(pitch, rng.uniform(-0.03, 0.03), tuple(rng.uniform(0, pitch, 2)))
    y, x = np.arange(shape[0], dtype=float)[:, None], np.arange(shape[1], dtype=float)[None]
    dy, dx = lattice.offset(y, x)
    # What a micro-image shows: its own place in focus (0), a little around it, or a whole patch (camera 2.0).
    zoom = float(rng.choice([0, rng.uniform(-0.6, 0.6), rng.uniform(-4, 4)]))
    at = y - dy + zoom * dy, x - dx + zoom * dx
    scenes: dict[str, Callable[[], Scene]] = {
        "points": lambda: _spots(rng, int(rng.integers(1, 8)), pitch * rng.uniform(0.1, 1), shape),
        "beads": lambda: _spots(rng, 30, pitch * rng.uniform(0.3, 2), shape),
        "stars": lambda: _spots(rng, 250, pitch * rng.uniform(0.05, 0.3), shape),
        "grating": lambda: _grating(rng, pitch),
        "chart": lambda: _chart(rng, pitch),
        "texture": lambda: _texture(rng, shape),
        "dark": lambda: _texture(rng, shape),
        "white": lambda: lambda y, x: np.ones(y.shape),
    }
    fill = float(rng.uniform(0.75, 0.95))
    raw = scenes[kind]()(*at) * np.clip(fill * pitch / 2 - np.hypot(dy, dx) + 0.5, 0, 1)
    raw = ndimage.gaussian_filter(raw, rng.uniform(0.3, 0.9))
    full = 30 if kind == "dark" else float(rng.choice([200, 2000, 20000]))
    raw = rng.poisson(np.maximum(raw, 0) * full) + rng.normal(20, 2, shape)
    right = Calibration(lattice, (shape[0], shape[1]), NONE.astype(int), NONE, 0.0)
    return Pair(f"{number} {kind}, {layout}, {pitch:.1f} px, zoom {zoom:.2f}", raw, right, kind in LIT)


def real() -> Iterable[Pair]:
    """Those of the data that are there; two have no white image and are calibrated alone."""
    for name, (raw, white) in REAL.items():
        if (DATA / raw).exists():
            yield Pair(name, lg.open(DATA / raw).data, lg.calibrate(lg.open(DATA / white)), name != "worm")


def wrong(right: Calibration) -> dict[str, Calibration]:
    """Calibrations with another pitch, and turned."""
    y, x = (n / 2 for n in right.shape)
    found = {}
    for name, scale, turn in (("pitch", 1.01, 0.0), ("turned", 1.0, np.radians(0.5))):
        cos, sin = scale * np.cos(turn), scale * np.sin(turn)
        move = np.array([[cos, sin], [-sin, cos]])
        points = [move @ vector for vector in right.lattice.basis]
        origin = move @ (np.array(right.lattice.origin) - (y, x)) + (y, x)
        lattice = replace(right.lattice, basis=tuple(map(tuple, points)), origin=tuple(origin))
        found[name] = replace(right, lattice=lattice)
    return found


@dataclass(frozen=True)
class Row:
    """What was said of one pair: "fits", "nothing", "shifted", "warned" or "refused"."""

    name: str
    pair: str
    tells: bool
    said: str
    found: Drift | None


def judged(pair: Pair) -> list[Row]:
    rows = []
    for name, calibration in {"right": pair.right, **wrong(pair.right)}.items():
        found = drift(pair.raw, calibration)
        rows.append(Row(pair.name, name, pair.tells, "nothing" if found is None else verdict(found), found))
    return rows


def run(numbers: Iterable[int] = range(64), *, also_real: bool = True) -> list[Row]:
    rows = [row for number in numbers for row in judged(drawn(number))]
    return rows + [row for pair in (real() if also_real else ()) for row in judged(pair)]


def is_bad(row: Row) -> bool:
    """Whether a right pair is doubted, or a wrong one, where it could be found, is not."""
    found = row.said in ("refused", "warned", "shifted")
    return found if row.pair == "right" else row.tells and not found


def show(rows: Sequence[Row]) -> None:
    """Counts for right and wrong pairs, and every pair of which something else should have been said."""
    for pair in ("right", "pitch", "turned"):
        for tells, name in ((True, "lit, with gaps"), (False, "others")):
            counts = Counter(row.said for row in rows if (row.pair, row.tells) == (pair, tells))
            print(f"{pair:7} {name:15}", *(f"{counts[word]:4} {word}" for word in SAID))
    for row in filter(is_bad, rows):
        print(row.pair, row.said, row.name, row.found)


if __name__ == "__main__":
    first, last = (int(k) for k in (sys.argv[1] if len(sys.argv) > 1 else "0:64").split(":"))
    show(run(range(first, last)))
