"""What pictures of a chart tell."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from lumigraph.analysis import Chart
from lumigraph.analysis.chart import find_chart
from lumigraph.errors import SamplingError
from lumigraph.metrology.datasheet import planes

TURN, FINE = np.radians(7), 6


def lens(frequency, cut):
    """Contrast that a round aperture leaves."""
    part = np.clip(np.abs(frequency) / cut, 0, 1)
    return 2 / np.pi * (np.arccos(part) - part * np.sqrt(1 - part**2))


def board(shape=106, cell=22.0, *, cut=None, wrong=0.0, tile=10):
    """A chessboard through an aperture, of tiles `wrong` times too wide each, about their own middles."""
    at = (np.arange(FINE * shape) + 0.5) / FINE
    at = at + wrong * ((at % tile) - tile / 2) - shape / 2
    y, x = at[:, None], at[None]
    a, b = ((np.cos(TURN) * u + np.sin(TURN) * v) / cell + 0.5 for u, v in ((x, y), (y, -x)))
    seen = (np.floor(a) + np.floor(b)) % 2
    if cut is not None:
        fine = np.fft.fftfreq(len(at), 1 / FINE)
        seen = np.fft.ifft2(np.fft.fft2(seen) * lens(np.hypot(fine[:, None], fine), cut)).real
    return seen.reshape(shape, FINE, shape, FINE).mean((1, 3))


def test_the_patch_is_that_of_the_straightest_corners(monkeypatch):
    """Depth says 10 where 10.4 is right: the picture at 10.4 is the one whose tiles fit."""
    pictures = {part: board(wrong=part / 1.04 - 1) for part in (0.96, 1.0, 1.04)}
    monkeypatch.setattr(planes, "_PATCHES", tuple(pictures))
    monkeypatch.setattr(planes, "rendered_at", lambda ready, patch, camera: pictures[patch / 10])
    tried = planes.straightest(None, 10.0, None)
    assert tried.chart.picture is pictures[1.04]
    assert tried.lenslet == 10
    assert [one.chart.picture for one in tried.beside] == [pictures[1.0]]


def test_intervals_hold_what_the_next_patch_would_have_given():
    """Corners that are straighter than their scale is sure: the scatter alone would say 0.01 %."""
    index = np.stack(np.mgrid[:6, :6], -1).reshape(-1, 2)
    rng, picture = np.random.default_rng(1), np.zeros((140, 140))
    ends = []
    for scale in (0.999, 1.0, 1.0005):
        corners = 10 + 22 * scale * index + rng.normal(0, 0.005, index.shape)
        ends.append(planes.TriedChart(Chart(picture, corners, index)))
    alone = ends[1]
    between = planes.TriedChart(alone.chart, 1.0, (ends[0], ends[2]))
    halves = []
    for tried in (alone, between):
        low, high = {q.name: q for q in planes.of_chart(tried, 22e-3)}["sample_on_chart"].interval
        halves.append((high - low) / 2 / 1e-3)
    assert halves[0] < 1e-4
    assert halves[1] == pytest.approx(1.96 * 1e-3 / np.sqrt(3), rel=0.1)  # the farther neighbour counts


def test_no_chart_at_any_patch_is_refused(monkeypatch):
    monkeypatch.setattr(planes, "rendered_at", lambda *_: np.ones((40, 40)))
    with pytest.raises(SamplingError, match="no corners of a chessboard"):
        planes.straightest(None, 10.0, None)


@pytest.mark.parametrize("cut", [1.25, 5.0])
def test_short_edges_read_high_within_their_interval(cut):
    """Square samples and a lens: MTF50 by its closed form. The scatter of the edges alone would miss it."""
    frequency = np.linspace(0, 1, 4001)
    true = frequency[np.argmax(np.sinc(frequency) * lens(frequency, cut) < 0.5)]
    chart = find_chart(board(cut=cut))
    found = {q.name: q for q in planes.of_chart(planes.TriedChart(chart), None)}["mtf50_middle"]
    low, high = found.interval
    assert low < true < high
    assert low < true < 2 * found.value - high  # below what the scatter holds
    assert found.value - low < 0.06 * true


class Edge(NamedTuple):
    """An edge that half contrast, or a tenth of it, is known of."""

    half: float
    mtf: np.ndarray = np.linspace(1, 0, 20)

    def at(self, contrast):
        return self.half if contrast == 0.5 else 2 * self.half


def test_edges_that_noise_spoils_are_left_out():
    """One of 16 reads six times as high: their mean would be a third too high."""
    rng = np.random.default_rng(1)
    halves = [*rng.normal(0.3, 0.01, 15), 1.8]
    chart = SimpleNamespace(
        picture=np.zeros((100, 100)), spacing=22.0, edge_length=17,
        edges=lambda: ((np.array([50.0, 50.0]), Edge(half)) for half in halves),
    )  # fmt: skip
    entries = {one.quantity.name: one for one in planes._sharpness(chart, None)}
    assert entries["mtf50_middle"].value == pytest.approx(0.3, abs=0.01)
    assert "mean over 15 slanted edges" in entries["mtf50_middle"].how
    assert "1 far off the others left out" in entries["mtf50_middle"].how
    halves[7:] = []  # too few to tell a stray
    assert (
        "mean over 7"
        in {one.quantity.name: one for one in planes._sharpness(chart, None)}["mtf10_middle"].how
    )
