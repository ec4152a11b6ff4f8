"""A page is one file that needs nothing else, shows what it was given and escapes what it must."""

import base64
import io
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.report import Page


class Tags(HTMLParser):
    """Start tags with their attributes, and whether every tag that must be closed was."""

    VOID = ("meta", "img", "input", "br", "link")

    def __init__(self, text):
        super().__init__()
        self.found, self.open = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def all(self, tag):
        return [attributes for name, attributes in self.found if name == tag]


def pixels(uri):
    assert uri.startswith("data:image/png;base64,")
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.split(",")[1]))))


@pytest.fixture
def page():
    page = Page("A <title> & more", "First.\n\nSecond.")
    page.section("One").text("A paragraph.\n\nAnother.").lines("a  b\n  c").table(
        {"f": "60 mm", "p": "150 µm"}
    )
    two = page.section("Two").figure(np.array([[0.0, 0.5, 1.0]]), "Three pixels", zoom=20)
    two.figure(np.zeros((4, 5, 3), np.uint8), "Black", alt="nothing", wide=True).text("End.")
    page.section("Three").table([(1, 2), (3, 4)], header=("a", "b"), caption="Numbers")
    return page


def test_the_page_is_well_formed_and_loads_nothing(page):
    html = page.html()
    tags = Tags(html)
    assert tags.open == []
    assert not tags.all("link")
    assert not tags.all("script")
    assert all(attributes["src"].startswith("data:") for attributes in tags.all("img"))
    assert not re.search(r"https?://|url\(|@import", html)
    assert "default-src 'none'" in html
    assert all(attributes["alt"] for attributes in tags.all("img"))
    assert len({attributes["id"] for attributes in tags.all("input")}) == 2
    assert [a["href"][1:] for a in tags.all("a")] == [s["id"] for s in tags.all("section")]


def test_text_is_escaped_and_kept(page):
    html = page.html()
    assert "<title>A &lt;title&gt; &amp; more</title>" in html
    assert "<p>First.</p>\n<p>Second.</p>" in html
    assert "<pre>a  b\n  c</pre>" in html
    assert '<th scope="row">f</th><td>60 mm</td>' in html
    assert '<th scope="col">a</th><th scope="col">b</th>' in html


def test_pictures_show_the_array_and_zoom_by_squares(page):
    first, second = Tags(page.html()).all("img")
    np.testing.assert_array_equal(pixels(first["src"]), [[0, 128, 255]])
    assert (first["width"], first["height"], first["class"]) == ("60", "20", "pixelated")
    assert (second["width"], second["alt"], second.get("class")) == ("5", "nothing", None)


def test_a_raw_image_is_shown_on_the_scale_of_its_bit_depth():
    raw = RawImage(np.array([[0, 1024], [2048, 0]], np.uint16), bit_depth=12)
    (image,) = Tags(_html(raw)).all("img")
    np.testing.assert_array_equal(pixels(image["src"]), [[0, 64], [128, 0]])
    (image,) = Tags(_html(raw, white=2048.0)).all("img")
    np.testing.assert_array_equal(pixels(image["src"]), [[0, 128], [255, 0]])


def test_a_matplotlib_figure_is_embedded():
    from matplotlib.figure import Figure

    (image,) = Tags(_html(Figure(figsize=(2, 1)))).all("img")
    assert pixels(image["src"]).shape[:2] == (110, 220)


def _html(image, **options):
    page = Page("t")
    page.section("s").figure(image, "c", **options)
    return page.html()


def test_bad_tables_zooms_and_arrays_are_refused():
    section = Page("t").section("s")
    with pytest.raises(FormatError, match=r"the table 's' has rows of \[1, 2\] cells"):
        section.table([(1, 2), (3,)])
    with pytest.raises(FormatError, match="zoom is 0 but must be a whole number from 1"):
        section.figure(np.ones((2, 2)), "c", zoom=0)
    with pytest.raises(FormatError, match="has 1 NaN"):
        section.figure(np.array([[np.nan, 1.0]]), "c")
    with pytest.raises(FormatError, match=r"has shape \(3,\)"):
        section.figure(np.ones(3), "c")


def test_writing_replaces_and_makes_the_folder(tmp_path, page):
    page.write(tmp_path / "r.html")
    page.write(tmp_path / "r.html")
    assert (tmp_path / "r.html").read_text("utf-8") == page.html()
    assert len(list(tmp_path.iterdir())) == 1
    page.write(tmp_path / "new" / "folder" / "r.html")
    assert (tmp_path / "new" / "folder" / "r.html").exists()
    with pytest.raises(FormatError, match=r"r.html is a file, not a folder for s.html"):
        page.write(tmp_path / "r.html" / "s.html")


def test_a_page_shows_another_in_a_frame():
    page = Page("two")
    page.section("one").frame("other.html#mode=depth", "The other")
    assert '<iframe src="other.html#mode=depth" title="The other"' in page.html()
