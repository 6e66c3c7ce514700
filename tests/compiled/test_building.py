"""Compilers, builds and the cache of built models."""

import ctypes
import importlib.util
import json
import pickle
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybridyn
import hybridyn.compiled.library.cache as cache_file
from hybridyn.compiled.code.library_source import Source, library_source
from hybridyn.compiled.code.scalars import Scalar
from hybridyn.compiled.library.building import FLAGS, build, find_compiler
from hybridyn.compiled.library.cache import Built
from hybridyn.compiled.library.calls import Library
from hybridyn.description.cache_folder import folder
from tests.compiled.toys import cached, double, inputs, never, numbered, toy
from tests.support import once
from tests.support.comparing import refused
from tests.support.files import save

TOY = double()
#: What the functions of a small library return.
NUMBER = 7


pytestmark = pytest.mark.usefixtures("empty_cache")


@pytest.fixture
def fresh_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hybridyn.compiled.library.cache.find_compiler", find_compiler.__wrapped__)


source = partial(numbered, NUMBER)
programs = partial(library_source, [TOY], Scalar("float64", 1))


def works(built: Built) -> bool:
    return ctypes.CDLL(str(built.path)).number() == NUMBER


def test_a_model_is_built_once(empty_cache: Path) -> None:
    first = cached("a robot", source)
    assert works(first)
    again = cached("a robot", never)
    assert again == first
    other_key = cached("the same robot by another name", source)
    assert other_key.path == first.path
    assert len(list((empty_cache / "libraries").iterdir())) == 1


@pytest.mark.usefixtures("uncompiled")
def test_another_machine_or_package_builds_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    cached("a robot", source)
    for what in ("machine", "package_state"):
        with monkeypatch.context() as patch:
            patch.setattr(cache_file, what, lambda: "another one")
            refused(lambda: cached("a robot", never), hybridyn.CompileError, "it is there")


#: What may happen to the library and to the two keys that lead to it.
DAMAGE: dict[str, Callable[[Path, Path], object]] = {
    "truncated": lambda library, key: library.write_bytes(library.read_bytes()[:999]),
    "foreign": lambda library, key: library.write_bytes(b"\x7fELF" + library.read_bytes()[:100:-1]),
    "gone": lambda library, key: library.unlink(),
    "no JSON": lambda library, key: key.write_text('{"library": 3'),
    "no text": lambda library, key: key.write_bytes(b"\xff" * 40),
    "no key": lambda library, key: key.unlink(),
    "elsewhere": lambda library, key: key.write_text('{"library": "../../etc/passwd", "about": {}}'),
    "other library": lambda library, key: key.write_text(json.dumps({"library": "another", "about": {}})),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_what_is_damaged_is_built_again(empty_cache: Path, damage: str) -> None:
    first = cached("a robot", source)
    for key in list((empty_cache / "keys").iterdir()):
        DAMAGE[damage](first.path, key) if first.path.exists() else None
    assert works(cached("a robot", source))
    assert works(cached("a robot", never))


@pytest.mark.usefixtures("uncompiled")
def test_a_cache_that_cannot_be_used_is_named(empty_cache: Path) -> None:
    cached("a robot", source)
    for key in list((empty_cache / "keys").iterdir()):
        key.unlink()
        key.mkdir()
    refused(lambda: cached("a robot", source), hybridyn.CompileError, "cache folder .* cannot be used")


@pytest.mark.slow
def test_a_new_model_may_differ_as_roundings_of_the_robot_do(tmp_path: Path) -> None:
    """A slider of 1e-7 kg carries one of 1 kg: efforts are differences of numbers 1e7 times as large.

    Roundings that happen to be alike for both sliders leave these differences as they are.
    """
    slider = """<joint name="j{i}" type="prismatic"><parent link="l{i}"/><child link="l{n}"/>
        <axis xyz="0.3 0.5 0.81"/><limit lower="-2" upper="2" effort="100" velocity="5"/></joint>
        <link name="l{n}"><inertial><mass value="{m}"/>
        <inertia ixx="{m}" iyy="{m}" izz="{m}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
    sliders = [slider.format(i=i, n=i + 1, m=m) for i, m in enumerate((1e-7, 1.0))]
    path = save(tmp_path, f'<robot name="light"><link name="l0"/>{"".join(sliders)}</robot>', "light.urdf")
    robot = hybridyn.load(path)
    q, v, a = np.zeros(2), np.zeros(2), np.array([1e7, -1e7])
    wanted = [1.0 * a.sum() + 1e-7 * a[0], 1.0 * a.sum()]  # without gravity
    tau = hybridyn.compile(robot).idm(q, v, a) - hybridyn.idm(robot, q, v, np.zeros(2))
    assert np.abs(tau - wanted).max() <= 1e-8  # 2^-52 times 1e7


@pytest.mark.usefixtures("uncompiled")
def test_a_model_that_is_not_accepted_stays_unknown() -> None:
    def refuse(built: Built) -> None:
        raise hybridyn.CompileError("it is wrong")

    refused(lambda: cached("a robot", source, check=refuse), hybridyn.CompileError, "it is wrong")
    asked = []
    cached("a robot", source, check=asked.append)
    assert len(asked) == 1
    cached("a robot", never, check=refuse)


def test_a_folder_that_cannot_be_written_does_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "file" / "cache"))
    assert works(cached("a robot", source))


def test_a_robot_from_another_process_finds_its_library_anew_where_its_file_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(once.folder() / "compiled"))  # that of other tests
    here = hybridyn.compile(hybridyn.load("five_bar"), dtype="float32", threads=2)
    library = here.library
    with monkeypatch.context() as patch:
        patch.setattr(library, "built", replace(library.built, path=tmp_path / "gone.so"))
        sent = pickle.dumps(here)
    compiled = pickle.loads(sent)
    assert (compiled.dtype, compiled.threads) == (np.float32, 2)
    assert compiled.library.built == library.built


def test_limits_are_no_part_of_casadi_functions(interpreted: None) -> None:
    robot = hybridyn.load("five_bar")
    compiled = hybridyn.compile(robot, ["default", "limits"], wait=False)
    with pytest.raises(hybridyn.ModelError, match="'limits' is not part of CasADi functions"):
        _ = compiled.casadi


def test_the_users_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HYBRIDYN_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    if sys.platform != "darwin":
        assert folder() == Path("/somewhere/hybridyn/compiled")


def test_without_a_compiler_the_message_says_what_to_install(
    fresh_compiler: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    refused(
        lambda: cached("a robot", source), hybridyn.CompileError, r"install gcc or clang.*pip install ziglang"
    )


@pytest.mark.parametrize(
    ("named", "words"),
    [
        ("no-such-compiler -v", "'no-such-compiler', does not exist"),
        ('gcc "-O2', r"CC names cannot be read: 'gcc \"-O2': No closing quotation"),
    ],
)
def test_a_compiler_that_is_named_must_be_there(
    fresh_compiler: None, monkeypatch: pytest.MonkeyPatch, named: str, words: str
) -> None:
    monkeypatch.setenv("CC", named)
    refused(lambda: cached("a robot", source), hybridyn.CompileError, words)


def test_a_full_folder_of_the_system_does_not_matter(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, empty_cache: Path
) -> None:
    """What is written lies in the cache folder, which is the one that messages name."""
    made = []
    folder_of = tempfile.TemporaryDirectory
    monkeypatch.setattr(tempfile, "TemporaryDirectory", lambda **k: made.append(k["dir"]) or folder_of(**k))
    cached("a robot", source)
    assert made
    assert all(Path(folder).is_relative_to(empty_cache) for folder in made)


@pytest.mark.usefixtures("uncompiled")
def test_the_cache_may_be_emptied_while_a_model_is_written(empty_cache: Path) -> None:
    def meanwhile() -> Source:
        shutil.rmtree(empty_cache)
        return source()

    assert cached("a robot", meanwhile).path.exists()
    assert cached("a robot", meanwhile).path.exists()  # found, not written again


def test_a_compiler_that_fails_is_quoted(tmp_path: Path) -> None:
    for text, command, words in (
        ("int main( {", find_compiler(), "error"),
        ("int x;", (str(tmp_path / "none"),), "cannot be started"),
        ("int x;", (sys.executable, "-c", ""), "there is no library"),
    ):
        asked = partial(build, {"unit": text}, command, tmp_path / "library.so")
        refused(asked, hybridyn.CompileError, words)


def test_the_ziglang_wheel_is_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "ziglang").mkdir()
    (tmp_path / "ziglang" / "__init__.py").write_text("")
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert find_compiler.__wrapped__() == (sys.executable, "-m", "ziglang", "cc")


def test_cc_may_carry_options(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    tool = tmp_path / "mycc"
    tool.write_text("#!/bin/sh\n")
    tool.chmod(tool.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("CC", f"{tool} -pipe")
    assert find_compiler.__wrapped__() == (str(tool), "-pipe")


def test_the_c_of_a_library_stays_where_it_is_wanted(
    tmp_path: Path, empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A debugger finds it: the library names its files. Each compiles by itself."""
    before = cached("a robot", programs)
    monkeypatch.setenv("HYBRIDYN_KEEP_C", str(tmp_path / "kept"))
    robot: Any = SimpleNamespace(name="my robot/2")
    built = cached("a robot", programs, robot=robot)
    assert built.path != before.path
    assert Library(built).programs
    (own,) = (tmp_path / "kept").iterdir()
    assert own.name.startswith(f"my_robot_2-{TOY.name}-")
    assert {path.stem for path in own.iterdir()} == set(programs().units)
    for path in own.iterdir():
        command = [*find_compiler(), *FLAGS, "-fsyntax-only", path]
        subprocess.run(list(map(str, command)), check=True)
        assert str(path).encode() in built.path.read_bytes()


def test_a_folder_for_kept_c_that_cannot_be_written_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("HYBRIDYN_KEEP_C", str(tmp_path / "file"))
    words = f"the folder '{tmp_path / 'file'}' that HYBRIDYN_KEEP_C names cannot be written"
    refused(lambda: cached("a robot", programs), hybridyn.CompileError, words)


@pytest.mark.skipif(shutil.which("clang") is None, reason="there is no clang")
def test_clang_gives_the_same_bits(tmp_path: Path) -> None:
    program = toy(5, 6)
    printed = library_source([program], Scalar("float64", 8))
    results = []
    for name in ("clang", "gcc"):
        path = tmp_path / f"{name}.so"
        build(printed.units, [shutil.which(name) or name], path)
        results.append(Library(Built(path, printed.about)).batch(program.name, *inputs(program, 20)))
    assert (results[0][0][0] == results[1][0][0]).all()
