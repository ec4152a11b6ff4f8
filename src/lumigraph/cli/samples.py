"""`lumigraph samples`."""

from pathlib import Path
from typing import Literal

from lumigraph.cli.console import progress
from lumigraph.cli.options import COMMON, Common, Output
from lumigraph.core.result import Result
from lumigraph.errors import FormatError


def samples(
    action: Literal["make"],
    *names: Literal["scene", "bench", "volume"],
    output: Output = Path("samples"),
    size: tuple[int, int] = (192, 256),
    common: Common = COMMON,
) -> Result:
    """Write sample data to try things on, with the truth beside it; nothing is downloaded.

    scene: a light field of opaque things and its disparity map. bench: camera file, white image and raw
    image of a plenoptic camera. volume: a microscope's raw image and the volume that it shows.

    Example: `lumigraph samples make -o samples`

    Example: `lumigraph samples make scene --size 768 1024 -o large`

    Parameters
    ----------
    action
        make: write the files.
    names
        Samples to write; all of them if left out.
    output
        Folder for the files; made if it does not exist.
    size
        Rows and columns of each of the scene's 9 x 9 views.
    """
    if output.exists() and not output.is_dir():
        raise FormatError(f"--output {output} is a file. Give a folder.")
    from lumigraph.samples import write
    from lumigraph.samples.folder import NAMES

    with progress("samples") as shown:
        files = write(output, names or NAMES, size=size, progress=shown)
    values = {"output": str(output), "files": [str(file) for file in files]}
    return Result("Samples", "", files, tuple(f"Wrote {file}" for file in files), extra=values)
