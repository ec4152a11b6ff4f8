"""Short edges of a chessboard read MTF50 and MTF10 high: by how much, and whether the intervals hold it.

``python -m benchmarks.edges [--pictures 40] [--seed 0]`` draws chessboards through the OTF of a round
aperture onto square samples, with noise, and measures them as data sheets do.
"""

import argparse

import numpy as np

from lumigraph.analysis.chart import find_chart
from lumigraph.metrology.datasheet import planes

FINE = 8  # points to a sample


def mtf(frequency, cut):
    """Of a round aperture and a square sample."""
    part = np.clip(np.abs(frequency) / cut, 0, 1)
    return np.sinc(frequency) * 2 / np.pi * (np.arccos(part) - part * np.sqrt(1 - part**2))


def picture(shape, cell, turn, cut, rng):
    """Chessboard (shape, shape) of squares `cell` samples wide; the aperture cuts off at `cut` a sample."""
    count = shape * FINE
    y, x = (np.indices((count, count)) + 0.5) / FINE - shape / 2 + rng.uniform(-3, 3, (2, 1, 1))
    a, b = ((np.cos(turn) * u + np.sin(turn) * v) / cell + 0.5 for u, v in ((x, y), (y, -x)))
    fine = np.fft.fftfreq(count, 1 / FINE)
    part = np.clip(np.hypot(fine[:, None], fine) / cut, 0, 1)
    otf = 2 / np.pi * (np.arccos(part) - part * np.sqrt(1 - part**2))
    seen = np.fft.ifft2(np.fft.fft2((np.floor(a) + np.floor(b)) % 2) * otf).real
    seen = seen.reshape(shape, FINE, shape, FINE).mean((1, 3))
    return seen + rng.normal(0, 0.005, seen.shape)


def measured(rng):
    """(edge's length, measured over true, whether the interval holds the truth) of MTF50 and MTF10."""
    cell, cut = rng.uniform(22, 40), np.exp(rng.uniform(np.log(0.8), np.log(8)))
    shape = 53 if cell < 27 and rng.random() < 0.5 else 110
    chart = find_chart(picture(shape, cell, np.radians(rng.uniform(5, 9)), cut, rng))
    frequency = np.linspace(0, 1, 4001)
    found = {q.name: q for q in planes.of_chart(planes.TriedChart(chart), None)}
    for percent in (50, 10):
        q = found[f"mtf{percent}_middle"]
        if q.value is not None and q.interval:
            true = frequency[np.argmax(mtf(frequency, cut) < percent / 100)]
            yield chart.edge_length, q.value / true, q.interval[0] <= true <= q.interval[1]


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    found = np.array([one for _ in range(given.pictures) for one in measured(rng)], float)
    high = found[:, 0] * (found[:, 1] - 1)
    print(
        f"{len(found)} values: (measured / true - 1) times the edge's length {high.mean():.2f} ± "
        f"{high.std():.2f}, {high.min():.2f} to {high.max():.2f}; truth inside {found[:, 2].mean():.1%}"
    )


if __name__ == "__main__":
    main()
