"""Verbs that take one page of a stack of raw images, and those that take all of them."""

import json

import numpy as np
import pytest

from lumigraph import io, viewer
from lumigraph.core.stack import Stack
from lumigraph.errors import FormatError


@pytest.fixture
def film(bench):
    """Two raw images and two white ones, the first half as bright, as stacks."""
    for name in ("raw", "white"):
        data = io.open(bench / f"{name}.tiff").data
        io.save(Stack(np.stack([data // 2, data])), bench / f"{name}s.tiff")
    return bench


def test_verbs_take_a_page_of_a_stack_and_refuse_one_without_it(lumigraph, film):
    words = ("--white", "white.tiff", "-o", "views.zarr")
    assert "has 2 pages. Give --page 0 to 1.\n" in lumigraph("decode", "raws.tiff", *words).err
    assert "Give one of them." in lumigraph("decode", "raws.tiff", "--page", 2, *words).err
    assert lumigraph("decode", "raws.tiff", "--page", 1, *words).code == 0
    second = io.open("views.zarr").data
    assert lumigraph("decode", "raw.tiff", *words, "--overwrite").code == 0
    np.testing.assert_array_equal(second, io.open("views.zarr").data)


def test_the_viewer_shows_a_page_of_a_stack_of_raw_images(film):
    white = film / "white.tiff"
    shown = viewer.open_exhibit(film / "raws.tiff", viewer.Origin(white=white, page=1))
    whole = viewer.open_exhibit(film / "raw.tiff", viewer.Origin(white=white))
    np.testing.assert_array_equal(shown.raw.data, whole.raw.data)
    assert viewer.open_exhibit(film / "raws.tiff").planes is not None, "a stack by itself"
    with pytest.raises(FormatError, match=r"has 2 pages\. Give --page 0 to 1"):
        viewer.open_exhibit(film / "raws.tiff", viewer.Origin(white=white))
    with pytest.raises(FormatError, match=r"--page is 1 but .* has one page"):
        viewer.open_exhibit(film / "raw.tiff", viewer.Origin(white=white, page=1))


def test_pages_of_white_images_are_averaged_and_those_of_even_ones_compared(lumigraph, film):
    found = lumigraph("calibrate", "whites.tiff", "-o", "c.toml", "--json")
    assert json.loads(found.out)["pitch_px"] == pytest.approx(11.5, abs=0.02)
    measured = lumigraph("measure", "noise", "whites.tiff", "--json")
    assert json.loads(measured.out)["fixed_pattern"] > 100
    assert "takes one picture, not 2" in lumigraph("measure", "edge", "whites.tiff").err
