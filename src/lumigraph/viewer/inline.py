"""The viewer's page inside a notebook."""

import html
from dataclasses import dataclass
from typing import Any

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.viewer import opening
from lumigraph.viewer.exhibit import Exhibit
from lumigraph.viewer.single_file import exported


@dataclass(frozen=True, slots=True)
class InlinePage:
    """A page that a notebook shows in a separate frame.

    Parameters
    ----------
    page
        HTML of the whole page, as `viewer.export` writes it.
    height
        Of the frame [CSS pixels].
    """

    page: str
    height: int = 560

    def _repr_html_(self) -> str:
        # The frame has no origin: the page inside reaches neither the notebook nor the network.
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" sandbox="allow-scripts allow-downloads" '
            f'title="lumigraph" style="width:100%;height:{self.height}px;border:0"></iframe>'
        )


def view_inline(
    thing: Any, calibration: Calibration | None = None, *, height: int = 560, quality: int = 90
) -> InlinePage:
    """The viewer's page for something in memory, which a notebook shows where it is the cell's result.

    Parameters
    ----------
    thing
        `LightField`, `RawImage`, `Stack` or `Volume`.
    calibration
        Of a raw image, which is then decoded too.
    height
        Of the frame [CSS pixels].
    quality
        Of views as pictures, 1 to 99; 100 keeps every number, in a notebook several times as large.

    Raises
    ------
    FormatError
        Something that has no picture, or a calibration without a raw image.
    LumigraphError
        NaN, or a page that is too large for a browser: take fewer views or a smaller part.

    Examples
    --------
    ``lumigraph.view_inline(views)``
    """
    height = checks.whole("height", height, error=FormatError)
    text, _ = exported([exhibit_of(thing, calibration)], quality)
    return InlinePage(text, height)


def exhibit_of(thing: Any, calibration: Calibration | None) -> Exhibit:
    """Exhibit of something in memory; refused if it has no picture."""
    if isinstance(thing, RawImage):
        return opening.of_raw("raw image", thing, calibration)
    if calibration is not None:
        raise FormatError(f"a {type(thing).__name__} needs no calibration. Leave it out.")
    match thing:
        case LightField():
            return opening.of_views("light field", thing)
        case Stack():
            return opening.of_stack("stack", thing)
        case Volume():
            return opening.of_volume("volume", thing)
    raise FormatError(f"a {type(thing).__name__} has no page. Give a LightField, RawImage, Stack or Volume.")
