import pytest

from lumigraph.core import memory


@pytest.fixture
def group(tmp_path, monkeypatch):
    """A control group that may take 1 GiB, of which 600 MiB are used, 100 of them by files nobody reads."""
    monkeypatch.setattr(memory, "_GROUP", tmp_path)
    (tmp_path / "memory.max").write_text(f"{2**30}\n")
    (tmp_path / "memory.current").write_text(f"{600 * 2**20}\n")
    (tmp_path / "memory.stat").write_text(f"anon 1\ninactive_file {100 * 2**20}\nactive_file 5\n")
    return tmp_path


def test_a_container_has_what_its_bound_leaves(group):
    assert memory.available() == 524 * 2**20
    assert memory.total() == 2**30


def test_without_a_bound_the_machine_counts(group):
    (group / "memory.max").write_text("max\n")
    assert memory.available() > 2**30
    assert memory.total() > 2**30
