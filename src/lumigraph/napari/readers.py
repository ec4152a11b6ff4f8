"""Files that `lumigraph.open` reads, as layers."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lumigraph import io, samples
from lumigraph.core.layers import LayerData
from lumigraph.errors import FormatError
from lumigraph.io.formats import format_of
from lumigraph.napari.shown import depth_beside, layer_of

Read = Callable[[Any], list[LayerData]]


def reader(path: str | Sequence[str]) -> Read | None:
    """A function that opens files; None where an ending is not known."""
    try:
        for each in _paths(path):
            format_of(each)
    except FormatError:
        return None
    return opened


def opened(path: str | Sequence[str]) -> list[LayerData]:
    """Layers of one file, a folder of views or several files."""
    return [layer_of(io.open(each), each.name.partition(".")[0]) for each in _paths(path)]


def sample_scene() -> list[LayerData]:
    """Views of the painted scene, and the truth about their depths."""
    found = samples.scene()
    truth = depth_beside(found.views, found.disparity, "disparity, truth")
    return [layer_of(found.views, "scene"), (truth[0], truth[1] | {"visible": False}, truth[2])]


def _paths(path: str | Sequence[str]) -> list[Path]:
    return [Path(path)] if isinstance(path, str) else [Path(each) for each in path]
