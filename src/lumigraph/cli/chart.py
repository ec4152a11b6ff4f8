"""`lumigraph chart`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.options import COMMON, Common, Output
from lumigraph.core.result import Quantity, Result


def chart(
    what: str,
    /,
    *,
    paper: str = "A4",
    turn: Annotated[str, Parameter(allow_leading_hyphen=True)] = "0 deg",
    output: Output,
    common: Common = COMMON,
) -> Result:
    """Draw a chart to print, in true size, with rulers that check the printer.

    WHAT is a board as 'lumigraph board' takes it, or one of the charts of data sheets: edge, a dark square
    turned by 5 degrees; siemens, a star; usaf, the USAF-1951 target; texture, a random grey print. Print at
    100 %, and measure the rulers: if they are not 100.0 mm long, multiply all lengths by what they measure
    over 100 mm.

    Example: `lumigraph chart "9 x 5 corners, 25 mm" -o board.pdf`

    Example: `lumigraph chart "9 x 6 charuco, 25 mm, markers 18 mm, DICT_4X4_50" --paper A3 -o charuco.svg`

    Example: `lumigraph chart "11 x 8 corners, 20 mm" --turn "7 deg" --paper A3 -o sheet.pdf`

    Parameters
    ----------
    what
        A board, such as '9 x 5 corners, 25 mm', or 'edge, 100 mm', 'siemens, 150 mm', 'usaf, -2:1' or
        'texture, 1 mm', the sizes of which may be left out.
    paper
        A4, A3, A2, letter, or width x height such as '300 mm x 200 mm'.
    turn
        Rotation of the chart, such as '7 deg', clockwise.
    output
        Page of true size (.pdf, .svg), or a picture of it (.png).
    """
    from lumigraph import metric
    from lumigraph.units import parse

    files.check_output(output, files.FIGURES)
    figure = metric.chart(what, paper, turn=parse(turn, "angle"))
    files.save_figure(figure, output)
    wide, high = (float(side) * 25.4e-3 for side in figure.get_size_inches())
    return Result(
        "Chart", "A chart to print.", figure, (f"a page of {wide * 1e3:.4g} x {high * 1e3:.4g} mm",),
        (Quantity("width", wide, "m"), Quantity("height", high, "m")),
        notes=("print at 100 %; both rulers must measure 100.0 mm",), written=(Path(output),),
    )  # fmt: skip
