"""Which command wrote a file is known as long as the file is as it was written."""

from lumigraph.store import note_writer, writer_of


def test_a_writer_is_known_until_the_file_changes(tmp_path, monkeypatch):
    monkeypatch.setenv("LUMIGRAPH_CACHE", str(tmp_path / "cache"))
    file = tmp_path / "a.tiff"
    file.write_bytes(b"one")
    assert writer_of(file) is None
    note_writer(file, ["decode", "raw.png"])
    assert writer_of(file) == ["decode", "raw.png"]
    file.write_bytes(b"other")
    assert writer_of(file) is None


def test_nothing_is_known_without_a_cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("LUMIGRAPH_CACHE", "off")
    file = tmp_path / "a.tiff"
    file.write_bytes(b"one")
    note_writer(file, ["decode", "raw.png"])
    assert writer_of(file) is None


def test_old_records_go(tmp_path, monkeypatch):
    monkeypatch.setenv("LUMIGRAPH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("lumigraph.store.written.MOST", 10)
    for k in range(25):
        file = tmp_path / f"{k}.txt"
        file.write_text("x")
        note_writer(file, ["measure"])
    assert len(list((tmp_path / "cache" / "written").iterdir())) <= 10
    assert writer_of(file) == ["measure"]
