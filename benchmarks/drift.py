"""Raw images and calibrations that fit each other, and that do not: what the drift check says of them.

Scenes are points, beads and stars before a dark ground, gratings of every pitch, charts, textures, dark ones,
a white one, and edges behind which it is dark or nearly so, over few lenslets, too. Their raw images are
drawn by rays and boxes (each micro-image shows the scene around its own place, magnified, behind a stop with
soft edges), or simulated by wave optics for cameras of several kinds; then pixels add noise. Each is judged
with the right calibration, and with ones whose pitch is 1 % off or that are turned by 0.5 deg. A wrong pair
should be found where the raw image has gaps (`gaps`, measured on it), where at least half of the places
between lenslets are dark beside the light around them, and where it slips by the 0.1 of a pitch towards the
border that is warned of. Real raw images (LUMIGRAPH_DATA), too. Results are kept in a file of JSON lines, so
that a run goes on where it was stopped.

    python -m benchmarks.drift [drawn | simulated | edges | real] [first:last] [-o results.jsonl]
"""

import argparse
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

import lumigraph as lg
from lumigraph.core.calibration import Calibration
from lumigraph.instruments import FocusedPlenopticCamera, PlenopticCamera
from lumigraph.preparation.drift import drift, verdict

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")
REAL = {
    "guv": ("lfm_guv/Lightfield_GUVExperim1.tif", "lfm_guv/Radiometry_GUVExperim1.tif"),
    "guv, white": ("lfm_guv/Radiometry_GUVExperim1.tif",) * 2,
    "guv, alone": ("lfm_guv/Lightfield_GUVExperim1.tif",) * 2,
    "guv by rays": (
        "lfm_guv_simulated/LightField_GUVSimul1.tif",
        "lfm_guv_simulated/Radiometry_GUVSimul1.tif",
    ),
    "letters": ("letters_plenoptic1/letters_ULF_M1.png", "letters_plenoptic1/letters_ULF_M1_white.png"),
    "letters, white": ("letters_plenoptic1/letters_ULF_M1_white.png",) * 2,
    "letters, alone": ("letters_plenoptic1/letters_ULF_M1.png",) * 2,
    "brain": ("lfm_mouse_brain/LF_img_train_0.tif",) * 2,
    "worm": ("lfm_worm/20131219WORM2_small_full_neg_X1_N15_cropped_uncompressed.tif",) * 2,
    "raytrix": ("raytrix_r42_multifocus/sc2_klein.png",) * 2,
}
_LEAST, _DARK = 0.05, 0.5  # of a bright lenslet's light, to be lit; of the light around, to be a gap
_MOST = 0.5  # of the places between lenslets, that are gaps where a raw image has gaps
_WARNED = 0.1  # pitches at the border
NONE = np.zeros((0, 2))

Seen = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _spots(rng: np.random.Generator, count: int, size: float, shape: tuple[int, int]) -> Seen:
    """Blobs of all brightnesses before a dark ground."""
    places, light = rng.uniform(0, 1, (count, 2)) * shape, rng.uniform(0, 1, count) ** 3 + 0.05

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        total = np.zeros(y.shape, np.float32)
        for (cy, cx), one in zip(places, light, strict=True):
            near = (np.abs(y - cy) < 4 * size) & (np.abs(x - cx) < 4 * size)
            total[near] += one * np.exp(-((y[near] - cy) ** 2 + (x[near] - cx) ** 2) / (2 * size**2))
        return total

    return scene


def _grating(rng: np.random.Generator, pitch: float) -> Seen:
    """Bars of a pitch between a third of the lattice's and eight of it, often near a simple part of it."""
    period = pitch * (rng.choice([0.5, 1, 1.5, 2, 3]) * rng.uniform(0.96, 1.04) if rng.random() < 0.5
                      else np.exp(rng.uniform(np.log(0.33), np.log(8))))  # fmt: skip
    angle, depth = rng.uniform(0, np.pi), rng.uniform(0.3, 1)
    hard = rng.random() < 0.5

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        wave = np.sin(2 * np.pi * (y * np.sin(angle) + x * np.cos(angle)) / period)
        return 0.5 + 0.5 * depth * (np.sign(wave) if hard else wave)

    return scene


def _chart(rng: np.random.Generator, pitch: float) -> Seen:
    """Squares of a board, black ones not quite black."""
    period, angle, black = pitch * rng.uniform(0.6, 6), rng.uniform(0, 0.5), rng.uniform(0.02, 0.3)

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        u, v = y * np.cos(angle) - x * np.sin(angle), y * np.sin(angle) + x * np.cos(angle)
        return np.where(np.sin(np.pi * u / period) * np.sin(np.pi * v / period) > 0, 1.0, black)

    return scene


def _texture(rng: np.random.Generator, shape: tuple[int, int]) -> Seen:
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


def _edge(rng: np.random.Generator, shape: tuple[int, int]) -> Seen:
    """A bright part of the picture and a black one, or one that is not quite black."""
    angle, black = rng.uniform(0, 2 * np.pi), float(rng.choice([0, rng.uniform(0, 0.3)]))
    cy, cx = rng.uniform(0.2, 0.8, 2) * shape
    steep = rng.random() < 0.5
    angle = np.round(angle / (np.pi / 2)) * np.pi / 2 + rng.uniform(-0.1, 0.1) if steep else angle

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        return np.where((y - cy) * np.sin(angle) + (x - cx) * np.cos(angle) > 0, 1.0, black)

    return scene


KINDS = ("points", "beads", "stars", "grating", "chart", "texture", "dark", "white")
SAID = ("refused", "warned", "shifted", "fits", "nothing")
LIT = ("grating", "chart", "texture", "white")  # all over


@dataclass(frozen=True)
class Pair:
    """A raw image, and its own calibration."""

    name: str
    raw: np.ndarray
    right: Calibration


def gaps(raw: np.ndarray, right: Calibration) -> float:
    """Part of the places between lenslets that are gaps.

    A place as far as can be from all centres is a gap where it has less than half of the light of each
    lenslet around it, of what the inner quarter of its cell has, and all of those are lit.
    """
    picture = np.asarray(raw, np.float32).reshape(*raw.shape[:2], -1).mean(-1)
    picture -= np.percentile(picture, 0.5)
    within = ndimage.uniform_filter(picture, max(round(right.lattice.pitch / 2), 1))
    ny, nx = (n - 1 for n in picture.shape)
    indices = right.indices_within((0, ny), (0, nx))
    bright = np.percentile(_at(within, right.position(indices)), 99)
    found = []
    for corners in _around(right.lattice.layout):
        places = right.position(indices + corners.mean(0))
        seen = ((places >= 0) & (places <= (ny, nx))).all(-1)
        around = np.min([_at(within, right.position(indices[seen] + one)) for one in corners], 0)
        here = _at(ndimage.gaussian_filter(picture, 0.5), places[seen])
        found.append((around > _LEAST * bright) & (here < _DARK * around))
    return float(np.mean(np.concatenate(found)))


def _around(layout: str) -> list[np.ndarray]:
    """Lenslets (i, j) around each kind of place between them, from a lenslet of its own."""
    if layout == "square":
        return [np.array([(0, 0), (0, 1), (1, 0), (1, 1)])]
    return [np.array([(0, 0), (0, 1), (1, 0)]), np.array([(1, 1), (0, 1), (1, 0)])]


def _at(picture: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Values at places (k, 2) as (y, x); the border's beyond it."""
    return ndimage.map_coordinates(picture, places.T, order=1, mode="nearest")


def _seen(kind: str, rng: np.random.Generator, pitch: float, shape: tuple[int, int]) -> Seen:
    """What stands before the camera, by places in units of `pitch` for each lenslet."""
    match kind:
        case "points":
            return _spots(rng, int(rng.integers(1, 8)), pitch * rng.uniform(0.1, 1), shape)
        case "beads":
            return _spots(rng, 30, pitch * rng.uniform(0.3, 2), shape)
        case "stars":
            return _spots(rng, 250, pitch * rng.uniform(0.05, 0.3), shape)
        case "grating":
            return _grating(rng, pitch)
        case "chart":
            return _chart(rng, pitch)
        case "edge":
            return _edge(rng, shape)
        case "white":
            return lambda y, x: np.ones(y.shape)
        case _:
            return _texture(rng, shape)


def _exposed(light: np.ndarray, kind: str, rng: np.random.Generator) -> np.ndarray:
    """A raw image of light that is 1 where it is bright."""
    full = 30 if kind == "dark" else float(rng.choice([200, 2000, 20000]))
    return rng.poisson(np.maximum(light, 0) * full) + rng.normal(20, 2, light.shape)


def drawn(number: int, kind: str = "") -> Pair:
    """The raw image of a number, by rays and boxes; kinds in turn unless told."""
    rng = np.random.default_rng(number)
    kind = kind or KINDS[number % len(KINDS)]
    pitch, layout = float(np.exp(rng.uniform(np.log(8), np.log(32)))), ("square", "hex")[number // 8 % 2]
    fewest = 9 if kind == "edge" else 24
    shape = int(pitch * rng.uniform(fewest, 44)), int(pitch * rng.uniform(fewest, 44))
    lattice = getattr(lg.Lattice, layout)(pitch, rng.uniform(-0.03, 0.03), tuple(rng.uniform(0, pitch, 2)))
    y, x = np.arange(shape[0], dtype=float)[:, None], np.arange(shape[1], dtype=float)[None]
    dy, dx = lattice.offset(y, x)
    # What a micro-image shows: its own place in focus (0), a little around it, or a whole patch (camera 2.0).
    zoom = float(rng.choice([0, rng.uniform(-0.6, 0.6), rng.uniform(-4, 4)]))
    at = y - dy + zoom * dy, x - dx + zoom * dx
    fill = float(rng.uniform(0.75, 0.95))
    raw = _seen(kind, rng, pitch, shape)(*at) * np.clip(fill * pitch / 2 - np.hypot(dy, dx) + 0.5, 0, 1)
    raw = ndimage.gaussian_filter(raw, rng.uniform(0.3, 0.9))
    raw = _exposed(raw, kind, rng)
    right = Calibration(lattice, shape, NONE.astype(int), NONE, 0.0)
    return Pair(f"{number} {kind}, {layout}, {pitch:.1f} px, zoom {zoom:.2f}", raw, right)


Simulated = PlenopticCamera | FocusedPlenopticCamera
CAMERAS: dict[str, tuple[type[PlenopticCamera] | type[FocusedPlenopticCamera], dict[str, Any]]] = {
    "1.0": (PlenopticCamera, {"main_lens": {"focal_length": 120e-3}, "object_distance": 240e-3,
        "lenslets": {"focal_length": 10e-3, "pitch": 150e-6, "count": (24, 24)}}),
    "1.0, hex": (PlenopticCamera, {"main_lens": {"focal_length": 80e-3}, "object_distance": 200e-3,
        "lenslets": {"focal_length": 10e-3, "pitch": 150e-6, "count": (24, 21), "layout": "hex",
                     "shape": "round"}}),
    "2.0": (FocusedPlenopticCamera, {"main_lens": {"focal_length": 60e-3}, "object_distance": 120e-3,
        "lenslets": {"focal_length": 5.2e-3, "pitch": 150e-6, "count": (24, 24), "magnification": 0.3}}),
    "2.0, Galilean": (FocusedPlenopticCamera, {"main_lens": {"focal_length": 50e-3}, "object_distance": 0.2,
        "lenslets": {"focal_length": 9e-3, "pitch": 150e-6, "count": (24, 24), "magnification": -0.3}}),
    "2.0, three kinds": (FocusedPlenopticCamera, {"main_lens": {"focal_length": 60e-3},
        "object_distance": 120e-3,
        "lenslets": {"focal_length": (6e-3, 6.3e-3, 5.7e-3), "pitch": 150e-6, "count": (20, 18),
                     "layout": "hex", "shape": "round", "magnification": 0.5}}),
    "1.0, narrow": (PlenopticCamera, {"main_lens": {"focal_length": 120e-3}, "object_distance": 240e-3,
        "wavelength": 633e-9, "lenslets": {"focal_length": 10e-3, "pitch": 110e-6, "count": (31, 31)}}),
}  # fmt: skip


@cache
def _camera(name: str, pixels: int) -> Simulated:
    """With so many pixels across a lenslet."""
    kind, given = CAMERAS[name]
    sensor = {"pixel_pitch": given["lenslets"]["pitch"] / pixels}
    return kind(**{"wavelength": 550e-9, **given, "sensor": sensor})


def simulated(number: int, kind: str = "", name: str = "") -> Pair:
    """The raw image of a number, by wave optics; kinds and the first five cameras in turn unless told."""
    rng, turn = np.random.default_rng([number, 1]), number // len(KINDS)
    kind, name = kind or KINDS[number % len(KINDS)], name or list(CAMERAS)[turn % 5]
    camera = _camera(name, (11, 14)[turn % 2])
    grid, right = camera.object_grid, camera.calibration
    assert right is not None
    across = min(grid.shape) / min(right.shape) * right.lattice.pitch  # samples for each lenslet
    near = float(rng.choice([-0.06, 0, 0.06])) * camera.object_distance
    if kind == "points":
        at = rng.uniform(-0.45, 0.45, (int(rng.integers(1, 8)), 2)) * grid.size
        scene = lg.targets.points([(*each, near) for each in at])
    elif kind == "white":
        scene = lg.targets.white()
    else:
        y, x = (np.broadcast_to(k, grid.shape) for k in np.ogrid[: grid.shape[0], : grid.shape[1]])
        scene = lg.Scene([lg.Slice(_seen(kind, rng, across, grid.shape)(y, x), grid, near)])
    light = np.asarray(lg.simulate(camera, scene, coherence=lg.Incoherent(accuracy=1e-2)).data)
    raw = _exposed(light / np.percentile(light, 99 if kind in LIT else 100), kind, rng)
    told = f"simulated {number} {kind}, {name}, {right.lattice.pitch:.1f} px, {1e3 * near:+.1f} mm"
    return Pair(told, raw, right)


def edge(number: int) -> Pair:
    """The raw image of an edge, drawn and simulated in turn."""
    if number % 2 == 0:
        return drawn(number, "edge")
    return simulated(number, "edge", list(CAMERAS)[number // 2 % len(CAMERAS)])


def real(number: int) -> Pair:
    """A pair of the data; some have no white image and are calibrated alone."""
    name = list(REAL)[number]
    raw, white = (DATA / one for one in REAL[name])
    return Pair(name, lg.open(raw).data, lg.calibrate(lg.open(white)))


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


def slip(right: Calibration, other: Calibration) -> float:
    """Pitches between two lattices at the border of the picture where they agree in its middle."""
    half = np.array([(y, x) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * right.shape
    waves = [np.linalg.inv(one.lattice.matrix) for one in (right, other)]
    return float(np.abs(half @ (waves[1] - waves[0]).T).max())


SOURCES: dict[str, tuple[Callable[[int], Pair], int]] = {
    "drawn": (drawn, 400),
    "simulated": (simulated, 240),
    "edges": (edge, 160),
    "real": (real, len(REAL)),
}
"""Pairs by number, and how many are looked at unless told."""


@dataclass(frozen=True)
class Row:
    """What was said of one pair: "fits", "nothing", "shifted", "warned" or "refused"."""

    source: str
    number: int
    name: str
    pair: str
    gaps: float
    slip: float
    said: str
    report: str

    @property
    def tells(self) -> bool:
        """Whether the raw image has gaps, and the calibration slips by as much as is warned of."""
        return self.gaps >= _MOST and self.slip >= _WARNED


def judged(source: str, number: int) -> list[Row]:
    pair, rows = SOURCES[source][0](number), []
    seen = gaps(pair.raw, pair.right)
    for name, calibration in {"right": pair.right, **wrong(pair.right)}.items():
        found = drift(pair.raw, calibration)
        said, report = ("nothing", "") if found is None else (verdict(found), found.report())
        rows.append(Row(source, number, pair.name, name, seen, slip(pair.right, calibration), said, report))
    return rows


def run(source: str, numbers: Iterable[int], kept: Path | None = None) -> list[Row]:
    """Rows of pairs; those in the file `kept` are not done again."""
    rows = [] if kept is None or not kept.exists() else read(kept)
    done = {(row.source, row.number) for row in rows}
    for number in numbers:
        if (source, number) in done:
            continue
        rows += (found := judged(source, number))
        if kept is not None:
            with kept.open("a") as file:
                file.writelines(json.dumps(asdict(row)) + "\n" for row in found)
    return rows


def read(kept: Path) -> list[Row]:
    """Rows of a file of results."""
    return [Row(**json.loads(line)) for line in kept.read_text().splitlines()]


def is_bad(row: Row) -> bool:
    """Whether a right pair is doubted, or a wrong one, where it could be found, is not."""
    found = row.said in ("refused", "warned", "shifted")
    return found if row.pair == "right" else row.tells and not found


def show(rows: Sequence[Row]) -> None:
    """Counts for right and wrong pairs, and every pair of which something else should have been said."""
    for source in sorted({row.source for row in rows}):
        for pair in ("right", "pitch", "turned"):
            for tells, name in ((True, "can be told"), (False, "others")):
                key = (source, pair, tells)
                counts = Counter(row.said for row in rows if (row.source, row.pair, row.tells) == key)
                print(f"{source:9} {pair:6} {name:15}", *(f"{counts[word]:4} {word}" for word in SAID))
    for row in filter(is_bad, rows):
        print(row.pair, row.said, row.name, row.report)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("source", nargs="?", choices=SOURCES, default="drawn")
    parser.add_argument("numbers", nargs="?")
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    first, last = (int(k) for k in (given.numbers or f"0:{SOURCES[given.source][1]}").split(":"))
    show(run(given.source, range(first, last), given.output))


if __name__ == "__main__":
    main()
