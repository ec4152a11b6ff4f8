"""`process`: everything from a raw image, by one call."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from lumigraph import io
from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, Stage, silent, within
from lumigraph.errors import FormatError
from lumigraph.instruments import Instrument
from lumigraph.io.target import write_bytes
from lumigraph.processing import inputs
from lumigraph.processing.inputs import Inputs, Source
from lumigraph.processing.notes import mattering, page
from lumigraph.processing.patches import FromPatches
from lumigraph.processing.recognise import Guess, Kind, recognise
from lumigraph.processing.steps import RECORD, Step, Steps, heard
from lumigraph.processing.views import FromViews
from lumigraph.processing.volume import VOLUME, FromVolume
from lumigraph.viewer import Exhibit, Origin, export
from lumigraph.viewer.opening import of_raw, of_views, of_volume

CALIBRATION, NOTES, PAGE = "calibration.toml", "notes.md", "page.html"


@dataclass(frozen=True, slots=True)
class Processed:
    """Result of `process`.

    Parameters
    ----------
    folder
        Folder of the files.
    kind
        What the raw image is: "plenoptic 1.0", "plenoptic 2.0", "multi-focus plenoptic 2.0", "microscope", or
        "views".
    guesses
        What was found out, with reasons.
    notes
        What to know about the results.
    files
        Their names.
    kept
        Names of the steps that stood from a former run.
    """

    folder: Path
    kind: Kind
    guesses: tuple[Guess, ...]
    notes: tuple[str, ...]
    files: tuple[str, ...]
    kept: tuple[str, ...] = ()


@dataclass
class _Plan:
    """Steps of one kind of raw image, the page's contents, and notes once the steps are done."""

    kind: Kind
    guesses: tuple[Guess, ...]
    steps: list[Step]
    exhibit: Callable[[], Exhibit]
    about: Callable[[], list[str]]
    notes: tuple[str, ...] = ()


def process(
    raw: Source | LightField,
    *,
    white: Source | None = None,
    dark: Source | None = None,
    camera: str | PathLike[str] | Instrument | None = None,
    calibration: str | PathLike[str] | None = None,
    folder: str | PathLike[str],
    progress: Progress | None = None,
) -> Processed:
    """Pictures, depth, a film, a page and notes from a raw image or views, in a folder.

    Finds out what the raw image is, calibrates it, decodes or renders it; a microscope with `camera` gives a
    volume. What stands in the folder from the same things is kept.

    Parameters
    ----------
    raw
        File, or what `lumigraph.open` returns: a raw image or views.
    white, dark
        Picture of an evenly lit surface, and one with the lens covered, with the same settings.
    camera
        Camera file, a name of the catalogue, or a camera: gives lengths, and volumes of microscopes. Left
        out, napari-LF's metadata.txt that names the raw image and lies beside it is found.
    calibration
        File made by `lumigraph calibrate`, or by the camera's maker; one that lies beside the raw image under
        its name (.xml, .ini) is found.
    folder
        Made where it does not exist.
    progress
        Called as ``progress(fraction)``, a `core.progress.Stage`.

    Returns
    -------
    Processed
        What was found out, and the names of the files: all-in-focus.png, depth.png, depth.tiff, refocus.gif,
        page.html, notes.md, calibration.toml, and views.zarr or volume.ome.tif.

    Raises
    ------
    FormatError
        Something that is no raw image, or files in the folder that somebody else wrote or changed.
    CalibrationError
        No micro-images can be found, or a camera without lenslets.

    Examples
    --------
    >>> import tempfile
    >>> import lumigraph as lg
    >>> import numpy as np
    >>> views = lg.LightField(np.random.default_rng(1).random((3, 3, 40, 40)), lg.Grid.square(3, 1.0),
    ...                       lg.Grid.square(40, 1.0), 10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = process(views, folder=folder)
    >>> made.kind, "all-in-focus.png" in made.files
    ('views', True)
    """
    tell, place = progress or silent, _folder(folder)
    steps = Steps(place)
    with heard() as told:
        given = inputs.read(raw, white=white, dark=dark, camera=camera, calibration=calibration)
        plan, kept = _planned(given, steps, within(tell, 0.0, 0.2))
    done = _run(plan.steps, steps, within(tell, 0.2, 0.8))
    shown = Step("page", (PAGE,), lambda at, p: _write_page(plan, at, p), given.fingerprint)
    done |= _run([shown], steps, within(tell, 0.8, 0.97))
    told += [note for step in (*plan.steps, shown) for note in steps.notes(step)]
    notes = mattering((*plan.about(), *plan.notes, *told))
    made = [CALIBRATION] * (plan.kind != "views") + [name for step in plan.steps for name in step.files]
    files = (*made, PAGE, NOTES)
    text = page(given.name, plan.guesses, notes, files)
    write = Step("notes", (NOTES,), lambda at, _: write_bytes(at / NOTES, text.encode()), text)
    _run([write], steps, silent)
    tell(Stage(1.0, "notes"))
    kept += tuple(name for name, was_made in done.items() if not was_made)
    return Processed(place, plan.kind, plan.guesses, notes, files, kept)


def _folder(folder: str | PathLike[str]) -> Path:
    path = Path(folder)
    if path.exists() and not path.is_dir():
        raise FormatError(f"{path} is a file. Give a folder.")
    if path.is_dir() and any(path.iterdir()) and not (path / RECORD).is_file():
        raise FormatError(f"the folder {path} holds other things. Give a new one.")
    path.mkdir(parents=True, exist_ok=True)
    return path


def _planned(given: Inputs, steps: Steps, tell: Progress) -> tuple[_Plan, tuple[str, ...]]:
    """Plan for the raw image or the views, and "calibration" where that stands."""
    if isinstance(given.found, LightField):
        return _of_views(given), ()
    tell(Stage(0.1, "calibrating"))
    calibration, kept = _calibrated(given, steps)
    tell(Stage(0.8, "preparing"))
    kind, guess = recognise(given.raw, calibration, given.camera)
    guesses = (guess, *given.guesses, given.lattice_source())
    make = _of_microscope if kind == "microscope" else _of_lenslets
    return make(given, calibration, (kind, guesses), steps), ("calibration",) * kept


def _calibrated(given: Inputs, steps: Steps) -> tuple[Calibration, bool]:
    """Lattice, and whether it stands."""
    found: list[Calibration] = []

    def write(folder: Path, progress: Progress) -> None:
        found.append(given.calibration())
        io.save(found[0], folder / CALIBRATION)

    step = Step("calibration", (CALIBRATION,), write, given.lattice_fingerprint)
    if steps.run(step, silent):
        return found[0], False
    calibration = io.open(steps.folder / CALIBRATION)
    assert isinstance(calibration, Calibration)  # process wrote it
    return calibration, True


def _of_views(given: Inputs) -> _Plan:
    assert isinstance(given.found, LightField)
    made = FromViews(given.found)
    guess = Guess("kind", "views", f"{given.name} holds a light field")
    return _Plan(
        "views", (guess,), made.steps(given.fingerprint, decoded=False),
        lambda: replace(of_views(given.name, made.views), depth=made.depth), made.about,
    )  # fmt: skip


def _of_lenslets(
    given: Inputs, calibration: Calibration, known: tuple[Kind, tuple[Guess, ...]], steps: Steps
) -> _Plan:
    """Plan for a camera 1.0 or 2.0."""
    (kind, guesses), ready = known, given.prepared(calibration)
    place = ready.calibration or calibration
    if kind == "plenoptic 1.0":
        views = FromViews(ready)
        made, todo = views, views.steps(given.fingerprint, decoded=True)
    else:
        patches = FromPatches(ready, place, given.sharp(place), given.camera)
        made, todo = patches, patches.steps(given.fingerprint)

    def exhibit() -> Exhibit:
        origin = Origin(given.maker, camera=given.camera)
        if not isinstance(made, FromPatches):
            return replace(of_raw(given.name, ready, place, None, origin), depth=made.depth)
        page = of_raw(given.name, ready, place, sum(made.ends) / 2, origin)
        return replace(page, depth=made.map)  # measured once

    return _Plan(kind, guesses, todo, exhibit, made.about, (*calibration.notes, *ready.notes))


def _of_microscope(
    given: Inputs, calibration: Calibration, known: tuple[Kind, tuple[Guess, ...]], steps: Steps
) -> _Plan:
    """Plan for a microscope with its description."""
    (kind, guesses), ready = known, given.prepared(calibration, divide=False)
    assert given.camera is not None  # which makes it a microscope
    made = FromVolume(ready, given.camera, None)
    todo = made.steps(given.fingerprint)
    if steps.stands(todo[0]):
        made = FromVolume(ready, given.camera, steps.folder / VOLUME)
        todo = made.steps(given.fingerprint)
    guesses = (*guesses, Guess("depths", _range(made), "the microscope refocuses well within them"))
    return _Plan(
        kind,
        guesses,
        todo,
        lambda: of_volume(VOLUME, made.volume),
        made.about,
        (*calibration.notes, *ready.notes),
    )


def _range(made: FromVolume) -> str:
    first, *_, last = made.depths
    return f"{len(made.depths)} planes from {1e6 * first:.3g} to {1e6 * last:.3g} um"


def _run(todo: list[Step], steps: Steps, tell: Progress) -> dict[str, bool]:
    """Make what does not stand; which steps were made."""
    total, before, done = sum(step.share for step in todo), 0.0, {}
    for step in todo:
        tell(Stage(before / total, step.name))
        done[step.name] = steps.run(
            step, within(tell, before / total, (before + step.share) / total, step.name)
        )
        before += step.share
    return done


def _write_page(plan: _Plan, folder: Path, progress: Progress) -> None:
    export([plan.exhibit()], folder / PAGE, progress=progress)
