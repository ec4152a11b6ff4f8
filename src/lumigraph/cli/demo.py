"""`lumigraph demo`."""

from pathlib import Path

from lumigraph.cli.console import progress
from lumigraph.cli.options import COMMON, Common, Output
from lumigraph.core.result import Result
from lumigraph.errors import FormatError


def demo(*, output: Output = Path("demo"), common: Common = COMMON) -> Result:
    """Refocus a still life, render a focused plenoptic camera and find a microscope's volume.

    Writes report.html, which begins with a picture to click into focus, beside the files:
    raw images, views, pictures, depth, a volume. Takes about half a minute.

    Example: `lumigraph demo -o demo`

    Parameters
    ----------
    output
        Folder for the results; made if it does not exist.
    """
    if output.exists() and not output.is_dir():
        raise FormatError(f"--output {output} is a file. Give a folder.")
    from lumigraph import demo
    from lumigraph.io.target import check_parent, write_bytes
    from lumigraph.viewer import view_inline

    check_parent(output)
    with progress("demo") as shown:
        page = demo.run(
            output, shown, living=lambda views, file: write_bytes(file, view_inline(views).page.encode())
        )
    return Result("Demo", "", page, (f"Open {page}",), extra={"output": str(output), "report": str(page)})
