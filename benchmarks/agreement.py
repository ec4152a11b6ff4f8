"""Real raw images and views by Python, by the command line and by the viewer's routes: the same pictures?

Each set (LUMIGRAPH_DATA) is decoded, or rendered, and its depth measured three times: by Python, by the
verbs (read from their files), and as the viewer's server sends it to the page. Pictures are compared in grey
levels, 1/255 of what the viewer shows as white; maps in 1/255 of what they span but for their outermost 1 %.

    python -m benchmarks.agreement [set ...] [--no-depth]
"""

import argparse
import json
import os
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import lumigraph as lg
from lumigraph import preparation, viewer
from lumigraph.cli import main as lumigraph
from lumigraph.rendering import detail

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")
PLANES = 5
"""Refocused pictures that are compared, through the range of the viewer's slider."""


@dataclass(frozen=True)
class Set:
    """A raw image or views, and the files that come with it; or options to calibrate the raw image itself."""

    file: str
    beside: dict[str, str] = field(default_factory=dict)
    find: tuple[str, ...] | None = None


SETS = {
    "letters": Set(
        "letters_plenoptic1/letters_ULF_M1.png",
        {
            "white": "letters_plenoptic1/letters_ULF_M1_white.png",
            "dark": "letters_plenoptic1/letters_ULF_M1_dark.png",
        },
    ),
    "letters-maker": Set(
        "letters_plenoptic1/letters_ULF_M1.png",
        {
            "calibration": "letters_plenoptic1/letters_ULF_M1.ini",
            "white": "letters_plenoptic1/letters_ULF_M1_white.png",
        },
    ),
    "letters-raw": Set("letters_plenoptic1/letters_ULF_M1.png", find=()),
    "raytrix": Set(
        "raytrix_r42_multifocus/sc2_klein.png", {"calibration": "raytrix_r42_multifocus/sc2_klein.xml"}
    ),
    "guv": Set(
        "lfm_guv/Lightfield_GUVExperim1.tif",
        {"white": "lfm_guv/Radiometry_GUVExperim1.tif", "dark": "lfm_guv/DarkFrame_GUVExperim1.tif"},
    ),
    "guv-simulated": Set(
        "lfm_guv_simulated/LightField_GUVSimul1.tif",
        {
            "white": "lfm_guv_simulated/Radiometry_GUVSimul1.tif",
            "dark": "lfm_guv_simulated/DarkFrame_GUVSimul1.tif",
        },
    ),
    "worm": Set(
        "lfm_worm/20131219WORM2_small_full_neg_X1_N15_cropped_uncompressed.tif",
        find=("--pitch", "15", "--exact"),
    ),
    "brain": Set("lfm_mouse_brain/LF_img_train_0.tif", find=()),
    "antinous": Set("hci_antinous"),
    "cotton": Set("hci_star/cotton"),
    "kitchen": Set("hci_star/kitchen"),
    "lytro-stack": Set("lytro_lfp/IMG_0001-stk.lfp"),
    "lytro-depth": Set("lytro_lfp/IMG_0009-dm.lfp"),
}
"""COMPOTE's set holds no picture. Lytro's containers hold no raw image: what is in them is unpacked."""


@dataclass(frozen=True)
class Row:
    """What was compared: the set, the thing, and how far command line and viewer are from Python [levels]."""

    name: str
    what: str
    command: float
    viewer: float

    def __str__(self) -> str:
        return f"{self.name:14} {self.what:16} command line {self.command:8.3g}, viewer {self.viewer:8.3g}"


def sent(site: viewer.Site, name: str) -> np.ndarray:
    """Values of an array as the page reads them from the viewer's server."""
    content = bytes(site.resources[f"data/0/{name}"].future().result())
    size = int.from_bytes(content[:4], "little")
    header = json.loads(content[4 : 4 + size])
    numbers = np.frombuffer(content, np.uint8 if header["bits"] == 8 else "<u2", offset=4 + size)
    return header["offset"] + header["scale"] * numbers.reshape(header["shape"]).astype(float)


def run(words: list[str]) -> None:
    """A command of lumigraph, which must not fail."""
    if lumigraph(words):
        raise SystemExit(f"lumigraph {' '.join(words)} failed")


def apart(one: Any, other: Any, level: float) -> float:
    """Largest difference [levels]; infinite where only one is known."""
    a, b = (np.squeeze(np.asarray(each, float)) for each in (one, other))
    if a.shape != b.shape or (np.isfinite(a) != np.isfinite(b)).any():
        return np.inf
    return float(np.nanmax(np.abs(a - b), initial=0) / level)


def rows(name: str, folder: Path, *, depth: bool) -> Iterator[Row]:
    """All that is compared of a set."""
    known, source = SETS[name], DATA / SETS[name].file
    files = {key: DATA / path for key, path in known.beside.items()}
    if known.find is not None:
        files["calibration"] = folder / "lattice.toml"
        run(["calibrate", str(source), *known.find, "-o", str(files["calibration"])])
    words = [word for key, path in files.items() for word in (f"--{key}", str(path))]
    shown = viewer.open_exhibit(source, viewer.Origin(**files) if files else None)
    site, thing = viewer.site([shown]), lg.open(source)
    if source.suffix == ".lfp":
        yield unpacked(name, (folder, source), thing, site)
        return
    if isinstance(thing, lg.RawImage):
        place = files.pop("calibration", None)
        place = None if place is None else preparation.read_calibration(place, thing.shape)
        thing = lg.prepare(thing, place, **{key: lg.open(path) for key, path in files.items()})
    if shown.planes is not None:
        yield from rendered(name, (folder, source, words), (thing, shown, site), depth=depth)
        return
    views = lg.decode(thing) if isinstance(thing, lg.RawImage) else thing
    yield from decoded(name, (folder, source, words), (views, shown, site), depth=depth)


def decoded(
    name: str, files: tuple[Path, Path, list[str]], made: tuple[Any, Any, Any], *, depth: bool
) -> Iterator[Row]:
    """Views, refocused pictures and disparities."""
    (folder, source, words), (views, shown, site) = files, made
    about = described(site)
    level, data = about["views"]["white"] / 255, views.data
    if words:
        run(["decode", str(source), *words, "-o", str(folder / "views.zarr")])
        data = lg.open(folder / "views.zarr").data
    seen = np.empty((views.data.shape[0] * views.data.shape[1], *views.data.shape[2:]))
    for k, (first, count) in enumerate(about["views"]["chunks"]):
        seen[first : first + count] = sent(site, f"views/{k}")
    seen = seen.reshape(views.data.shape)
    yield Row(name, "views", apart(views.data, data, level), apart(views.data, seen, level))
    planes = np.linspace(0, len(about["stack"]["positions"]) - 1, PLANES).round().astype(int)
    alphas = factors(np.array(about["stack"]["positions"])[planes], shown.views, views)
    python = lg.refocus_stack(views, alphas, oversample=detail(views))
    run(["refocus", str(source), *words, "--alpha", *map(str, alphas), "--oversample", str(detail(views)),
         "-o", str(folder / "stack.tiff")])  # fmt: skip
    command, seen = lg.open(folder / "stack.tiff").data, sent(site, "stack")[planes]
    yield Row(name, "refocused", apart(python, command, level), apart(python, seen, level))
    if depth:
        run(["depth", str(source), *words, "-o", str(folder / "map.tiff")])
        found = lg.depth.epi(views)
        yield compared(
            name, (found, lg.open(folder / "map.tiff").data), lg.depth.alpha_of(found, shown.views), site
        )


def factors(alphas: np.ndarray, shown: lg.LightField, views: lg.LightField) -> list[float]:
    """Refocus factors of views for those of the viewer's, whose lenslets may count as smaller."""
    there = lg.DepthMap(alphas[None], np.ones((1, len(alphas))), "alpha")
    return np.asarray(lg.depth.alpha_of(lg.depth.disparity_of(there, shown), views).values)[0].tolist()


def rendered(
    name: str, files: tuple[Path, Path, list[str]], made: tuple[Any, Any, Any], *, depth: bool
) -> Iterator[Row]:
    """Pictures of a camera 2.0, and its patches."""
    (folder, source, words), (raw, shown, site) = files, made
    positions, level = shown.planes.positions, described(site)["stack"]["white"] / 255
    calibration = DATA / SETS[name].beside["calibration"]
    sharp = preparation.sharp_kinds(raw.calibration, (), calibration)
    python = lg.render_stack(raw, patches=positions, focus=sharp)
    run(["render", str(source), *words, f"--patches={positions[0]}:{positions[-1]}:{len(positions)}",
         "-o", str(folder / "stack.tiff")])  # fmt: skip
    command, seen = lg.open(folder / "stack.tiff").data, sent(site, "stack")
    yield Row(name, "rendered", apart(python, command, level), apart(python, seen, level))
    if depth:
        run(["depth", str(source), *words, "-o", str(folder / "map.tiff")])
        found = lg.depth.of_pixels(raw, raw.calibration, focus=sharp).depth
        yield compared(name, (found, lg.open(folder / "map.tiff").data), found, site)


def unpacked(name: str, files: tuple[Path, Path], thing: Any, site: viewer.Site) -> Row:
    """Pictures, or a map, that a container holds."""
    folder, source = files
    run(["decode", str(source), "-o", str(folder / "parts")])
    paths = sorted((folder / "parts").glob("stack-*.png")) or [folder / "parts" / "depth.tiff"]
    written = np.array([np.asarray(lg.open(path).data) for path in paths])
    stack = len(paths) > 1
    level = 1.0 if stack else float(np.ptp(thing.data)) / 255
    seen = sent(site, "stack" if stack else "raw")
    return Row(name, "unpacked", apart(thing.data, written, level), apart(thing.data, seen, level))


def described(site: viewer.Site) -> dict[str, Any]:
    """What the page is told of the set."""
    return json.loads(bytes(site.resources["data/about"].future().result()))["exhibits"][0]


def compared(name: str, maps: tuple[Any, Any], expected: Any, site: viewer.Site) -> Row:
    """A map by Python and as it was written, and what the viewer should send."""
    found, written = maps
    one, other = ((m.quantiles(0.99)[0] - m.quantiles(0.01)[0]) / 255 for m in (found, expected))
    seen = np.where(np.isfinite(expected.values), sent(site, "depth"), np.nan)
    return Row(name, "depth", apart(found.values, written, one), apart(expected.values, seen, other))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("sets", nargs="*", default=[])
    parser.add_argument("--no-depth", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    for name in given.sets or SETS:
        with tempfile.TemporaryDirectory() as folder:
            for row in rows(name, Path(folder), depth=not given.no_depth):
                print(row, flush=True)


if __name__ == "__main__":
    main()
