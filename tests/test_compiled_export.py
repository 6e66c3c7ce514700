"""Models as C for other programs: the files compile without a warning and give the general path's numbers."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.cli import main
from hybridyn.compiled.compilers import find_compiler
from hybridyn.compiled.export import c_name, export
from hybridyn.compiled.exporting import plain_source
from hybridyn.compiled.operations import operations, operations_table
from hybridyn.errors import ModelError
from hybridyn.shipped import shipped_robots
from tests.compiled_toys import own_cache, toy

__all__ = ["own_cache"]

STRICT = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wconversion", "-O1"]


def shipped(name: str, **options: Any) -> hybridyn.HybridRobot:
    return hybridyn.load(str(shipped_robots()[name].file), **options)


def run_test(folder: Path, name: str) -> str:
    """Compile and run an exported test; gives what it prints."""
    files = [str(folder / f"test_{name}.c"), str(folder / f"{name}.c")]
    program = str(folder / "test")
    built = subprocess.run(
        [*find_compiler().command, *STRICT, "-o", program, *files, "-lm"], capture_output=True, text=True
    )
    assert (built.returncode, built.stdout + built.stderr) == (0, "")
    done = subprocess.run([program], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.parametrize(
    ("robot", "options"),
    [
        ("five_bar", {}),
        ("gough_stewart", {}),
        ("five_bar", {"base": "moving"}),
        ("five_bar", {"base": "floating"}),
    ],
    ids=str,
)
def test_exported_models_compile_and_give_the_reference(
    tmp_path: Path, robot: str, options: dict[str, Any]
) -> None:
    paths = export(shipped(robot, **options), tmp_path / "made", name="machine")
    assert {path.name for path in paths} == {
        "machine.c",
        "machine.h",
        "test_machine.c",
        "Makefile",
        "README.md",
    }
    printed = run_test(tmp_path / "made", "machine")
    for model in ("idm", "ddm"):
        guards = [float(x) for x in re.findall(rf"{model} \d: guard (\S+),", printed)]
        assert len(guards) == 5
        assert max(guards) <= 1.0
    source = (tmp_path / "made" / "machine.c").read_text()
    assert set(re.findall(r"#include (\S+)", source)) == {"<math.h>", '"machine.h"'}
    assert not re.search(r"\b(malloc|memcpy|printf)\b", source)


def test_the_exported_test_can_fail(tmp_path: Path) -> None:
    export(shipped("five_bar"), tmp_path, name="bar")
    file = tmp_path / "test_bar.c"
    text = file.read_text()
    start = text.index("ddm_a[5]")
    number = re.compile(r"-?\d+\.\d+").search(text, start)
    assert number
    file.write_text(text[: number.start()] + "1234.5" + text[number.end() :])
    with pytest.raises(AssertionError, match="largest difference"):
        run_test(tmp_path, "bar")


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")
def test_make_runs_the_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    export(shipped("five_bar"), tmp_path)
    done = subprocess.run(["make", "-C", str(tmp_path)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "largest difference from the reference" in done.stdout


def test_every_kind_of_program_compiles(tmp_path: Path) -> None:
    for seed, copies in ((1, 3), (2, 6)):
        source = plain_source([toy(seed, copies)], "toy").replace('#include "toy.h"', "")
        work = f"typedef struct {{ double numbers[1000]; }} toy_toy{seed}_{copies}_work;\n"
        prototype = re.search(r"^double toy_\w+\([^{]*", source, re.MULTILINE)
        assert prototype
        head, rest = source.split("\n", 1)
        file = tmp_path / f"toy{seed}.c"
        file.write_text(head + "\n" + work + prototype.group().strip() + ";\n" + rest)
        built = subprocess.run(
            [*find_compiler().command, *STRICT, "-c", str(file), "-o", str(tmp_path / "toy.o")],
            capture_output=True, text=True,
        )  # fmt: skip
        assert (built.returncode, built.stderr) == (0, "")


def test_names_are_names_in_c(tmp_path: Path) -> None:
    assert c_name("LX-4 (new)") == "lx_4__new_"
    assert c_name("4bar") == "robot_4bar"
    with pytest.raises(ModelError, match="'a b' is no name in C"):
        export(shipped("five_bar"), tmp_path, name="a b")


def test_operations_are_counted_by_part_and_copies() -> None:
    program = toy(4, 6)
    counts, three = operations(program), operations(toy(4, 3))
    assert set(counts) == {"legs", "module"}
    assert counts["legs"]["trig"] == 2 * three["legs"]["trig"]
    assert counts["module"]["mul"] == three["module"]["mul"]
    total = np.array([sum(part.values()) for part in counts.values()]).sum()
    assert str(total) in operations_table({"one": program})


def test_the_command_line_exports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(shipped_robots()["five_bar"].file)
    assert main(["export", file, "-o", str(tmp_path / "made"), "--stats"]) == 0
    out, err = capsys.readouterr()
    assert "base inertial parameters" in out
    assert "inertial parameters as described" in out
    assert "README.md" in err
    assert main(["export", file]) == 2
    assert "-o DIR" in capsys.readouterr().err
