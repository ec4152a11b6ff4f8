"""MATLAB files: version 7.3, which is HDF5, and version 5; read, not written.

The variable ``LF`` of the Light Field Toolbox is (row, column, y, x, c), its last colour the weight of a
sample.
"""

from math import prod
from pathlib import Path

from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io import arrays, hdf5, mat5, source


def load(
    path: Path, *, what: str | None = None, axes: str | None = None, max_pixels: int = source.MAX_PIXELS
) -> RawImage | LightField | Stack | Volume:
    """A picture, a stack or the light field in a variable of a MATLAB file.

    Parameters
    ----------
    path
        A .mat file.
    what
        Name of the variable; "LF", or the only array of numbers, if left out.
    axes
        What its axes are, as MATLAB's `size` orders them in version 5, as HDF5 stores them (reverse) in 7.3.
    max_pixels
        Larger ones are refused.

    Raises
    ------
    FormatError
        Neither version, damaged, too large, no such variable, or several and no choice.
    """
    if _is_hdf5(path := source.regular_file(path)):
        return hdf5.load(path, what=what, axes=axes, max_pixels=max_pixels)
    with source.decoding(path, "a MATLAB file"):
        variable = _chosen(path, mat5.variables(path), what)
        name, shape = variable.name, variable.shape
        data = mat5.values(path, variable, max_pixels=max_pixels)
        letters = arrays.arrangement(f"{name} of {path}", shape, axes=axes, reverse=False, weighted=True)
        return arrays.as_noun(data, letters, {}, weighted=name == "LF")


def contents(path: Path) -> list[tuple[str, str, str]]:
    """The arrays of numbers of a file: (name, noun, about) each."""
    if _is_hdf5(path := source.regular_file(path)):
        return hdf5.contents(path)
    with source.decoding(path, "a MATLAB file"):
        return [
            (each.name, _noun(each), f"{_times(each.shape)}, {each.kind}")
            for each in mat5.variables(path)
            if _is_read(each)
        ]


def _noun(variable: mat5.Variable) -> str:
    try:
        return arrays.noun_of(arrays.arrangement("", variable.shape, reverse=False, weighted=True))
    except FormatError:
        return "array"


def _is_hdf5(path: Path) -> bool:
    with path.open("rb") as file:
        start = file.read(520)
    if hdf5.SIGNATURE in (start[:8], start[512:]):
        return True
    source.check_signature(path, start[:10], "MATLAB")
    return False


def _is_read(variable: mat5.Variable) -> bool:
    shape = variable.shape
    return variable.dtype is not None and 2 <= len(shape) <= 5 and prod(shape) > 1


def _chosen(path: Path, found: list[mat5.Variable], what: str | None) -> mat5.Variable:
    """The variable that is asked for, ``LF``, or the only one that can be read; others are named."""
    read = [each for each in found if _is_read(each)]
    names = ", ".join(each.name for each in read[:8])
    wanted = "LF" if what is None and any(each.name == "LF" for each in found) else what
    fits = [each for each in found if each.name == wanted] if wanted is not None else read
    if wanted is not None and not any(map(_is_read, fits)):
        # Another one instead of an LF that cannot be read would be the wrong one without a word.
        about = f": it is {_about(fits[0])}" if fits else ""
        raise FormatError(
            f"{path} has no array of numbers {wanted!r}{about}. It holds {names or 'nothing that is read'}."
        )
    if len(fits) == 1:
        return fits[0]
    if len({each.name for each in fits}) == 1:
        name = fits[0].name
        raise FormatError(f"{path} is damaged: {len(fits)} variables are called {name!r}. Save it again.")
    if not fits:
        others = ", ".join(f"{each.name} ({_about(each)})" for each in found[:8])
        but = f", only {others}" if others else ""
        raise FormatError(f"{path} holds no array of 2 to 5 axes of real numbers{but}. Check the file.")
    raise FormatError(f"{path} holds {names}. Choose one by what=.")


def _about(variable: mat5.Variable) -> str:
    return f"{_times(variable.shape)} {variable.kind}".lstrip()


def _times(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
