"""Every experiment at full size; `lumigraph reproduce` finds the results and writes its report."""

from pathlib import Path

import pytest

from lumigraph.studies.thesis import experiments, run

FOLDER = Path(__file__).parents[2] / "reproduce"


@pytest.mark.long
@pytest.mark.filterwarnings("default")  # the command prints them
@pytest.mark.parametrize("one", [pytest.param(one, id=one.id) for one in experiments()])
def test_every_row_passes(one):
    (result,) = run.run([one], FOLDER)
    failed = [f"{row.quantity}: {row.got:.6g}, not {row.expected:.6g}" for row in result.failed]
    assert not failed, result.error
    assert result.why
