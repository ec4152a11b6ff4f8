"""Pages as folders: tiles on a server that knows only files, and the same pictures as the library's."""

import functools
import http.server
import json
import threading
from contextlib import contextmanager

import numpy as np
import pytest
from scipy import ndimage

import lumigraph as lg
from lumigraph import viewer
from lumigraph.cli import main
from lumigraph.errors import FormatError
from lumigraph.viewer.encoding import Coding
from lumigraph.viewer.opening import of_views, of_volume
from lumigraph.viewer.pyramid import Pyramid, halved
from viewer_pages import film, frames_of, two_planes

LEVELS = 1.0  # of 255: rounding is 0.5; another place of a tile by one sample differs by more than 20
FINER = "lumigraph.app.main.model.finer"


@contextmanager
def files(folder):
    """Address of a server that knows only files, and the paths that were asked of it with their bytes."""
    sent = {}

    class Handler(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

        def copyfile(self, source, outputfile):
            content = source.read()
            sent[self.path] = len(content)
            outputfile.write(content)

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=folder))
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/", sent
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def exported(thing, folder, coarse=16_000, tile=16, quality=100):
    return viewer.export_folder([thing], folder, coarse=coarse, tile=tile, quality=quality)


def at_rest(page, what, step):
    """Wait until a window of this step is there, and what is shown has been drawn with it."""
    page.page.evaluate("lumigraph.app.main.model.took = 1")  # as if this machine were quick
    page.wait(
        f"(lumigraph.app.schedule(), {FINER}.{what}.window?.step === {step} && !{FINER}.{what}.loading)"
    )
    page.set()


def test_half_as_many_samples_are_low_passed_by_the_binomial(rng):
    numbers = rng.integers(0, 65536, (2, 9, 12, 3), dtype=np.uint16)
    taps = np.array([1, 4, 6, 4, 1]) / 16
    wanted = ndimage.correlate1d(numbers.astype(float), taps, 1, mode="nearest")
    wanted = ndimage.correlate1d(wanted, taps, 2, mode="nearest")[:, ::2, ::2]
    found, _ = halved(numbers)
    assert found.shape == (2, 5, 6, 3)
    assert np.abs(found - wanted).max() <= 0.5


def test_samples_that_do_not_count_are_left_out_of_the_low_pass(rng):
    valid = rng.random((1, 20, 21)) > 0.3
    numbers = np.where(valid, 100, 255).astype(np.uint8)
    found, mask = halved(numbers, valid)
    assert found[mask].tolist() == [100] * mask.sum()
    assert 0.5 < mask.mean() < 1


def test_tiles_hold_every_number_and_the_coarsest_fits(tmp_path, rng):
    data = rng.integers(0, 256, (7, 50, 70), dtype=np.uint8)
    pyramid = Pyramid.of(data, 7 * 13 * 18, 16)
    assert pyramid.coarsest == 4
    tiles = {}
    coarsest, _ = pyramid.write(data, tiles.__setitem__)
    assert np.array_equal(coarsest, halved(halved(data)[0])[0])
    whole = np.concatenate(
        [np.concatenate([tiles[f"1/{j}-{i}/0"] for i in range(5)], 2) for j in range(4)], 1
    )
    assert np.array_equal(whole, data)
    assert Pyramid.of(data, 10**6).coarsest == 1


def test_pieces_have_one_range():
    data = np.stack([np.full((2, 2), np.nan), np.full((2, 2), -3.0), np.full((2, 2), 5.0)])
    assert Coding.of(data).offset == -3
    assert Coding.of(data).scale == pytest.approx(8 / 65535)


@pytest.mark.parametrize("masked", [False, True])
def test_finer_pictures_are_those_of_the_library(open_page, tmp_path, masked, rng):
    views = two_planes()
    if masked:
        valid = rng.random(views.data.shape[:4]) > 0.05
        views = lg.LightField(views.data, views.aperture, views.lenslets, views.separation, valid)
    exported(of_views("two planes", views), tmp_path / "page")
    with files(tmp_path / "page") as (address, sent):
        page = open_page(f"{address}#focus=0.93")
        at_rest(page, "views", 1)
        order = [name for name in sent if "/views" in name]
        assert "tiles" not in order[0]  # the coarsest come first
        assert "tiles/" in order[-1]
        assert np.abs(page.pixels() - levels(lg.refocus(views, 0.93, oversample=1))).max() <= LEVELS
        page.set(focus=1.12, aperture=0.6)
        page.set(focus=1.12, aperture=0.6)
        small = lg.reduce_aperture(views, 0.6)
        assert np.abs(page.pixels() - levels(lg.refocus(small, 1.12, oversample=1))).max() <= LEVELS


def test_only_the_part_on_the_screen_is_drawn(open_page, tmp_path):
    views = two_planes()
    large = lg.LightField(
        np.tile(views.data, (1, 1, 3, 3, 1)), views.aperture, lg.Grid((120, 192), 1.0), views.separation
    )
    exported(of_views("two planes", large), tmp_path / "page", coarse=120_000, tile=32)
    with files(tmp_path / "page") as (address, _):
        page = open_page(f"{address}#focus=0.93&zoom=6&at=9,24")
        at_rest(page, "views", 1)
        page.wait("lumigraph.app.main.finest?.factor === 0.25")
        found = page.pixels()
        low, origin, factor = page.page.evaluate(
            "(({ low, origin, factor }) => [low, origin, factor])(lumigraph.app.main.finest)"
        )
        top, left = (
            round(max(0, np.ceil((a - b) / factor)) + b / factor) for a, b in zip(low, origin, strict=True)
        )
        height, width = found.shape[:2]
        assert height < 120
        assert width < 192
        expected = levels(lg.refocus(large, 0.93, oversample=1))[top : top + height, left : left + width]
        assert np.abs(found - expected).max() <= LEVELS


def test_a_film_of_a_streamed_folder_is_as_fine_as_it_can_be(open_page, tmp_path):
    views = two_planes()
    exported(of_views("two planes", views), tmp_path / "page")
    with files(tmp_path / "page") as (address, _):
        page = open_page(address)
        page.page.evaluate("lumigraph.app.main.model.took = 1")
        assert page.page.evaluate("lumigraph.app.main.model.factor") == 4
        film(page, "pull", 1, tmp_path / "film.webm")
        low, high = page.page.evaluate("lumigraph.app.main.model.focus")
        _, pictures, _ = frames_of(tmp_path / "film.webm")
        assert pictures.shape == (25, 40, 64, 3)
        for k in (0, 9):
            alpha = low + (high - low) * (1 - np.cos(2 * np.pi * k / 25)) / 2
            assert np.sqrt(((pictures[k] - levels(lg.refocus(views, alpha, oversample=1))) ** 2).mean()) < 20


def levels(picture):
    found = np.clip(np.asarray(picture, float), 0, 255)
    return found if found.ndim == 3 else np.repeat(found[..., None], 3, -1)


def test_only_tiles_of_what_is_seen_are_loaded(open_page, tmp_path):
    views = two_planes()
    exported(of_views("two planes", views), tmp_path / "page", tile=8)
    with files(tmp_path / "page") as (address, sent):
        page = open_page(f"{address}#focus=1&aperture=0.1%25&view=2,2&zoom=6&at=2,3")
        at_rest(page, "views", 1)
        finest = [name for name in sent if "tiles/1/" in name]
        assert 0 < len(finest) < 40 * 64 / 64
        found = page.pixels()
        start = page.page.evaluate("lumigraph.app.main.finest.origin").copy()
        assert start == [0, 0]
        ny, nx = found.shape[:2]
        assert np.abs(found - levels(lg.sub_aperture(views, 2, 2))[:ny, :nx]).max() <= LEVELS


def test_planes_of_volumes_are_finer_too(open_page, tmp_path, rng):
    data = rng.random((5, 40, 60)).astype(np.float32)
    volume = lg.Volume(data, lg.Grid((40, 60), 1e-6), tuple(1e-6 * np.arange(5)))
    exported(of_volume("volume", volume), tmp_path / "page", coarse=8000)
    with files(tmp_path / "page") as (address, _):
        page = open_page(f"{address}#plane=3")
        page.wait("Boolean(lumigraph.app.main.model.arrays.volume)")
        at_rest(page, "volume", 1)
        white = json.loads((tmp_path / "page/data/about").read_bytes())["exhibits"][0]["volume"]["white"]
        assert np.abs(page.pixels() - levels(data[3] / white * 255)).max() <= LEVELS


def test_a_folder_that_holds_other_things_stays(tmp_path):
    views = of_views("two planes", two_planes())
    written = exported(views, tmp_path / "page")
    again = exported(views, tmp_path / "page")
    assert written == again
    (tmp_path / "page" / "notes.txt").write_text("mine")
    with pytest.raises(FormatError, match=r"would remove notes\.txt"):
        exported(views, tmp_path / "page")
    with pytest.raises(FormatError, match="is no folder of a page"):
        viewer.serve_folder(tmp_path)


def test_a_folder_is_served_by_the_names_of_its_files(tmp_path):
    written = exported(of_views("two planes", two_planes()), tmp_path / "page")
    (tmp_path / "page" / "link").symlink_to("/etc/hostname")
    site = viewer.serve_folder(tmp_path / "page")
    assert "link" not in site.resources
    assert len(site.resources) == written.files
    assert b"Content-Security-Policy" in bytes(site.resources[""].future().result())
    assert site.resources["app/main.js"].media_type.startswith("text/javascript")


def test_the_command_writes_folders(tmp_path, capsys):
    lg.save(two_planes(), tmp_path / "views.zarr")
    assert main(["view", str(tmp_path / "views.zarr"), "--export", str(tmp_path / "page")]) == 0
    assert "files, for any web server" in capsys.readouterr().out
    assert (tmp_path / "page" / "index.html").is_file()
    assert main(["view", str(tmp_path / "views.zarr"), "--export", str(tmp_path / "page.png")]) == 1
    assert "Give a file (.html), or a folder" in capsys.readouterr().err


def test_the_bar_of_an_export_of_two_things_stands_at_a_half_after_the_first(tmp_path, rng):
    volume = lg.Volume(rng.random((3, 64, 64)), lg.Grid((64, 64), 1e-6), (-1e-6, 0.0, 1e-6))
    for things, bar in ((1, [1]), (2, [0.5, 1])):
        seen, exhibits = [], [of_volume(str(k), volume) for k in range(things)]
        viewer.export_folder(exhibits, tmp_path / str(things), coarse=4_000, tile=16, progress=seen.append)
        assert seen == bar
