"""Commands assemble long tables in C, with the postures and the errors of the general path."""

from functools import partial
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.programs.closing import tables
from hybridyn.compiled.programs.closing.tables import TableAssembler
from hybridyn.streams.one_pass import read_postures
from tests import ROOT
from tests.support.comparing import close_to, same_words

SAME = 1e-12  # of the largest entry: rounding
TABLE = str(ROOT / "models/five_bar/traj.csv")


def test_long_tables_are_assembled_in_c(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = hybridyn.load("five_bar")
    made: list[TableAssembler] = []
    start = TableAssembler.__init__

    def kept(self: TableAssembler, robot: hybridyn.HybridRobot) -> None:
        """Keep the object."""
        made.append(self)
        start(self, robot)

    monkeypatch.setattr(TableAssembler, "__init__", kept)
    layout, general = read_postures(robot, TABLE)
    assert not layout.full_state
    monkeypatch.setattr(tables, "LONG_TABLE", 10)
    _, compiled = read_postures(robot, TABLE)
    short, long = made
    assert short.rows == long.rows == len(general.q)
    assert short._assembler is None
    assert long._assembler is not None
    assert any(long._assembler._libraries._known.values())
    assert long._assembler.recomputed == 0
    close_to(compiled[1:], general[1:], SAME, 1.0)


def test_errors_are_those_of_the_general_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "LONG_TABLE", 2)
    robot = hybridyn.load("five_bar")
    still: dict[str, object] = dict.fromkeys(robot.motors, np.zeros(4))
    unknown: dict[str, Any] = {"motors": {"nothing": np.zeros(4)}}
    short: dict[str, Any] = {"motors": still, "guess": np.zeros(3)}
    for wanted in (unknown, short):
        same_words(partial(TableAssembler(robot), **wanted), partial(hybridyn.assemble, robot, **wanted))
