"""One child of xacro that is kept for many expansions: the same texts, and each starts afresh."""

from __future__ import annotations

import io
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hybridyn.description.urdf import xacro, xacro_process
from hybridyn.errors import ModelError

TEXT = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="a" default="1"/>
  <xacro:if value="${$(arg a) > 5}"><xacro:nothing/></xacro:if>
  <xacro:property name="p" default="${2 * $(arg a)}"/>
  <link name="l${p}"/>
</robot>
"""
#: A regular expression that cannot end.
ENDLESS = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="a" default="1"/>
  <link name="${xacro.tokenize('a' * 60 + '!', 'x]|(a+)+$|[y')}"/></robot>"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A file with an argument; one child is kept during the test, and no text."""
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "r.xacro"
    path.write_text(TEXT)
    xacro_process.keep_child()
    yield str(path)
    xacro_process.drop_child()


def test_expansions_of_a_kept_child_are_those_of_fresh_ones(file: str) -> None:
    kept = [xacro.expand(file, {"a": a}, ()) for a in (1, 2)]
    child = xacro_process._kept.child
    with pytest.raises(ModelError, match="unknown macro name"):
        xacro.expand(file, {"a": 6}, ())
    with pytest.raises(ModelError, match="there is no argument 'b'"):
        xacro.expand(file, {"b": 6}, ())
    kept.append(xacro.expand(file, {"a": 3}, ()))
    assert child is not None
    assert child is xacro_process._kept.child
    assert not list(Path(file).parent.glob("cache/texts/*"))
    xacro_process.drop_child()
    assert child.returncode is not None
    assert kept == [xacro.expand(file, {"a": a}, ()) for a in (1, 2, 3)]


def test_one_child_expands_many_sets_of_arguments(file: str) -> None:
    """Each set starts afresh, also after one that is refused."""
    many = [{"a": 1}, {"a": 6}, {"b": 6}, {}, {"a": 3}]
    for _ in range(2):
        found = [*xacro.expand_each(file, many, ())]
        for arguments, one in zip(many, found, strict=True):
            if isinstance(one, ModelError):
                with pytest.raises(ModelError) as caught:
                    xacro.expand(file, arguments, ())
                assert str(caught.value) == str(one)
            else:
                assert one == xacro.expand(file, arguments, ())
        assert [isinstance(one, ModelError) for one in found] == [False, True, True, False, False]
        xacro_process.drop_child()


def test_limits_are_those_of_one_set_of_arguments(file: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A set that fails beside others, and texts that are too large together, are expanded alone."""
    wanted = [xacro.expand(file, {"a": a}, ()) for a in (1, 2, 3)]
    many = [{"a": a} for a in (1, 2, 3)]
    together, whole = xacro._converse, len(wanted[0][0])

    def failing(child: Any, file: str, request: Any, *rest: Any) -> Any:
        """Let the last set of many fail, as for the memory or the steps of those before."""
        answers = together(child, file, request, *rest)
        spoilt = {"error": "needs too much memory", "file": None, "line": None}
        return answers if len(answers) == 1 else [*answers[:-1], (spoilt, b"")]

    with monkeypatch.context() as patched:
        patched.setattr(xacro, "_converse", failing)
        assert [*xacro.expand_each(file, many, ())] == wanted
    monkeypatch.setattr(xacro, "LARGEST_FILE", 2 * whole)
    request, folders = xacro._request(file, many, (), True)
    with pytest.raises(ModelError, match="more than 0 MiB"), xacro_process.child_of(file, kept=True) as child:
        together(child, file, request, folders(), [])
    assert [*xacro.expand_each(file, many, ())] == wanted


@pytest.mark.slow
def test_sets_of_arguments_that_take_too_long_together_are_expanded_alone(
    file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(xacro, "SECONDS", 1)
    Path(file).write_text(ENDLESS.replace("'a' * 60", "'a' * (60 if $(arg a) > 5 else 2)"))
    slow, *others = xacro.expand_each(file, [{"a": 6}, {"a": 1}, {"a": 2}], ())
    assert "more than 1 s of processor time" in str(slow)
    assert not any(isinstance(one, ModelError) for one in others)


def test_a_child_that_was_killed_is_replaced(file: str) -> None:
    good = xacro.expand(file, {}, ())
    child = xacro_process._kept.child
    assert child is not None
    os.kill(child.pid, signal.SIGKILL)
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    assert xacro.expand(file, {}, ()) == good
    assert child.returncode == -signal.SIGKILL


@pytest.mark.slow
def test_an_expansion_that_does_not_end_ends_alone(file: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xacro, "SECONDS", 1)
    good = xacro.expand(file, {}, ())
    Path(file).write_text(ENDLESS)
    with pytest.raises(ModelError, match="more than 1 s of processor time"):
        xacro.expand(file, {}, ())
    Path(file).write_text(TEXT)
    assert xacro.expand(file, {}, ()) == good


def test_pipes_of_a_child_have_no_buffer(file: str) -> None:
    """A fork would copy a buffer's lock and content while another thread is using it."""
    xacro.expand(file, {}, ())
    child = xacro_process._kept.child
    assert child is not None
    assert isinstance(child.stdin, io.RawIOBase)
    assert isinstance(child.stdout, io.RawIOBase)


def test_lines_and_blocks_are_read_from_what_comes_in_parts() -> None:
    parts = [b"one", b"\ntwo\nabc", b"de", b"f\nlong", b"er", b""]
    pipe: Any = SimpleNamespace(read=lambda _: parts.pop(0) if parts else b"")
    reader = xacro._Reader(pipe)
    assert [reader.line(100), reader.line(100), reader.block(6), reader.line(100)] == [
        b"one\n", b"two\n", b"abcdef", b"\n",
    ]  # fmt: skip
    assert [reader.line(5), reader.block(9), reader.line(9)] == [b"longe", b"r", b""]


def test_what_does_not_fit_into_a_pipe_is_sent_in_parts() -> None:
    sent: list[bytes] = []

    def write(some: Any) -> int:
        """Take three bytes."""
        sent.append(bytes(some[:3]))
        return len(sent[-1])

    pipe: Any = SimpleNamespace(write=write)
    xacro._send(pipe, {"size": 4}, b"abcd")
    assert b"".join(sent) == b'{"size": 4}\nabcd'
