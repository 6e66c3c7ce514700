"""Motions that excite parameters: within limits, from rest to rest, and better than the first that comes."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import ModelError
from hybridyn.streams.departures import departures
from hybridyn.tables.opening import open_table
from tests.robots.shipped import ROBOTS
from tests.support.command_line import call
from tests.support.samples import some


@pytest.mark.parametrize("name", some(ROBOTS, ["five_bar"]))
def test_a_motion_stays_within_the_limits_and_starts_at_rest(name: str) -> None:
    robot = hybridyn.load(name)
    found = hybridyn.excitation(robot, symmetric=True, period=4.0, evaluations=2)
    x, x_dot, x_ddot = found.at(np.linspace(0.0, 4.0, 701))
    scale = np.abs(x_ddot).max()
    for ends in (x[[0, -1]] - found.home, x_dot[[0, -1]], x_ddot[[0, -1]]):
        assert np.abs(ends).max() <= 1e-9 * scale
    q, v, a = hybridyn.assemble(robot, motors=(x, x_dot, x_ddot))
    tau = hybridyn.idm(robot, q, v, a, effects="model")
    assert departures(robot, q, v, tau) == ()
    assert found.gain <= 3.0
    rates = np.gradient(x, 4.0 / 700, axis=0)
    np.testing.assert_allclose(rates[1:-1], x_dot[1:-1], atol=2e-3 * np.abs(x_dot).max())


def test_the_search_finds_a_motion_that_tells_more() -> None:
    """The same seed: more candidates never tell less."""
    robot = hybridyn.load("five_bar")
    one, many = (hybridyn.excitation(robot, period=4.0, evaluations=n) for n in (1, 3))
    assert many.information > one.information + 2.0
    again = hybridyn.excitation(robot, period=4.0, evaluations=1)
    assert np.array_equal(again.sine, one.sine)


@pytest.mark.parametrize("words", [{"harmonics": 2}, {"period": 0.0}, {"evaluations": 0}])
def test_impossible_wishes_are_refused(words: dict[str, float]) -> None:
    with pytest.raises(ModelError, match="at least three harmonics"):
        hybridyn.excitation(hybridyn.load("five_bar"), **words)


def test_a_robot_that_cannot_move_says_so() -> None:
    """At home its weight is beyond the drives."""
    heavy = hybridyn.load("five_bar").with_parameters({"mass:m1_left_lower": 500.0})
    with pytest.raises(ModelError, match="no motion around home is within the limits: effort of"):
        hybridyn.excitation(heavy, period=4.0, evaluations=1)


def test_the_command_excites_identifies_and_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Excite, record (here: compute), identify, report, draw, write the robot, and load it again."""
    monkeypatch.chdir(tmp_path)
    call(capsys, "identify", "five_bar", "--excite", "motion.csv", "--period", "4", "--evaluations", "1")
    call(capsys, "idm", "five_bar", "motion.csv", "--effects", "model", "-o", "efforts.csv")
    table: dict[str, np.ndarray] = {}
    for file, kind in (("motion.csv", ("time", "position")), ("efforts.csv", ("effort",))):
        with open_table(file) as opened:
            values = np.concatenate([block.values for block in opened.blocks]).T
            table |= {n: x for n, x in zip(opened.columns, values, strict=True) if n.endswith(kind)}
    rows = np.column_stack(list(table.values()))[:-1]
    np.savetxt("measured.csv", rows, "%.17g", ",", header=",".join(table), comments="")
    out = call(
        capsys, "identify", "five_bar", "measured.csv", "--period", "4", "--band", "2",
        "--validate", "measured.csv",
        "--report", "report.md", "--plot", "residuals.png", "-o", "identified.urdf",
    ).out  # fmt: skip
    assert "15 base parameters from" in out
    assert "second motion: 0.00% to 0.00% of the efforts" in out
    text = Path("report.md").read_text()
    assert text.startswith("# Identification of five_bar\n")
    assert text.count("\n| `") == 2 + 15
    assert Path("residuals.png").stat().st_size > 10_000
    robot, own = hybridyn.load("identified.urdf"), hybridyn.load("five_bar")
    q, v, a = hybridyn.assemble(own, motors=(np.array([0.1, 0.2]), np.ones(2), np.ones(2)))
    tau = [hybridyn.idm(one, q, v, a, effects="model") for one in (robot, own)]
    np.testing.assert_allclose(tau[0], tau[1], rtol=1e-6)
    call(capsys, "identify", "five_bar", status=2, says="give a log, or --excite")
