"""Files that hold finished pictures and maps instead of a raw image: the containers of Lytro's software."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from lumigraph.cli import files
from lumigraph.cli.refocus import MOST_SHOWN
from lumigraph.core.result import Figure, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.raw import RawImage

_MADE = ("stack", "depth", "confidence", "lut", "thumbnail")
"""Parts of a Lytro container that are made from its raw frame."""


def parts_of(path: Path) -> list[str]:
    """Names of a container's pictures and maps; none where the file has a raw frame, or is another kind.

    Raises
    ------
    FormatError
        Damaged.
    """
    from lumigraph import io
    from lumigraph.io.formats import format_of

    if not path.is_file() or format_of(path).module != "lytro":
        return []
    names = [part.name for part in io.contents(path)]
    return [] if "raw" in names else [name for name in names if name in _MADE]


def unpack(path: Path, parts: list[str], output: Path) -> Result:
    """Write the pictures (.png) and maps (.tiff) of a container into a folder.

    Raises
    ------
    FormatError
        Damaged, or the output is no folder.
    """
    from lumigraph import io
    from lumigraph.io.target import check_parent

    if output.suffix or (output.exists() and not output.is_dir()):
        raise FormatError(
            f"{path} holds no raw image but pictures ({', '.join(parts)}) and {output} is one file. "
            "Give -o a folder, a name without extension."
        )
    check_parent(output)
    found = {name: picture for part in parts for name, picture in _named(part, io.open(path, what=part))}
    files.check_inside(output / name for name in found)
    output.mkdir(parents=True, exist_ok=True)
    for name, picture in found.items():
        io.save(picture, output / name)
    sizes = {name: _size(name, picture) for name, picture in found.items()}
    return Result(
        "Decode", "Pictures and maps of a Lytro container, as its software made them.", found,
        tuple(f"{name}: {size}" for name, size in sizes.items()), (),
        lambda: [Figure(picture, name) for name, picture in list(found.items())[:MOST_SHOWN]],
        written=tuple(output / name for name in found),
    )  # fmt: skip


def _named(part: str, thing: Any) -> "list[tuple[str, RawImage]]":
    """File names and pictures of a part: one for each picture of a stack."""
    from lumigraph.core.raw import RawImage

    if part == "stack":
        places = thing.positions or (None,) * len(thing)
        names = ["" if place is None else f"-{thing.quantity}{place:+.4f}" for place in places]
        return [
            (f"stack-{k:03}{names[k]}.png", RawImage(picture, bit_depth=thing.bit_depth))
            for k, picture in enumerate(thing)
        ]
    return [(f"{part}.{'png' if part == 'thumbnail' else 'tiff'}", thing)]


def _size(name: str, picture: "RawImage") -> str:
    size = " x ".join(map(str, picture.data.shape[:2])) + " px"
    if picture.data.dtype.kind != "f":
        return size
    unit = "" if name.startswith("confidence") else " lambda"
    return f"{size}, {picture.data.min():.4g} to {picture.data.max():.4g}{unit}"
