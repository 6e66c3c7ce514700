"""What is no file, or would fill the memory, is refused in one line before it is read."""

import os
import tomllib
from functools import partial
from pathlib import Path

import pytest

import hybridyn
from hybridyn.description.side_cars.toml_file import LARGEST_TOML, MOST_PARTS, line_of, parse_toml
from hybridyn.scenes.scene_file import read_scene
from hybridyn.simulation.result import Result
from hybridyn.tables.opening import open_table
from tests.comparing import refused


@pytest.mark.parametrize("name", ["t.csv", "t.parquet", "r.urdf", "r.urdf.xacro", "s.toml", "r.state"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / name
    os.mkfifo(file)
    monkeypatch.setattr("builtins.open", lambda *_, **__: pytest.fail("it was opened, and waited for"))
    readers = {
        ".csv": open_table, ".parquet": open_table, ".urdf": hybridyn.load, ".xacro": hybridyn.load,
        ".toml": read_scene, ".state": Result.load,
    }  # fmt: skip
    caught = refused(lambda: readers[file.suffix](str(file)), hybridyn.HybridynError, "is not a regular file")
    assert name in str(caught)


def dotted(parts: int) -> str:
    return ".".join(["a"] * parts)


@pytest.mark.parametrize("text", ["{} = 1", "[{}]", "x = {{ {} = 1 }}", "[[{}]]", "x = [1, {{{} = 2}}]"])
def test_a_key_of_many_parts_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    parse_toml(text.format(dotted(MOST_PARTS)).encode(), "f.toml")
    monkeypatch.setattr(tomllib, "loads", lambda text: pytest.fail("it was read, which takes 8 GB"))
    for key in (dotted(40_000), dotted(MOST_PARTS + 1), " . ".join(['"a"', "'b'"] * 9)):
        refused(
            partial(parse_toml, f"\n{text.format(key)}".encode(), "f.toml"),
            hybridyn.ModelError,
            r"f\.toml:2: .*a key has more than 16 parts",
        )


@pytest.mark.parametrize(
    "text",
    [
        f'x = "{dotted(40)}"',
        f"x = '{dotted(40)}'  # {dotted(40)}",
        f'x = """\n{dotted(40)} " {dotted(40)}"""',
        f"x = '''\n{dotted(40)} ' {dotted(40)}'''",
        f'x = "a\\"b" # {dotted(40)}\ny = [1.5, 2.5]\n',
        "x = [" + "1.5, " * 100 + "]",
    ],
)
def test_dots_in_texts_and_comments_are_no_parts(text: str) -> None:
    assert parse_toml(text.encode(), "f.toml")[1] == tomllib.loads(text)


def test_texts_that_do_not_end_or_are_large_are_refused_at_once() -> None:
    large = partial(parse_toml, b"#" * (LARGEST_TOML + 1), "f.toml")
    refused(large, hybridyn.ModelError, "is larger than 1 MiB")
    for text in ('"""' + '\\"""' * 50_000, "'''" + "''" * 50_000 + "'", '"' * 100_001, "a" * LARGEST_TOML):
        refused(partial(parse_toml, text.encode(), "f.toml"), hybridyn.ModelError, "not readable as TOML")


def test_a_line_without_an_assignment_is_soon_passed() -> None:
    """A long word is no key where no '=' follows; the search must not try each way to cut it."""
    text = 'x = """\n' + "a" * 5000 + '!\n"""\na."b c".d = 1\n'
    assert line_of(text, ("a", "b c", "d")) == 4
