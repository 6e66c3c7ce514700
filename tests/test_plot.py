"""Figures of tables, and the command that draws them."""

from pathlib import Path

import numpy as np
import pytest

from hybridyn.cli import main
from hybridyn.errors import TrajectoryError
from hybridyn.plot import figure_of_table

COLUMNS = ["time", "a/position", "b/position", "a/effort", "energy/kinetic", "energy/total", "residual"]
ROWS = np.column_stack([np.linspace(0, 1, 5)] + [np.full(5, float(i)) for i in range(1, 6)] + [np.zeros(5)])


def test_motors_energies_and_residual_have_a_panel_each() -> None:
    figure = figure_of_table(COLUMNS, ROWS, title="run")
    position, effort, energy, residual = figure.axes
    assert [line.get_label() for line in position.lines] == ["a"]  # b has no effort: it is passive
    assert effort.lines[0].get_ydata() == pytest.approx(np.full(5, 3.0))
    assert [line.get_label() for line in energy.lines] == ["kinetic", "total"]
    assert residual.get_yscale() == "log"
    assert residual.get_xlabel() == "time [s]"


def test_a_trajectory_without_efforts_draws_every_joint() -> None:
    figure = figure_of_table(COLUMNS[:3], ROWS[:, :3])
    assert [line.get_label() for line in figure.axes[0].lines] == ["a", "b"]


def test_nothing_to_draw_is_said() -> None:
    with pytest.raises(TrajectoryError, match="no column of a joint"):
        figure_of_table(["time"], ROWS[:, :1])


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_the_command_draws_a_file(tmp_path: Path, ending: str, head: bytes) -> None:
    table = tmp_path / "run.csv"
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in ROWS.tolist())]
    table.write_text("# a remark\n" + "\n".join(lines) + "\n")
    target = tmp_path / f"run.{ending}"
    assert main(["plot", str(table), "-o", str(target)]) == 0
    assert target.read_bytes().startswith(head)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.csv", f"run.{ending}"]


def test_another_ending_is_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.csv").write_text("time,a/position\n0,1\n")
    assert main(["plot", str(tmp_path / "run.csv"), "-o", str(tmp_path / "run.gif")]) == 2
    assert ".png, .svg, .pdf" in capsys.readouterr().err
