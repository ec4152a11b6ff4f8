"""`lumigraph design`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.options import section
from lumigraph.cli.reporting import REPORTED, ReportOptions, tell
from lumigraph.cli.serving import Port, announce, check_port
from lumigraph.core.result import Figure, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.instruments import Description, Instrument


@Parameter(name="*", group=section("Designer"))
@dataclass(frozen=True)
class DesignerOptions:
    """The designer's page.

    Parameters
    ----------
    web
        Open the designer in the browser: sliders, layout, trade-offs, the image of a point, at once.
    port
        Port of this computer, which only its own browser can reach; 0: any free one.
    no_open
        Do not open a browser.
    """

    web: Annotated[bool, Parameter(negative="")] = False
    port: Port = 0
    no_open: Annotated[bool, Parameter(negative="")] = False

    def check(self) -> None:
        """Refuse what is wrong before anything is read."""
        check_port(self.port)
        if not self.web and (self.port or self.no_open):
            raise FormatError("--port and --no-open are for the designer's page. Give --web too.")


def design(
    camera: str,
    /,
    *,
    plot: Path | None = None,
    page: DesignerOptions = DesignerOptions(),
    common: ReportOptions = REPORTED,
) -> Result | None:
    """Print everything that follows from a camera's description, with its equations.

    With --web it opens a page in which the camera can be changed, and ends with Ctrl-C.

    Example: `lumigraph design camera.toml --plot rays.png`

    Example: `lumigraph design camera.toml --web`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one such as thesis-plenoptic-1.
    plot
        Draw the rays through the camera into this file (.png, .svg, .pdf).
    """
    from lumigraph.instruments import load_camera

    common.check()
    page.check()
    if plot is not None:
        files.check_output(plot, files.FIGURES)
    described = load_camera(camera)
    table = described.describe()
    if plot is not None:
        from lumigraph import plots

        files.save_figure(plots.layout(described), plot)
    found = Result(
        "Design", f"{table.title[0].upper()}{table.title[1:]}, and all that follows in closed form.",
        described, tuple(str(table).splitlines()), figures=lambda: _figures(described, table),
        extra=table.as_dict(),
        written=() if plot is None else (plot,),
    )  # fmt: skip
    if not page.web:
        return found
    from lumigraph import viewer

    tell(common, found)
    site = viewer.designer_site(described, Path(camera).name)
    viewer.serve(site, port=page.port, ready=lambda address: announce(address, common, no_open=page.no_open))
    return None


def _figures(camera: "Instrument", table: "Description") -> "Iterator[Figure]":
    from lumigraph import plots

    if table.warnings:
        yield Figure("\n".join(table.warnings), section="Warnings")
    yield Figure(plots.layout(camera), f"Rays through the {camera.noun}.", "Layout", {"wide": True})
    for title, rows in table.sections:
        cells = [(row.name, row.text, row.source) for row in rows]
        yield Figure([("quantity", "value", "equation"), *cells], section=title)
    yield Figure(camera.to_toml(), section="Camera file")
