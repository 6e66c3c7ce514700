"""Files that appear complete or not at all."""

import errno
import os
from pathlib import Path

import pytest

from hybridyn.description.writing import appearing, write_text


def test_a_file_is_replaced_behind_its_link_and_only_when_it_is_complete(tmp_path: Path) -> None:
    file, link = tmp_path / "table.csv", tmp_path / "link.csv"
    file.write_text("old")
    link.symlink_to(file)
    with appearing(link) as draft:
        draft.write_text("new")
        assert draft.suffix == ".csv"
        assert file.read_text() == "old"
    assert (file.read_text(), link.is_symlink()) == ("new", True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.csv", "table.csv"]


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("table.csv", ValueError("wrong")),
        ("table.csv", KeyboardInterrupt()),
        ("table.csv", OSError(errno.ENOSPC, "full")),
        ("missing/table.csv", FileNotFoundError()),  # that of the draft, which cannot be written
    ],
)
def test_no_draft_is_left_by_an_error_which_names_the_target(
    tmp_path: Path, name: str, error: BaseException
) -> None:
    file = tmp_path / name

    def fail(draft: Path) -> None:
        draft.write_text("half")
        raise error

    with pytest.raises(type(error)) as caught, appearing(file) as draft:
        fail(draft)
    assert list(tmp_path.iterdir()) == []
    assert getattr(caught.value, "filename", str(file)) == str(file)


def test_a_file_with_the_longest_name_is_written_also_as_a_draft(tmp_path: Path) -> None:
    file = tmp_path / ("\u684c" * 83 + ".csv")
    with appearing(file) as draft, appearing(draft) as inner:
        inner.write_text("new")
    assert file.read_text() == "new"


def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link.csv"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_text(link, "some\n")
        assert os.read(reader, 99) == b"some\n"
    finally:
        os.close(reader)
    assert pipe.is_fifo()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link.csv", "pipe"]
