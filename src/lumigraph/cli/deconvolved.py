"""Report of `lumigraph deconvolve` on its result."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from lumigraph.core.result import Figure, Quantity, Result

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.core.prepared import PreparedImage
    from lumigraph.deconvolution.run import RunStep


def reached(step: "RunStep", gain: float | None) -> str:
    """Quality of the fit: deviance if electrons are known, else the change by the last step."""
    if gain is None:
        return f"the last step changed {100 * step.change:.2g} %"
    return f"deviance {step.deviance:.4g} per pixel"


def result(found: Any, raw: "PreparedImage", steps: "list[RunStep]", written: tuple[Path, ...]) -> Result:
    """The object in numbers and pictures, beside its raw image, the first of several."""
    from lumigraph.core.volume import Volume
    from lumigraph.deconvolution import Exposure

    values = [Quantity("shape", tuple(found.data.shape), "samples")]
    text = " x ".join(map(str, values[0].value)) + " samples"
    if isinstance(found, Volume):
        values += [Quantity("spacing", found.spacing, "m"), Quantity("depths", found.depths, "m")]
        text += " of " + " x ".join(f"{1e6 * step:.4g}" for step in found.spacing) + " µm"
    elif found.pixel_pitch:
        values.append(Quantity("pixel_pitch", found.pixel_pitch, "m"))
        text += f" of {1e6 * found.pixel_pitch:.4g} µm"
    lines = [text, "the checkpoint was finished already"]
    if steps:
        last, gain = steps[-1], Exposure.of(raw).gain
        values += [Quantity("iterations", last.iteration), Quantity("change", last.change)]
        values += [] if gain is None else [Quantity("deviance", last.deviance)]
        values.append(Quantity("stopped", last.stopped))
        lines[1] = f"{last.iteration} iterations, {reached(last, gain)}"
    return Result(
        "Deconvolution", "A raw image, and what was in front of the camera.", found, tuple(lines),
        tuple(values), lambda: _figures(found, raw, steps), raw.notes, written,
    )  # fmt: skip


def _figures(found: Any, raw: "PreparedImage", steps: "list[RunStep]") -> "Iterator[Figure]":
    from lumigraph import plots
    from lumigraph.core.volume import Volume

    if isinstance(found, Volume) and len(found.depths) > 1:
        yield Figure(plots.projections(found), "The brightest sample along each axis.")
        yield Figure(plots.slices(found), "Planes through the brightest sample.")
    else:
        yield Figure(found.data[0] if isinstance(found, Volume) else found, "Reconstructed picture.")
    yield Figure(raw, "Raw image; white is its brightest pixel.", options={"white": float(raw.data.max())})
    if len(steps) > 1:
        numbers = [step.iteration for step in steps]
        drawn = plots.curves(
            numbers, {"": [step.deviance for step in steps]}, xlabel="iteration",
            ylabel="Poisson deviance per pixel", log=True,
        )  # fmt: skip
        yield Figure(drawn, "Less deviance is likelier; its scale needs the gain.", "Convergence")
