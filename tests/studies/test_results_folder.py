"""Folders of results: a part is there if it is recorded with its bytes, whatever ended the run before."""

import os
import shutil
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import pytest

import hybridyn
from hybridyn.description.writing import appearing
from hybridyn.studies.results_folder import RECORD, part, read_record, writing
from tests.support.comparing import refused


def begin(folder: Path, *, resume: bool = False, **asked: str) -> None:
    """Begin or continue a folder of results."""
    with writing(folder, asked, {"told": [1]}, ["part*"], resume=resume):
        pass


def add(folder: Path, name: str, of: str = "") -> None:
    """Write a part."""
    with part(folder, name, of) as draft:
        draft.write_bytes(os.fsencode(f"content of {name}"))


def test_a_part_is_there_with_its_bytes_and_its_source_alone(tmp_path: Path) -> None:
    folder, names = tmp_path / "out", ["plain.csv", "two\nlines of 'words'", os.fsdecode(b"no utf8 \xff")]
    begin(folder, robot="1")
    for name in names:
        add(folder, name, "source")
        assert read_record(folder).has(name, "source")
        assert not read_record(folder).has(name, "other source")
    moved = shutil.move(folder, tmp_path / "moved")
    record = read_record(moved)
    assert all(record.has(name, "source") for name in names)
    assert (record.asked, record.told) == ({"robot": "1"}, {"told": [1]})
    (moved / names[0]).write_text("another's")
    (moved / names[1]).unlink()
    assert [record.has(name, "source") for name in names] == [False, False, True]


def test_no_part_appears_without_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a line was cut, or a part did not appear, the next part is recorded nonetheless."""
    begin(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            add(tmp_path, "first")
    with open(tmp_path / RECORD, "a") as record:
        record.write("\n0123456789abcdef o")
    assert not read_record(tmp_path).begun
    add(tmp_path, "second")
    assert [read_record(tmp_path).has(name) for name in ("first", "second")] == [False, True]
    assert {file.name for file in tmp_path.iterdir()} == {RECORD, "second", "writing.lock"}


def test_what_differs_is_named_and_nothing_is_lost(tmp_path: Path) -> None:
    begin(tmp_path, robot="1", effects="model")
    begin(tmp_path, robot="2", effects="model")  # there is no part yet
    add(tmp_path, "part")
    again = f"{tmp_path}: has results of an earlier run: continue it with resume=True"
    refused(lambda: begin(tmp_path, robot="2", effects="model"), hybridyn.HybridynError, again)
    for asked, other in (
        ({"robot": "1", "effects": "model"}, "'robot'"),
        ({"robot": "2", "loads": "yes"}, "'effects', 'loads'"),
    ):
        said = f"{tmp_path}: its results were computed with another {other}: undo the change"
        for resume in (False, True):  # no advice to continue what cannot be continued
            again = partial(begin, tmp_path, resume=resume, **asked)
            refused(again, hybridyn.HybridynError, said)
    begin(tmp_path, resume=True, robot="2", effects="model")
    assert read_record(tmp_path).has("part")


def test_a_process_that_outlives_its_run_adds_nothing_to_another(tmp_path: Path) -> None:
    """The parent is killed, another run begins with something else, and the worker goes on."""
    begin(tmp_path, robot="1")

    def lose() -> None:
        with part(tmp_path, "part", asked={"robot": "1"}) as draft:
            draft.write_text("of robot 1")
            (tmp_path / RECORD).unlink()

    refused(lose, hybridyn.HybridynError, "or the record is gone")
    begin(tmp_path, robot="1")

    def outlive(again: str) -> None:
        with part(tmp_path, "part", asked={"robot": "1"}) as draft:
            begin(tmp_path, robot=again)
            draft.write_text("of robot 1")

    refused(lambda: outlive("2"), hybridyn.HybridynError, f"{tmp_path}: another run has begun here")
    assert {path.name for path in tmp_path.iterdir()} == {RECORD, "writing.lock"}
    assert not read_record(tmp_path).parts
    begin(tmp_path, robot="1")
    outlive("1")
    assert read_record(tmp_path).has("part")


def test_only_the_drafts_of_parts_of_a_killed_run_are_removed(tmp_path: Path) -> None:
    """A file may have a date in its name, and another command may write its own table into the folder."""
    begin(tmp_path, robot="1")
    with part(tmp_path, "part.csv") as draft, appearing(draft) as inner:
        left = draft.name, inner.name
        inner.write_text("")
    (tmp_path / "part.csv").unlink()
    with appearing(tmp_path / "single.csv") as single:
        kept = {".backup.20261127.tar", ".x.deadbeef.txt", ".a.0123456789abcdef.csv", single.name}
        for name in (*left, *kept):
            (tmp_path / name).write_text("")
        begin(tmp_path, robot="2")
        assert {path.name for path in tmp_path.iterdir()} == {RECORD, "writing.lock", *kept}
        with writing(tmp_path, {"robot": "2"}, {}, [], resume=False):  # one of its processes is killed
            (tmp_path / left[1]).write_text("")
        assert {path.name for path in tmp_path.iterdir()} == {RECORD, "writing.lock", *kept}
    add(tmp_path, "part")
    (tmp_path / left[0]).write_text("")
    refused(lambda: begin(tmp_path, robot="2"), hybridyn.HybridynError, "of an earlier run")
    assert (tmp_path / left[0]).exists()


@pytest.mark.parametrize("record", ["", '{"broken', '{"asked": {}, "told": {}}'])
def test_files_without_a_record_are_never_mixed_with_parts(tmp_path: Path, record: str) -> None:
    (tmp_path / RECORD).write_text(record)
    (tmp_path / "notes.txt").write_text("of the user")
    begin(tmp_path)
    (tmp_path / RECORD).write_text(record)
    (tmp_path / "part-1").write_text("of another hand, or of an older version")
    for resume in (False, True):
        said = f"{tmp_path}: has 'part-1', of which it has no record: choose another folder, or remove them"
        refused(lambda resume=resume: begin(tmp_path, resume=resume), hybridyn.HybridynError, said)
    assert not read_record(tmp_path).has("part-1")
    assert (tmp_path / "part-1").read_text().startswith("of another hand")


def test_results_of_another_command_are_no_change_to_undo(tmp_path: Path) -> None:
    begin(tmp_path, command="idm", robot="1")
    add(tmp_path, "part")
    said = f"{tmp_path}: has results of another command: choose another folder"
    refused(
        lambda: begin(tmp_path, resume=True, command="sweep", study="2"), hybridyn.HybridynError, f"{said}$"
    )
