"""Samples as files, for the command line and for other programs."""

import os
from pathlib import Path

import numpy as np

from lumigraph import io, store
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, Stage, part
from lumigraph.errors import LumigraphError
from lumigraph.samples.bench import bench
from lumigraph.samples.files import camera_file
from lumigraph.samples.scene import scene
from lumigraph.samples.volume import volume

NAMES = ("scene", "bench", "volume")
"""Names of the samples."""


def write(
    folder: str | os.PathLike[str],
    names: tuple[str, ...] = NAMES,
    *,
    size: tuple[int, int] = (192, 256),
    progress: Progress | None = None,
) -> list[Path]:
    """Write samples into a folder; returns the files, each with the truth beside it.

    Parameters
    ----------
    folder
        Made when it is missing.
    names
        Names, of `NAMES`.
    size
        Samples (t, s) of each view of the scene.
    progress
        Called as ``progress(fraction)``, a `core.progress.Stage`.

    Raises
    ------
    LumigraphError
        An unknown name.
    """
    if unknown := [name for name in names if name not in NAMES]:
        raise LumigraphError(f"there is no sample {unknown[0]!r}. Choose from {', '.join(NAMES)}.")
    place, written = Path(folder), []
    place.mkdir(parents=True, exist_ok=True)
    for k, name in enumerate(names):
        tell = part(progress, k, len(names))
        tell(Stage(0.0, name))
        written += {"scene": _scene, "bench": _bench, "volume": _volume}[name](place, size, tell)
        tell(Stage(1.0, name))
    return written


def _scene(folder: Path, size: tuple[int, int], tell: Progress) -> list[Path]:
    sample = scene(size)
    views, files = sample.views, [folder / "scene.zarr", folder / "scene-disparity.pfm"]
    shown = np.round(255 * np.clip(views.data, 0, 1) ** (1 / 2.2)).astype(np.uint8)  # as a camera's pictures
    io.save(LightField(shown, views.aperture, views.lenslets, views.separation), files[0])
    io.save(sample.disparity, files[1])
    return files


def _bench(folder: Path, size: tuple[int, int], tell: Progress) -> list[Path]:
    sample = bench(progress=tell)
    files = [folder / f"bench-{name}" for name in ("camera.toml", "white.tiff", "raw.tiff")]
    store.write_bytes(files[0], camera_file("plenoptic").encode())
    io.save(sample.white, files[1])
    io.save(sample.raw, files[2])
    return files


def _volume(folder: Path, size: tuple[int, int], tell: Progress) -> list[Path]:
    sample = volume()
    files = [folder / "volume-camera.toml", folder / "volume-raw.tiff", folder / "volume-truth.ome.tif"]
    store.write_bytes(files[0], camera_file("microscope").encode())
    io.save(sample.raw, files[1])
    io.save(sample.volume, files[2])
    return files
