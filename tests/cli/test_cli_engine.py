"""The engine of the command line: chosen by a rule that is told, the same numbers by both."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import hybridyn
import hybridyn.cli.common.engine as engine
import hybridyn.compiled.programs.closing.assembling as assembling
import hybridyn.streams.blocks as blocks
from hybridyn.cli import main
from hybridyn.description.shipped import shipped_robots
from hybridyn.tables.columns import Layout
from tests.command_line import read_table, table_text
from tests.robot_texts import door, save

#: Both engines are exact to rounding; the table's numbers have 17 digits.
AGREE = 1e-10
#: Simulations take other coordinates: they agree to the error of steps of 5 ms.
METHOD = 1e-4

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


def plain(path: Path) -> str:
    """Return a table without the remarks before its header."""
    return "\n".join(line for line in path.read_text().splitlines() if not line.startswith("#"))


def same(one: Path, other: Path) -> bool:
    """Compare two tables, the first column of which is the time."""
    a, b = numbers(one)[:, 1:], numbers(other)[:, 1:]
    return bool(np.abs(a - b).max() <= AGREE * np.abs(a).max())


def test_both_engines_give_the_same_tables(tmp_path: Path, capsys: Any) -> None:
    tables = {}
    for name in ("general", "compiled"):
        tables[name] = tmp_path / f"{name}.csv"
        said = run(capsys, "idm", "five_bar", "--engine", name, "-o", str(tables[name]))
        assert f"engine: {name} (as asked)" in said
    assert same(tables["general"], tables["compiled"])


def test_compiled_engines_close_the_loops_of_a_table(tmp_path: Path, capsys: Any, monkeypatch: Any) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("the general path assembled a row")

    monkeypatch.setattr(assembling, "assemble_requests", refuse)
    said = run(capsys, "idm", "five_bar", "--engine", "compiled", "-o", str(tmp_path / "efforts.csv"))
    assert "worst closure residual: " in said


def test_several_processes_share_what_was_built(tmp_path: Path, capsys: Any) -> None:
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    run(capsys, "idm", "five_bar", "--engine", "compiled", "-o", str(one))
    said = run(capsys, "idm", "five_bar", "--engine", "compiled", "-j", "2", "-o", str(two))
    assert "in 2 processes" in said
    assert same(one, two)


class Motion(NamedTuple):
    """A motion of a robot's whole tree."""

    robot: hybridyn.HybridRobot
    q: Any
    v: Any
    a: Any

    def table(self, file: Path, *words: str, efforts: Any = None) -> str:
        """Write it, with some of "position", "velocity", "acceleration" for every joint, and efforts."""
        header = [f"{joint}/{word}" for word in words for joint in self.robot.joints]
        columns = list(self[1 : 1 + len(words)])
        if efforts is not None:
            header += [f"{motor}/effort" for motor in self.robot.motors]
            columns.append(efforts)
        file.write_text(table_text(header, np.column_stack(columns)))
        return str(file)


@pytest.fixture(scope="module")
def near_singular() -> Motion:
    """Return a motion of the five-bar that comes twice to where the lower links lie on each other.

    There the left upper link has turned by the angle from home to the middle between the motors, and the
    right one by as much the other way.
    """
    robot = hybridyn.load("five_bar")
    upper, spacing, home = 0.25, 0.12, 0.436332  # [m, m, rad from the vertical], as the file has them
    t = np.linspace(0.0, 1.0, 61)
    cos, sin = np.cos(np.pi * t), np.sin(np.pi * t)
    turn = np.arcsin(spacing / upper) + home - GAP
    rates = (
        turn * (1 - cos**4),
        turn * 4 * np.pi * cos**3 * sin,
        turn * 4 * np.pi**2 * (cos**4 - 3 * cos**2 * sin**2),
    )
    motors = {"m1_left_drive": [-x for x in rates], "m1_right_drive": list(rates)}
    return Motion(robot, *hybridyn.assemble(robot, motors=motors))


@pytest.mark.parametrize("command", ["idm", "ddm"])
def test_samples_by_the_general_path_are_counted_in_every_process(
    near_singular: Motion, tmp_path: Path, capsys: Any, monkeypatch: Any, command: str
) -> None:
    robot, q, v, a = near_singular
    compiled = hybridyn.compile(robot)
    tau = compiled.idm(q, v, a)
    table = near_singular.table(tmp_path / "motion.csv", "position", "velocity", "acceleration")
    if command == "ddm":
        q = q.copy()
        q[::20] += SLIGHTLY_OPEN  # what motors cannot hold is no obstacle for the direct model
        compiled.recomputed = 0
        compiled.ddm(q, v, tau)
        assert compiled.recomputed == len(q[::20])
        open_loops = near_singular._replace(q=q)
        table = open_loops.table(tmp_path / "states.csv", "position", "velocity", efforts=tau)
    assert 4 <= compiled.recomputed < len(q) / 4
    monkeypatch.setattr(blocks, "MOST_ROWS", 25)
    for jobs in "13":
        output = str(tmp_path / f"{jobs}.csv")
        said = run(capsys, command, "five_bar", table, "--engine", "compiled", "-j", jobs, "-o", output)
        assert (f"in {jobs} processes" in said) == (jobs != "1")
        told = f"; {compiled.recomputed} samples by the general path (near "
        assert f"{told}lost rank, or loops open by more than rounding)\n" in said


def test_small_tables_are_not_worth_it(tmp_path: Path, capsys: Any) -> None:
    said = run(capsys, "idm", "five_bar", "-o", str(tmp_path / "efforts.csv"))
    assert "engine: general (" in said
    assert "compiled from 8,000 on)" in said


def test_large_tables_are(tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "WORTH_OF_POSTURES", 2_000 // 4)
    monkeypatch.setattr(engine, "WORTH", 2_000)
    said = run(capsys, "idm", "five_bar", "-o", str(tmp_path / "efforts.csv"))
    assert "engine: compiled (" in said
    reactions = str(tmp_path / "reactions.csv")
    said = run(capsys, "idm", "five_bar", "-o", str(tmp_path / "efforts.csv"), "--reactions", reactions)
    assert "engine: general (compiled models cannot do: --reactions)" in said


@pytest.mark.parametrize("command", ["idm", "ddm", "simulate"])
def test_a_looped_module_of_one_freedom_is_compiled_of_its_own_accord(
    command: str, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A door with two hinges: a long table crashed where a short one worked."""
    robot, table = str(save(tmp_path, door(2), "door.urdf")), tmp_path / "table.csv"
    t = np.linspace(0.0, 1.0, 40)
    x = 0.4 * np.sin(3 * t)
    columns = {"time": t, "hinge/position": x, "hinge/velocity": 1.2 * np.cos(3 * t)}
    columns |= {"hinge/effort": x} if command == "ddm" else {"hinge/acceleration": -9.0 * x}
    table.write_text(table_text([*columns], np.column_stack([*columns.values()])))
    scene = tmp_path / "fall.toml"
    scene.write_text(f'duration = 0.2\n[robot]\nfile = "{robot}"\n[solver]\nmethod = "rk4"\nstep = 5e-3\n')
    words = ["simulate", str(scene)] if command == "simulate" else [command, robot, str(table)]
    tables = {name: tmp_path / f"{name}.csv" for name in ("general", "compiled")}
    assert "engine: general (" in run(capsys, *words, "-o", str(tables["general"]))
    monkeypatch.setattr(engine, "WORTH_OF_POSTURES", 20 // 4)
    monkeypatch.setattr(engine, "WORTH", 20)
    monkeypatch.setattr("hybridyn.cli.simulate.WORTH_IN_TIME", 20)
    assert "engine: compiled (" in run(capsys, *words, "-o", str(tables["compiled"]))
    a, b = (np.array([*read_table(plain(name)).values()]) for name in tables.values())
    assert np.abs(a - b).max() <= (METHOD if command == "simulate" else AGREE) * np.abs(a).max()


@pytest.mark.parametrize("asked", [[], ["--engine", "compiled"]])
def test_what_goes_wrong_inside_leaves_the_general_path(
    asked: list[str], tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An exception that is not ours: the summary says so; where the models were asked for, it is an error."""

    def broken(*_: Any, **__: Any) -> Any:
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setattr("hybridyn.compiled.compiling.library_of", broken)
    monkeypatch.setattr(engine, "WORTH_OF_POSTURES", 2_000 // 4)
    monkeypatch.setattr(engine, "WORTH", 2_000)
    status = main(["idm", "five_bar", *asked, "-o", str(tmp_path / "efforts.csv")])
    said = capsys.readouterr().err
    assert "the models of the robot 'five_bar' cannot be compiled (ZeroDivisionError" in said
    assert status == (1 if asked else 0)
    assert ("engine: general (not compiled: " in said) == (not asked)


def test_what_compiled_models_cannot_do_is_refused(tmp_path: Path, capsys: Any) -> None:
    output = str(tmp_path / "efforts.csv")
    assert main(["idm", "five_bar", "--engine", "compiled", "--passive", "solved", "-o", output]) == 1
    assert "cannot do: --passive solved; use --engine general" in capsys.readouterr().err


def test_without_a_compiler_the_general_path_works(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none() -> Any:
        raise engine.HybridynError("no C compiler was found: install gcc")

    monkeypatch.setattr("hybridyn.compiled.compiling.find_compiler", none)
    output = str(tmp_path / "efforts.csv")
    assert main(["idm", "five_bar", "--engine", "compiled", "-o", output]) == 1
    assert "install gcc" in capsys.readouterr().err
    monkeypatch.setattr(engine, "WORTH_OF_POSTURES", 2_000 // 4)
    monkeypatch.setattr(engine, "WORTH", 2_000)
    said = run(capsys, "idm", "five_bar", "-o", output)
    assert "engine: general (not compiled: no C compiler was found" in said


def test_the_direct_model_too(tmp_path: Path, capsys: Any) -> None:
    """A motion's own states and efforts give its accelerations back, by both engines."""
    efforts, states = tmp_path / "efforts.csv", tmp_path / "states.csv"
    run(capsys, "idm", "five_bar", "-o", str(efforts))
    trajectory = shipped_robots()["five_bar"].trajectory
    assert trajectory
    left = Path(trajectory).read_text().splitlines()
    right = [line.split(",", 1)[1] for line in efforts.read_text().splitlines()]
    states.write_text("\n".join(f"{a},{b}" for a, b in zip(left, right, strict=True)) + "\n")
    tables = {name: tmp_path / f"{name}.csv" for name in ("general", "compiled")}
    for name, table in tables.items():
        said = run(capsys, "ddm", "five_bar", str(states), "--engine", name, "-o", str(table))
        assert f"engine: {name} (as asked)" in said
    assert same(tables["general"], tables["compiled"])


@pytest.mark.slow
def test_effects_too(near_singular: Motion, tmp_path: Path, capsys: Any, monkeypatch: Any) -> None:
    """What they add is the same, to all digits that are printed; samples count in each of five runs."""
    robot, q, v, a = near_singular
    compiled, out = hybridyn.compile(robot), {}
    compiled.idm(q, v, a)
    table = near_singular.table(tmp_path / "motion.csv", "position", "velocity", "acceleration")
    asked = ["effects", "five_bar", table, "--effects", "default,rotor_inertia"]
    said = run(capsys, *asked)
    assert "engine: general (244 samples times freedoms; compiled from 2,000,000 on)\n" in said
    monkeypatch.setattr("hybridyn.cli.effects.WORTH_OF_EFFECTS", 200)
    for words in ([], ["--engine", "general"]):
        assert main([*asked, *words]) == 0
        told, said = capsys.readouterr()
        out[not words] = told.split("time per sample")[0]
        why = "as asked" if words else "244 samples times freedoms"
        assert f"engine: {'general' if words else 'compiled'} ({why})" in said
        if not words:
            assert f"; {5 * compiled.recomputed} samples by the general path (near lost rank" in said
            assert "5 sets of effects compiled, each of which counts its samples\n" in said
            assert "1 set of effects left to the general path; gravity, leg_inertia: " in said
    assert out[True] == out[False]


def test_effects_tell_what_compiled_models_cannot_do(tmp_path: Path, capsys: Any) -> None:
    trajectory = shipped_robots()["five_bar"].trajectory
    assert trajectory
    header, *rows = Path(trajectory).read_text().splitlines()
    table = tmp_path / "pushed.csv"
    wrench = ",".join(f"m1_tool/wrench/{word}" for word in ("fx", "fy", "fz", "mx", "my", "mz"))
    table.write_text("\n".join([f"{header},{wrench}", *(f"{row},1,0,0,0,0,0" for row in rows[:20])]) + "\n")
    assert main(["effects", "five_bar", str(table), "--engine", "compiled"]) == 1
    assert "cannot do: wrenches in the table; use --engine general" in capsys.readouterr().err
    statics = ["effects", "five_bar", str(trajectory), "--effects", "gravity,leg_inertia"]
    assert main([*statics, "--engine", "compiled"]) == 1
    assert "models without the effect 'inertia' cannot be compiled" in capsys.readouterr().err


def test_simulations_too(tmp_path: Path, capsys: Any) -> None:
    scene = tmp_path / "fall.toml"
    scene.write_text(
        f'duration = 0.2\n[robot]\nfile = "{shipped_robots()["five_bar"].file}"\n'
        "[initial]\njoints = { m1_left_drive = 0.5, m1_right_drive = 0.2 }\n"
        '[solver]\nmethod = "rk4"\nstep = 5e-3\n'
    )
    tables = {name: tmp_path / f"{name}.csv" for name in ("general", "compiled")}
    for name, table in tables.items():
        said = run(capsys, "simulate", str(scene), "--engine", name, "-o", str(table))
        assert f"engine: {name} (as asked)" in said
        head = [line for line in table.read_text().splitlines() if line.startswith("#")]
        assert f"# engine: {name} (as asked)" in head
    a, b = (np.genfromtxt(table, delimiter=",", comments="#", skip_header=5) for table in tables.values())
    assert np.nanmax(np.abs(a - b)) <= METHOD * np.nanmax(np.abs(a))
    said = run(capsys, "simulate", str(scene), "-o", str(tables["general"]))
    assert "engine: general (640 samples times freedoms; compiled from 40,000 on)" in said


def test_motor_sizing_too(tmp_path: Path, capsys: Any) -> None:
    """The loads of the motors agree in all digits that are printed, and the compiled models assemble."""
    told = {}
    for name in ("general", "compiled"):
        assert main(["size", "five_bar", "--engine", name]) == 0
        told[name], said = capsys.readouterr()
        assert f"engine: {name} (as asked)" in said
    assert told["general"] == told["compiled"]


def test_tables_that_are_assembled_are_worth_it_sooner() -> None:
    robot = hybridyn.load("five_bar")
    states, poses = (Layout(None, 0, full_state=full) for full in (True, False))
    assert engine.worth_of(poses, robot) < engine.worth_of(states, robot) == engine.WORTH
