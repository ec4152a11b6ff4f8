"""Useful range of refocus factors."""

from lumigraph.core.lightfield import LightField

_NEAREST = 0.02  # the least factor
_STILL = 0.5  # span where there is one view


def focus_range(views: LightField) -> tuple[float, float]:
    """Refocus factors (first, last) worth looking at: the outermost view moves by up to 14 lenslets.

    In small pictures a tenth of the picture is enough, 3 lenslets at least.
    """
    span = focus_span(views)
    return max(1 - span, _NEAREST), 1 + span


def focus_span(views: LightField) -> float:
    """Refocus factors worth looking at lie this far from 1."""
    reach = max(
        max(abs(aperture)) / pitch
        for aperture, pitch in zip(
            (views.aperture.y, views.aperture.x), views.lenslets.pitch, strict=True
        )
    )  # fmt: skip
    most = min(14.0, max(3.0, 0.1 * min(views.lenslets.shape)))
    return most / reach if reach > 0 else _STILL
