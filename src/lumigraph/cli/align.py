"""`lumigraph align`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lumigraph.cli import console
from lumigraph.cli.options import above_zero, section
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.metrology import AlignmentLog, AlignmentStep


def align(
    bench: Path,
    /,
    *,
    camera: str,
    log: Annotated[Path | None, Parameter(name=["--log"])] = None,
    dark: Path | None = None,
    pitch_error: float | None = None,
    tolerance: Annotated[tuple[str, ...], Parameter(negative="")] = (),
    exposures: int = 12,
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    watch: Annotated[str | None, Parameter(group=section("Goal"))] = None,
    every: str = "1 min",
    live: Annotated[bool, Parameter(negative="")] = False,
    common: ReportOptions = REPORTED,
) -> Result:
    """Align a motorised bench with its camera file: expose, compare, move, until within tolerance.

    BENCH is a TOML file that says which device of Micro-Manager moves what. Needs the extra "bench".

    Example: `lumigraph align bench.toml --camera camera.toml --dry-run`

    Example: `lumigraph align bench.toml --camera camera.toml --log today --watch "2 h"`

    Parameters
    ----------
    camera
        Camera or microscope file, or a name of the catalogue: the intended bench.
    log
        Folder of the steps, by default bench.log beside BENCH. The same command resumes when interrupted.
    dark
        Picture without light; left out, the sensor's black level.
    pitch_error
        Standard deviation of the lenslets' pitch over the pixels', as a part of it; 3e-4 if left out.
    tolerance
        What may be left, such as height=10um, tilt_y=0.05deg or aperture=0.2%; otherwise 5 µm, 0.02°, 0.1 %.
    exposures
        Exposures at most.
    dry_run
        Expose once and print the plan; nothing moves.
    watch
        Keep the bench aligned for this long, such as "2 h", and print its drift.
    every
        Time from one exposure to the next while watching.
    live
        Show the loop in the browser.
    """
    common.check()
    above_zero("--pitch-error", pitch_error)
    from lumigraph import metrology, units
    from lumigraph.instruments import load_camera
    from lumigraph.preparation.given import read_raw

    hours, pause = (0.0 if text is None else units.parse(text, "time") for text in (watch, every))
    if pause <= 0 or hours < 0:
        raise FormatError("--every and --watch must be above 0, such as --watch '2 h' --every '1 min'.")
    goal = metrology.AlignmentGoal(_tolerances(tolerance), pitch_error, exposures)
    meant = metrology.white_camera(load_camera(camera))
    opened = metrology.open_bench(bench, meant)
    folder = log or bench.with_suffix(".log")
    reader = metrology.WhiteReader(meant, None if dark is None else read_raw(dark, "dark image"))
    if live:
        _shown_live(folder)
    if watch is None or dry_run:
        steps = metrology.align(opened, reader, goal=goal, log=None if dry_run else folder, dry_run=dry_run)
    else:
        steps = metrology.watch(opened, reader, seconds=hours, every=pause, goal=goal, log=folder)
    last = None
    for last in steps:
        for line in _lines(last, watching=last.number > 0 and watch is not None):
            console.line(line)
    assert last is not None  # there is one exposure at least
    return _result(last, None if dry_run else metrology.AlignmentLog(folder))


def _lines(step: "AlignmentStep", *, watching: bool) -> "Iterator[str]":
    yield f"exposure {step.number}: {step.status}; {', '.join(step.lines())}"
    if not watching:
        yield from (f"  move {one}" for one in step.instructions())


def _tolerances(texts: tuple[str, ...]) -> dict[str, float]:
    from lumigraph.metrology.alignment.setup import MOVABLE, number

    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in MOVABLE or not value:
            raise FormatError(
                f"--tolerance {text!r} must be NAME=VALUE, the name one of {', '.join(MOVABLE)}."
            )
        found[name] = number(f"--tolerance {name}", value, name)
    return found


def _shown_live(folder: Path) -> None:
    """Serve the page of a log in a thread of its own, and print its address."""
    import threading

    from lumigraph.viewer import serve
    from lumigraph.viewer.alignment import alignment_site
    from lumigraph.viewer.show import open_in_browser

    def ready(address: str) -> None:
        console.line(address)
        open_in_browser(address, console.line)

    site = alignment_site(folder)
    threading.Thread(target=serve, args=(site,), kwargs={"ready": ready}, daemon=True).start()


def _result(step: "AlignmentStep", log: "AlignmentLog | None") -> Result:
    from lumigraph.metrology import drift_rates, drift_table
    from lumigraph.metrology.alignment.setup import STATE_UNITS, STATES

    steps = [step.values()] if log is None else log.steps()
    rates = drift_rates(steps) if step.status == "moving" and len(steps) > 2 else {}
    belief, quantities = step.belief, []
    for number, motor in enumerate(belief.motors):
        value, half = belief[motor.moves], 1.96 * belief.error(motor.moves)
        unit = STATE_UNITS[STATES.index(motor.moves)]
        quantities.append(Quantity(motor.moves, value, unit, (value - half, value + half)))
        if motor.backlash:
            play, error = belief.backlash(number)
            interval = (max(0.0, play - 1.96 * error), play + 1.96 * error)
            quantities.append(Quantity(f"backlash_{motor.moves}", play, unit, interval))
    quantities += [Quantity(f"drift_{name}_per_hour", rate, "") for name, (rate, _) in rates.items()]
    about = "A bench in a closed loop: what its white images show, and what its motors did."
    return Result(
        "Alignment", about, step, _headline(step, bool(rates)), tuple(quantities),
        lambda: _figures(steps, log, drift_table(steps) if rates else None), step.notes,
        extra={"status": step.status, "exposures": len(steps), "instructions": step.instructions()},
        failure="the bench is not aligned: see the notes" if step.status == "stopped" else "",
    )  # fmt: skip


def _headline(step: "AlignmentStep", watched: bool) -> tuple[str, ...]:
    if step.instructions() and not watched:
        return ("plan:", *step.instructions())
    return (f"{'kept aligned' if watched else step.status} after exposure {step.number}", *step.lines())


def _figures(steps: list[dict[str, Any]], log: "AlignmentLog | None", drift: Any) -> "Iterator[Figure]":
    from lumigraph import plots
    from lumigraph.metrology.alignment.setup import shown

    names = steps[0]["moved_by_motors"]
    rows = [["exposure", "status", *names]]
    rows += [
        [str(one["number"]), one["status"], *(shown(name, one["out"][name]) for name in names)]
        for one in steps
    ]
    yield Figure(rows, section="Steps")
    if log is not None:
        yield Figure(plots.alignment(steps), "What is out of place after each exposure, over 1 µm, 0.001° or "
                     "0.01 %, with 95 % intervals.", "Steps")  # fmt: skip
        for number in dict.fromkeys((0, len(steps) - 1)):
            title = f"White image of exposure {number}, and the micro-images found."
            yield Figure(plots.alignment_picture(log.image(number), steps[number]), title, "White images")
    if drift is not None:
        yield Figure(drift, section="Drift")
