"""`lumigraph design`."""

from pathlib import Path

from lumigraph.cli import files
from lumigraph.cli.console import report
from lumigraph.cli.options import COMMON, Common


def design(camera: str, /, *, plot: Path | None = None, common: Common = COMMON) -> None:
    """Print everything that follows from a camera's description, with its equations.

    Example: `lumigraph design camera.toml --plot rays.png`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one such as thesis-plenoptic-1.
    plot
        Draw the rays through the camera into this file (.png, .svg, .pdf).
    """
    from lumigraph.instruments import load_camera

    if plot is not None:
        files.check_output(plot, files.FIGURES)
    described = load_camera(camera)
    table = described.describe()
    if plot is not None:
        from lumigraph import plots

        files.save_figure(plots.layout(described), plot)
    report(common, str(table), table.as_dict())
