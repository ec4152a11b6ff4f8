"""One kind of progress: fractions, which may say what goes on."""

import re
from pathlib import Path

from lumigraph.core.progress import Stage, part, silent, what_of, within

SOURCES = Path(__file__).parents[2] / "src" / "lumigraph"


def test_parts_of_a_whole_follow_one_another():
    seen = []
    for number in range(3):
        for fraction in (0.0, 1.0):
            part(seen.append, number, 3)(fraction)
    assert seen == [0, 1 / 3, 1 / 3, 2 / 3, 2 / 3, 1]


def test_what_goes_on_is_told_from_the_outside_in():
    seen = []
    whole = within(seen.append, 0.5, 1.0, "camera")
    whole(Stage(0.5, "white image"))
    whole(1.0)
    within(seen.append, 0.0, 0.5)(0.5)
    assert seen == [0.75, 1.0, 0.25]
    assert [what_of(one) for one in seen] == ["camera: white image", "camera", ""]


def test_nobody_has_to_look():
    within(None, 0.0, 1.0)(0.5)
    silent(0.5)


def test_there_is_no_other_type_of_progress():
    own = [
        path.relative_to(SOURCES).as_posix()
        for path in SOURCES.rglob("*.py")
        if re.search(r"(?m)^(Progress|Tell|Count|Stages)\b.*= ", path.read_text("utf-8"))
        or re.search(r"progress: Callable", path.read_text("utf-8"))
    ]
    assert own == ["core/progress.py"]
