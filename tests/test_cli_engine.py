"""The engine of the command line: chosen by a rule that is told, the same numbers by both."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
import hybridyn.cli.blocks as blocks
import hybridyn.cli.engine as engine
from hybridyn.cli import main
from hybridyn.shipped import shipped_robots
from tests.command_line import table_text
from tests.compiled_toys import own_cache

__all__ = ["own_cache"]

#: Both engines are exact to rounding; the table's numbers have 17 digits.
AGREE = 1e-10

#: How far from the singular posture the motion turns back [rad]: pivots are a hundredth of their usual size
#: some samples earlier.
GAP = 1e-3

#: What is added to joints [rad]: more than rounding, less than what counts as open.
SLIGHTLY_OPEN = 1e-8


def run(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Run a command that succeeds; gives what it says."""
    assert main(list(words)) == 0
    return capsys.readouterr().err


def numbers(path: Path) -> Any:
    return np.loadtxt(path, delimiter=",", skiprows=1)


def same(one: Path, other: Path) -> bool:
    """Compare two tables, the first column of which is the time."""
    a, b = numbers(one)[:, 1:], numbers(other)[:, 1:]
    return bool(np.abs(a - b).max() <= AGREE * np.abs(a).max())


def test_both_engines_give_the_same_tables(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    tables = {}
    for name in ("general", "compiled"):
        tables[name] = tmp_path / f"{name}.csv"
        said = run(capsys, "idm", "tanev", "--engine", name, "-o", str(tables[name]))
        assert f"engine: {name} (as asked)" in said
    assert same(tables["general"], tables["compiled"])


def test_several_processes_share_what_was_built(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    run(capsys, "idm", "tanev", "--engine", "compiled", "-o", str(one))
    said = run(capsys, "idm", "tanev", "--engine", "compiled", "-j", "2", "-o", str(two))
    assert "in 2 processes" in said
    assert same(one, two)


def near_singular(table: Path) -> Any:
    """Write a motion of the five-bar that comes four times to where the lower links lie on each other.

    There the left upper link has turned by the angle from home to the middle between the motors, and the
    right one by as much the other way.

    Returns:
        Positions, rates and accelerations of the drives, by name.
    """
    upper, spacing, home = 0.25, 0.12, 0.436332  # [m, m, rad from the vertical], as the file has them
    t = np.linspace(0.0, 4.0, 241)
    turn = np.arcsin(spacing / upper) + home - GAP
    rates = (
        turn * np.sin(np.pi * t) ** 2,
        turn * np.pi * np.sin(2 * np.pi * t),
        turn * 2 * np.pi**2 * np.cos(2 * np.pi * t),
    )
    words = ("position", "velocity", "acceleration")
    motors = {"m1_left_drive": [-x for x in rates], "m1_right_drive": list(rates)}
    header = ["time", *(f"{motor}/{word}" for motor in motors for word in words)]
    table.write_text(table_text(header, np.column_stack([t, *(x for row in motors.values() for x in row)])))
    return motors


@pytest.mark.parametrize("command", ["idm", "ddm"])
def test_samples_by_the_general_path_are_counted_in_every_process(
    own_cache: None, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    table = tmp_path / "motion.csv"
    robot = hybridyn.load("five_bar")
    q, v, a = hybridyn.assemble(robot, motors=near_singular(table))
    compiled = hybridyn.compile(robot)
    tau = compiled.idm(q, v, a)
    if command == "ddm":
        q[::20] += SLIGHTLY_OPEN  # what motors cannot hold is no obstacle for the direct model
        compiled.recomputed = 0
        compiled.ddm(q, v, tau)
        assert compiled.recomputed == len(q[::20])
        words = [f"{joint}/{word}" for word in ("position", "velocity") for joint in robot.joints]
        efforts = [f"{motor}/effort" for motor in robot.motors]
        table.write_text(table_text([*words, *efforts], np.column_stack([q, v, tau])))
    assert 4 <= compiled.recomputed < len(q) / 4
    monkeypatch.setattr(blocks, "MOST_ROWS", 50)
    for jobs in "123":
        output = str(tmp_path / f"{jobs}.csv")
        said = run(capsys, command, "five_bar", str(table), "--engine", "compiled", "-j", jobs, "-o", output)
        assert (f"in {jobs} processes" in said) == (jobs != "1")
        told = f"; {compiled.recomputed} samples by the general path (near "
        assert f"{told}lost rank, or loops open by more than rounding)\n" in said in said


def test_small_tables_are_not_worth_it(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    said = run(capsys, "idm", "tanev", "-o", str(tmp_path / "efforts.csv"))
    assert "engine: general (" in said
    assert "compiled from 3,000,000 on)" in said


def test_large_tables_are(
    own_cache: None, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "WORTH", 20_000)
    said = run(capsys, "idm", "tanev", "-o", str(tmp_path / "efforts.csv"))
    assert "engine: compiled (" in said
    reactions = str(tmp_path / "reactions.csv")
    said = run(capsys, "idm", "tanev", "-o", str(tmp_path / "efforts.csv"), "--reactions", reactions)
    assert "engine: general (compiled models cannot do: --reactions)" in said


def test_what_compiled_models_cannot_do_is_refused(tmp_path: Path, capsys: Any) -> None:
    output = str(tmp_path / "efforts.csv")
    assert main(["idm", "tanev", "--engine", "compiled", "--passive", "solved", "-o", output]) == 1
    assert "cannot do: --passive solved; use --engine general" in capsys.readouterr().err


def test_without_a_compiler_the_general_path_works(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none() -> Any:
        raise engine.HybridynError("no C compiler was found: install gcc")

    monkeypatch.setattr("hybridyn.compiled.model.find_compiler", none)
    output = str(tmp_path / "efforts.csv")
    assert main(["idm", "tanev", "--engine", "compiled", "-o", output]) == 1
    assert "install gcc" in capsys.readouterr().err
    monkeypatch.setattr(engine, "WORTH", 20_000)
    said = run(capsys, "idm", "tanev", "-o", output)
    assert "engine: general (not compiled: no C compiler was found" in said


def test_the_direct_model_too(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    """A motion's own states and efforts give its accelerations back, by both engines."""
    efforts, states = tmp_path / "efforts.csv", tmp_path / "states.csv"
    run(capsys, "idm", "tanev", "-o", str(efforts))
    trajectory = shipped_robots()["tanev"].trajectory
    assert trajectory
    left = Path(trajectory).read_text().splitlines()
    right = [line.split(",", 1)[1] for line in efforts.read_text().splitlines()]
    states.write_text("\n".join(f"{a},{b}" for a, b in zip(left, right, strict=True)) + "\n")
    tables = {name: tmp_path / f"{name}.csv" for name in ("general", "compiled")}
    for name, table in tables.items():
        said = run(capsys, "ddm", "tanev", str(states), "--engine", name, "-o", str(table))
        assert f"engine: {name} (as asked)" in said
    assert same(tables["general"], tables["compiled"])


def test_simulations_too(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    scene = tmp_path / "fall.toml"
    scene.write_text(
        f'duration = 0.2\n[robot]\nfile = "{shipped_robots()["five_bar"].file}"\n'
        "[initial]\njoints = { m1_left_drive = 0.5, m1_right_drive = 0.2 }\n"
        '[solver]\nmethod = "rk4"\nstep = 1e-2\n'
    )
    tables = {name: tmp_path / f"{name}.csv" for name in ("general", "compiled")}
    for name, table in tables.items():
        said = run(capsys, "simulate", str(scene), "--engine", name, "-o", str(table))
        assert f"engine: {name} (as asked)" in said
        head = [line for line in table.read_text().splitlines() if line.startswith("#")]
        assert f"# engine: {name} (as asked)" in head
    a, b = (np.genfromtxt(table, delimiter=",", comments="#", skip_header=5) for table in tables.values())
    assert np.nanmax(np.abs(a - b)) <= AGREE * np.nanmax(np.abs(a))
    said = run(capsys, "simulate", str(scene), "-o", str(tables["general"]))
    assert "engine: general (320 samples times freedoms; compiled from 200,000 on)" in said
