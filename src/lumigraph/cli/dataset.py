"""`lumigraph dataset`."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.batch import WorkerOptions, kept
from lumigraph.cli.console import line, progress
from lumigraph.cli.options import COMMAND, COMMON, Common, Output, planes
from lumigraph.cli.standing import StatusPage
from lumigraph.cli.sweep import anywhere
from lumigraph.cli.tolerance import Tolerances, given_tolerances
from lumigraph.core.result import Quantity, Result
from lumigraph.errors import FormatError, LumigraphError

if TYPE_CHECKING:
    from lumigraph.instruments import Instrument

ALONE = WorkerOptions()

MOST = 1_000_000
"""Samples."""


def dataset(
    camera: str,
    /,
    *,
    count: Annotated[int, Parameter(name=("--count", "-n"), allow_leading_hyphen=True)],
    depth: Annotated[list[str], Parameter(allow_leading_hyphen=True, negative="")],
    output: Output,
    layout: Annotated[list[Literal["patches", "slanted", "beads"]] | None, Parameter(negative="")] = None,
    photographs: str | None = None,
    vary: Annotated[list[str] | None, Parameter(allow_leading_hyphen=True, negative="")] = None,
    tolerance: Tolerances = None,
    cameras: Annotated[int, Parameter(allow_leading_hyphen=True)] = 0,
    seed: Annotated[int, Parameter(allow_leading_hyphen=True)] = 0,
    accuracy: Annotated[float, Parameter(allow_leading_hyphen=True)] = 1e-2,
    volume: Annotated[bool, Parameter(negative="")] = False,
    hands: WorkerOptions = ALONE,
    common: Common = COMMON,
) -> Result:
    """Simulate raw images of drawn scenes with their truth, to train and test methods on.

    Each sample is a raw image by wave optics with the sensor's noise, its picture in focus, the depth of
    each place and what was drawn, in one Zarr store with a data card beside it (.md). The same seed draws
    the same samples. Safe to interrupt: run the same command again to resume.

    Example: `lumigraph dataset thesis-plenoptic-1 -n 500 --depth "-60 mm:60 mm:20 mm" -o train.zarr`

    Example: `lumigraph dataset lfm-guv -n 100 --layout beads --depth "-8 um:8 um:4 um" --volume -o beads.zarr`

    Example: `lumigraph dataset thesis-plenoptic-1 -n 500 --depth "-60 mm:60 mm:20 mm" -t "separation=±0.2 mm" --cameras 20 -o train.zarr`

    Example: `lumigraph dataset camera.toml -n 2000 --depth "-9 mm:9 mm:3 mm" --photographs "photos/*.jpg" --vary "object_distance=300 mm, 320 mm" -o train.zarr --workers 2`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one.
    count
        Samples.
    depth
        Depths of the scenes' planes from the focused one, positive farther: a range '-9 mm:9 mm:3 mm', or some.
    output
        Zarr store (.zarr).
    layout
        patches: regions at depths of their own (default). slanted: one plane that rises in steps (default).
        beads: in a dark volume. May be repeated; one is drawn for each sample.
    photographs
        Files by a pattern in quotes, parts of which become textures.
    vary
        A key of the camera file and its values, as 'lumigraph sweep' takes them: samples take turns.
    tolerance
        A key of the camera file and how far it may be off, as 'lumigraph tolerance' takes them.
    cameras
        So many cameras are drawn within --tolerance and the camera file's [tolerances], and take turns.
    seed
        Seed of all random values.
    accuracy
        Relative rms error of the raw images before noise.
    volume
        Keep the intensity of every plane, too.
    """  # noqa: E501 - an example is one line
    from lumigraph.instruments import load_camera
    from lumigraph.instruments.varied import changed, combinations, values
    from lumigraph.samples import dataset as make
    from lumigraph.samples.dataset import Draws

    files.check_output(output, (".zarr",))
    hands.check()
    if not 1 <= count <= MOST:
        raise FormatError(f"--count is {count} but must be from 1 to {MOST}.")
    if seed < 0:
        raise FormatError(f"--seed is {seed} but must be at least 0.")
    given, varied = load_camera(anywhere(camera)), dict(map(values, vary or []))
    given.check_accuracy(accuracy)
    meant = [changed(given, one) for one in combinations(varied)]
    taking = tuple(one.to_toml() for one in _as_built(meant, tolerance, cameras, seed))
    layouts = tuple(dict.fromkeys(layout or ("patches", "slanted")))
    if "beads" in layouts and len(layouts) > 1:
        raise FormatError("--layout beads gives no depth of each place; the others do. Make two data sets.")
    found = tuple(str(Path(one).absolute()) for one in files.matching(photographs or ""))
    if photographs is not None and not found:
        raise FormatError(f"--photographs {photographs!r}: no file matches. Check the pattern.")
    work = Draws(taking, planes("--depth", depth), layouts, found, seed, accuracy, volume)
    if hands.slurm is not None:
        return hands.submitted(output)
    with progress("dataset") as shown, kept(output):
        made = make(
            work, count, output, workers=hands.cluster(), part=hands.share(),
            progress=StatusPage(output, shown), estimated=lambda needed: line(str(needed)),
            command=shlex.join(["lumigraph", *COMMAND.get()]),
        )  # fmt: skip
    if made.failures:
        number, why = min(made.failures.items())
        raise LumigraphError(f"{len(made.failures)} of {made.count} samples failed; number {number}: {why}")
    text = f"{made.done} of {made.count} samples, {len(taking)} cameras"
    counts = (Quantity("done", made.done), Quantity("samples", made.count), Quantity("cameras", len(taking)))
    card = output.with_name(f"{output.name}.md")
    return Result("Data set", "Raw images with truth.", made, (text,), counts, written=(output, card))


def _as_built(
    meant: "Sequence[Instrument]", tolerance: list[str] | None, count: int, seed: int
) -> "Sequence[Instrument]":
    """The cameras that take turns: as described, or so many drawn within the tolerances of each."""
    if count < 0 or (tolerance and not count):
        raise FormatError(
            f"--cameras is {count} but must be above 0 with --tolerance: so many cameras are drawn."
        )
    if not count:
        return meant
    from lumigraph.studies.tolerance import making

    given = given_tolerances(tolerance or [])
    found = [
        made for one in meant
        for made in making.cameras(making.check_camera(one), given, count, seed=seed)
    ]  # fmt: skip
    shapes = sorted({one.operator_grid().shape for one in found})
    if len(shapes) > 1:
        raise FormatError(
            f"the cameras drawn have objects of {shapes[0]} to {shapes[-1]} samples, but a data set has one "
            "shape. Leave out the tolerances of lenslets.rotation and offset, or make others tighter."
        )
    return found
