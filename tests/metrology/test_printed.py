"""Printed charts have true sizes: what is drawn on the page is found where the board says."""

import io

import numpy as np
import pytest
from PIL import Image

import lumigraph as lg
from lumigraph.metrology import Board, chart
from lumigraph.metrology.boards.chessboard import find
from lumigraph.scene.usaf import bar_width

DOTS = 4  # pixels to the millimetre


def printed(what, paper="A4", **options):
    """The page in grey, 4 pixels to the millimetre."""
    file = io.BytesIO()
    chart(what, paper, **options).savefig(file, format="png", dpi=DOTS * 25.4)
    return np.asarray(Image.open(file).convert("L"), np.float64)


@pytest.mark.parametrize(
    "text",
    [
        "9 x 5 corners, 25 mm", "9 x 6 charuco, 25 mm, markers 18 mm, DICT_4X4_50",
        "11 x 4 dots, 20 mm, dots 9 mm", "4 x 11 asymmetric dots, 15 mm",
    ],
)  # fmt: skip
def test_boards_are_found_where_they_say_to_a_twentieth_of_a_millimetre(text):
    """Places of all corners, in their order, but for where the board stands; a white margin is there."""
    pytest.importorskip("cv2")
    board = Board.from_text(text)
    page = printed(text)[: 190 * DOTS, 14 * DOTS :]  # without words, whose letters pass for dots
    found = find(page, board, "the page") / DOTS
    true = board.points()[:, 1:] * 1e3
    off = (found - found.mean(0)) - (true - true.mean(0))
    if board.pattern in ("corners", "dots"):  # look the same from both ends
        off = min(off, -(found - found.mean(0)) - (true - true.mean(0)), key=lambda one: np.abs(one).max())
    assert np.abs(off).max() < 0.05
    assert board.text == text


def test_rulers_are_100_millimetres_long():
    page = printed("edge, 50 mm") < 128
    rows, columns = page.any(1), page.any(0)
    across = max(np.ptp(np.flatnonzero(page[k])) for k in range(194 * DOTS, 197 * DOTS) if rows[k])
    assert across + 1 == pytest.approx(100 * DOTS, abs=1)
    left = np.flatnonzero(columns)[:8]
    assert max(np.ptp(np.flatnonzero(page[:, k])) for k in left) + 1 == pytest.approx(100 * DOTS, abs=1)


def test_pages_have_the_papers_size(tmp_path):
    figure = chart("siemens", "A3")
    figure.savefig(tmp_path / "star.svg")
    figure.savefig(tmp_path / "star.pdf")
    assert 'width="1190.551181pt" height="841.889764pt"' in (tmp_path / "star.svg").read_text()
    assert b"MediaBox [ 0 0 1190.5511811024 841.8897637795 ]" in (tmp_path / "star.pdf").read_bytes()
    small = chart("5 x 5 corners, 10 mm", "100 mm x 120 mm").get_size_inches() * 25.4
    assert small == pytest.approx([100, 120])
    upright = chart("5 x 9 corners, 25 mm", "letter").get_size_inches() * 25.4
    assert upright == pytest.approx([215.9, 279.4])


def test_a_star_has_its_sectors_an_edge_its_area_and_bars_their_width():
    star = printed("siemens, 120 mm") < 128
    middle = np.array([8 + 182 / 2, 14 + 275 / 2]) * DOTS
    angle = np.arange(3600) * np.pi / 1800
    ring = (middle[:, None] + 45 * DOTS * np.stack([np.sin(angle), np.cos(angle)])).astype(int)
    assert np.count_nonzero(np.diff(star[tuple(ring)].astype(int)) == 1) == 36
    assert not star[int(middle[0]), int(middle[1]) + 45 * DOTS]  # bright on +x
    edge = printed("edge, 60 mm")[: 190 * DOTS, 15 * DOTS :]
    assert (1 - edge / 255).sum() / DOTS**2 == pytest.approx(3600, rel=1e-3)
    bars = 1 - printed("usaf, -3:-3")[: 190 * DOTS, 15 * DOTS :] / 255
    area = sum(30 * (bar_width(-3, k) * 1e3) ** 2 for k in range(1, 7))
    assert bars.sum() / DOTS**2 == pytest.approx(area, rel=2e-3)


def test_a_turned_board_is_turned_clockwise():
    pytest.importorskip("cv2")
    found = find(printed("8 x 5 corners, 20 mm", turn=np.radians(7)), Board((5, 8), 0.02), "the page")
    y, x = (found[7] - found[0]) * np.sign(found[7, 1] - found[0, 1])
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(7, abs=0.02)


def test_a_texture_fills_the_page_with_its_grains():
    page = printed("texture, 2 mm")[20 * DOTS : 180 * DOTS, 20 * DOTS : 280 * DOTS] / 255
    power = np.abs(np.fft.fft(page - page.mean(), axis=1)) ** 2
    correlation = np.fft.ifft(power.mean(0)).real
    at = np.arange(4 * DOTS)
    # A Gaussian blur of 2 mm leaves a correlation of exp(-d²/4σ²).
    assert correlation[at] / correlation[0] == pytest.approx(np.exp(-((at / DOTS / 2) ** 2) / 4), abs=0.05)


@pytest.mark.parametrize(
    ("what", "paper", "message"),
    [
        ("9 x 5 corners, 40 mm", "A4", r"400 x 240 mm but the paper has room for .* Make it 68 %"),
        ("circle", "A4", "must be a board"),
        ("edge, 100", "A4", "unit"),
        ("usaf, 2:1", "A4", "first and the last"),
        ("siemens", "B7", "paper is 'B7'"),
        ("texture, 1 um", "A4", "Give larger"),
    ],
)
def test_what_cannot_be_printed_is_refused(what, paper, message):
    with pytest.raises(lg.LumigraphError, match=message):
        chart(what, paper)


def test_the_verb_writes_a_page(tmp_path, monkeypatch, capsys):
    from lumigraph.cli import main

    monkeypatch.chdir(tmp_path)
    assert main(["chart", "9 x 5 corners, 20 mm", "--turn", "7 deg", "-o", "board.pdf"]) == 0
    assert "297 x 210 mm" in capsys.readouterr().out
    assert (tmp_path / "board.pdf").read_bytes().startswith(b"%PDF")
