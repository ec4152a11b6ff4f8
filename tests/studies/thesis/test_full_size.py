"""Every experiment at full size; `lumigraph reproduce` finds the results and writes its report."""

import os
from pathlib import Path

import pytest

from lumigraph.studies.thesis import experiments, run

FOLDER = Path(__file__).parents[3] / "reproduce"


@pytest.mark.long
@pytest.mark.filterwarnings("default")  # the command prints them
@pytest.mark.parametrize("one", [pytest.param(one, id=one.id) for one in experiments()])
def test_every_row_passes(one):
    (result,) = run.run([one], FOLDER)
    if one.id == "figure-4.8":  # its last row is there where the raw images are
        real = Path(os.environ.get("LUMIGRAPH_DATA", ""), "letters_plenoptic1", "letters_ULF_M1.png")
        assert len(result.rows) == 7 + real.is_file()
    failed = [f"{row.quantity}: {row.got:.6g}, not {row.expected:.6g}" for row in result.failed]
    assert not failed, result.error
    assert result.why
