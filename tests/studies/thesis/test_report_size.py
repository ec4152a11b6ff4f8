"""The report of the thesis' experiments: each camera once, pictures of few bytes."""

import matplotlib.pyplot as plt
import numpy as np

from lumigraph.report.pictures import picture
from lumigraph.studies.thesis import find, pages, run


def test_a_picture_in_few_colours_is_smaller_and_looks_the_same():
    figure, axes = plt.subplots()
    axes.imshow(np.random.default_rng(0).random((40, 40)), cmap="magma")
    whole = picture(figure, "noise")
    plt.close(figure)
    small = run.compact(whole)
    assert len(small.uri) < 0.7 * len(whole.uri)
    assert (small.width, small.height, small.caption) == (whole.width, whole.height, whole.caption)


def test_a_camera_is_drawn_once_in_a_report(tmp_path):
    chosen = find(["figure-3.6", "table-3.1", "figure-3.19"])  # one camera
    results = [run.StoredResult(one.id, (), (), "", 0.0) for one in chosen]
    pages.write_report(chosen, results, tmp_path / "report.html", quick=True)
    text = (tmp_path / "report.html").read_text("utf-8")
    assert text.count("data:image/png") == 1
    assert text.count("drawn under table-3.1") == 2
