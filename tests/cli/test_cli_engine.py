"""The engine of the command line: chosen by a rule that is told, the same numbers by both."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import Mock

import numpy as np
import pytest

import hybridyn
import hybridyn.cli.common.engine_choice as engine
import hybridyn.compiled.programs.closing.assembling as assembling
import hybridyn.streams.one_pass as blocks
from hybridyn.description.shipped import shipped_robots
from hybridyn.tables.layout import Layout
from tests import ROOT
from tests.robots.robot_texts import door, save
from tests.support.command_line import Said, read_table, table_text
from tests.support.files import beginning
from tests.support.samples import slow

Run = Callable[..., Said]
TRAJECTORY = ROOT / "models/five_bar/traj.csv"
FALL = 'duration = 0.2\n[robot]\nfile = "{}"\n[solver]\nmethod = "rk4"\nstep = 5e-3\n'

#: Both engines are exact to rounding; the table's numbers have 17 digits.
AGREE = 1e-10
#: Simulations take other coordinates: they agree to the error of steps of 5 ms.
METHOD = 1e-4

#: How far from the singular posture the motion turns back [rad]: pivots are a hundredth of their usual size
#: some samples earlier.
GAP = 1e-3

#: What is added to joints [rad]: more than rounding, less than what counts as open.
SLIGHTLY_OPEN = 1e-8


def numbers(path: Path) -> np.ndarray:
    """Return a table without its first column, the time."""
    return np.column_stack([*read_table(Path(path).read_text()).values()][1:])


def same(one: Path, other: Path, tolerance: float = AGREE) -> bool:
    """Compare two tables."""
    a, b = numbers(one), numbers(other)
    return bool(np.abs(a - b).max() <= tolerance * np.abs(a).max())


def by_both(run: Run, folder: Path, *words: object) -> list[Path]:
    """Run a command by each engine, as asked; gives both tables."""
    tables = [folder / "general.csv", folder / "compiled.csv"]
    for table in tables:
        said = run(*words, "--engine", table.stem, "-o", table)
        assert f"engine: {table.stem} (as asked)" in said.err
    return tables


@pytest.fixture
def worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile for tables of 2,000 samples times freedoms."""
    monkeypatch.setattr(engine, "WORTH_OF_POSTURES", 2_000 // 4)
    monkeypatch.setattr(engine, "WORTH", 2_000)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Return the first rows of the five-bar's motion."""
    return beginning(tmp_path, "five_bar", 100)


@pytest.mark.parametrize("command", ["idm", "ddm", "simulate"])
def test_both_engines_give_the_same_tables(
    run: Run, tmp_path: Path, table: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """The direct model gets a motion's own states and efforts."""
    words: list[object] = ["five_bar", table]
    if command == "ddm":
        run("idm", *words, "-o", tmp_path / "efforts.csv")
        left = table.read_text().splitlines()
        right = [line.split(",", 1)[1] for line in (tmp_path / "efforts.csv").read_text().splitlines()]
        rows = [f"{a},{b}" for a, b in zip(left, right, strict=True)]
        words[1] = save(tmp_path, "\n".join(rows) + "\n", "states.csv")
    if command == "simulate":
        joints = "joints = { m1_left_drive = 0.5, m1_right_drive = 0.2 }"
        words = [
            save(
                tmp_path,
                FALL.format(shipped_robots()["five_bar"].file) + f"[initial]\n{joints}\n",
                "fall.toml",
            )
        ]
    tables = by_both(run, tmp_path, command, *words)
    assert same(*tables, METHOD if command == "simulate" else AGREE)
    if command == "simulate":
        assert tables[1].read_text().startswith("time,")
        monkeypatch.setattr(engine, "_is_built", lambda *_: False)
        said = run(command, *words, "-o", tables[0])
        worth = f"(640 samples times freedoms; compiled from {engine.worth_in_time(4):,} on)"
        assert f"engine: general {worth}" in said.err


def test_compiled_engines_close_the_loops_of_a_table(
    run: Run, tmp_path: Path, table: Path, monkeypatch: Any
) -> None:
    monkeypatch.setattr(assembling, "assemble_requests", lambda *_: pytest.fail("the general path assembled"))
    said = run("idm", "five_bar", table, "--engine", "compiled", "-o", tmp_path / "efforts.csv")
    assert "worst closure residual: " in said.err


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
        return str(save(file.parent, table_text(header, np.column_stack(columns)), file.name))


@pytest.fixture(scope="module")
def near_singular() -> Motion:
    """Return a motion of the five-bar to where the lower links nearly lie on each other, and back.

    There the left upper link has turned by the angle from home to the middle between the motors, and the
    right one by as much the other way.
    """
    robot = hybridyn.load("five_bar")
    upper, spacing, home = 0.25, 0.12, 0.436332  # [m, m, rad from the vertical], as the file has them
    t = np.linspace(0.0, 0.5, 31)
    cos, sin = np.cos(np.pi * t), np.sin(np.pi * t)
    turn = np.arcsin(spacing / upper) + home - GAP
    rates = (
        turn * (1 - cos**4),
        turn * 4 * np.pi * cos**3 * sin,
        turn * 4 * np.pi**2 * (cos**4 - 3 * cos**2 * sin**2),
    )
    motors = {"m1_left_drive": [-x for x in rates], "m1_right_drive": list(rates)}
    q, v, a = hybridyn.assemble(robot, motors=motors)
    q, v, a = (np.vstack([x, sign * x[-2::-1]]) for x, sign in ((q, 1), (v, -1), (a, 1)))
    return Motion(robot, q, v, a)


@pytest.mark.parametrize(("command", "processes"), [("idm", "none"), ("ddm", "none"), slow("ddm", "real")])
def test_samples_by_the_general_path_are_counted_in_every_process(
    near_singular: Motion,
    run: Run,
    tmp_path: Path,
    monkeypatch: Any,
    command: str,
    processes: str,
    request: pytest.FixtureRequest,
) -> None:
    if processes == "none":
        request.getfixturevalue("one_process")
    robot, q, v, a = near_singular
    compiled = hybridyn.compile(robot)
    tau = compiled.idm(q, v, a)
    table = near_singular.table(tmp_path / "motion.csv", "position", "velocity", "acceleration")
    if command == "ddm":
        q = q.copy()
        q[::20] += SLIGHTLY_OPEN  # what motors cannot hold is no obstacle for the direct model
        compiled.handed_over.clear()
        compiled.ddm(q, v, tau)
        assert compiled.recomputed == len(q[::20])
        open_loops = near_singular._replace(q=q)
        table = open_loops.table(tmp_path / "states.csv", "position", "velocity", efforts=tau)
    assert 4 <= compiled.recomputed < len(q) / 4
    monkeypatch.setattr(blocks, "MOST_ROWS", 25)
    tables = [tmp_path / f"{jobs}.csv" for jobs in ("12" if command == "ddm" else "1")]
    for output in tables:
        jobs = output.stem
        said = run(command, "five_bar", table, "--engine", "compiled", "-j", jobs, "-o", output).err
        assert (f"in {jobs} processes" in said) == (jobs != "1")
        told = f"; {compiled.recomputed} samples by the general path (near "
        assert f"{told}lost rank, loops open by more than rounding, or a force that no motor gives)\n" in said
    assert same(tables[0], tables[-1])  # the processes use what was built


def test_small_tables_are_not_worth_it(run: Run, tmp_path: Path, table: Path) -> None:
    said = run("idm", "five_bar", table, "-o", tmp_path / "efforts.csv").err
    assert "engine: general (" in said
    assert "compiled from 8,000 on)" in said


def test_large_tables_are(run: Run, tmp_path: Path, worth_it: None) -> None:
    words = ["idm", "five_bar", "-o", tmp_path / "efforts.csv"]
    assert "engine: compiled (" in run(*words).err
    said = run(*words, "--reactions", tmp_path / "reactions.csv")
    assert "engine: general (compiled models cannot do: --reactions)" in said.err


@pytest.mark.parametrize("command", ["idm", "ddm", "simulate"])
def test_a_looped_module_of_one_freedom_is_compiled_of_its_own_accord(
    command: str, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A door with two hinges: a long table crashed where a short one worked."""
    robot, t = save(tmp_path, door(2), "door.urdf"), np.linspace(0.0, 1.0, 40)
    x = 0.4 * np.sin(3 * t)
    columns = {"time": t, "hinge/position": x, "hinge/velocity": 1.2 * np.cos(3 * t)}
    columns |= {"hinge/effort": x} if command == "ddm" else {"hinge/acceleration": -9.0 * x}
    table = save(tmp_path, table_text([*columns], np.column_stack([*columns.values()])), "table.csv")
    scene = save(tmp_path, FALL.format(robot), "fall.toml")
    words = ["simulate", scene] if command == "simulate" else [command, robot, table]
    tables = [tmp_path / "general.csv", tmp_path / "compiled.csv"]
    monkeypatch.setattr(engine, "_is_built", lambda *_: False)
    assert "engine: general (" in run(*words, "-o", tables[0]).err
    monkeypatch.setattr(engine, "WORTH_OF_POSTURES", 20 // 4)
    monkeypatch.setattr(engine, "WORTH", 20)
    monkeypatch.setattr("hybridyn.cli.simulate.worth_in_time", lambda freedoms: 20)
    assert "engine: compiled (" in run(*words, "-o", tables[1]).err
    assert same(*tables, METHOD if command == "simulate" else AGREE)


@pytest.mark.parametrize("asked", [[], ["--engine", "compiled"]])
def test_what_goes_wrong_inside_leaves_the_general_path(
    asked: list[str], run: Run, tmp_path: Path, worth_it: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An exception that is not ours: the summary says so; where the models were asked for, it is an error."""
    broken = Mock(side_effect=ZeroDivisionError("float division by zero"))
    monkeypatch.setattr("hybridyn.compiled.compiling.library_of", broken)
    said = run("idm", "five_bar", *asked, "-o", tmp_path / "efforts.csv", status=1 if asked else 0).err
    assert "the models of the robot 'five_bar' cannot be compiled (ZeroDivisionError" in said
    assert ("engine: general (not compiled: " in said) == (not asked)


def test_what_compiled_models_cannot_do_is_refused(run: Run, tmp_path: Path) -> None:
    words = ["idm", "five_bar", "--engine", "compiled", "--passive", "solved", "-o", tmp_path / "efforts.csv"]
    run(*words, status=1, says="cannot do: --passive solved; use --engine general")


def test_without_a_compiler_the_general_path_works(
    run: Run, tmp_path: Path, worth_it: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    none = Mock(side_effect=engine.HybridynError("no C compiler was found: install gcc"))
    monkeypatch.setattr("hybridyn.compiled.library.cache.find_compiler", none)
    words = ["idm", "five_bar", "-o", tmp_path / "efforts.csv"]
    run(*words, "--engine", "compiled", status=1, says="install gcc")
    assert "engine: general (not compiled: no C compiler was found" in run(*words).err


@pytest.mark.slow
def test_effects_too(near_singular: Motion, run: Run, tmp_path: Path, monkeypatch: Any) -> None:
    """What they add is the same, to all digits that are printed; samples count in each of five runs."""
    robot, q, v, a = near_singular
    compiled = hybridyn.compile(robot)
    compiled.idm(q, v, a)
    table = near_singular.table(tmp_path / "motion.csv", "position", "velocity", "acceleration")
    asked = ["idm", "five_bar", table, "--by-effect", "--effects", "default,rotor_inertia"]
    said = run(*asked).err
    assert "engine: general (244 samples times freedoms; compiled from 2,000,000 on)\n" in said
    monkeypatch.setattr("hybridyn.cli.common.reports.WORTH_OF_EFFECTS", 200)
    own, general = run(*asked), run(*asked, "--engine", "general")
    assert own.out == general.out
    assert "engine: general (as asked)" in general.err
    for told in (
        "engine: compiled (244 samples times freedoms)",
        f"; {5 * compiled.recomputed} samples by the general path (near lost rank",
        "5 sets of effects compiled, 1 left to the general path\n",
    ):
        assert told in own.err


def test_effects_tell_what_compiled_models_cannot_do(run: Run, tmp_path: Path) -> None:
    header, *rows = TRAJECTORY.read_text().splitlines()
    wrench = ",".join(f"m1_tool/wrench/{word}" for word in ("fx", "fy", "fz", "mx", "my", "mz"))
    pushed = "\n".join([f"{header},{wrench}", *(f"{row},1,0,0,0,0,0" for row in rows[:20])]) + "\n"
    asked = ["--by-effect", "--engine", "compiled"]
    words = ["idm", "five_bar", save(tmp_path, pushed, "pushed.csv"), *asked]
    run(*words, status=1, says="cannot do: wrenches in the table; use --engine general")
    statics = ["idm", "five_bar", TRAJECTORY, "--effects", "gravity,leg_inertia", *asked]
    run(*statics, status=1, says="models without the effect 'inertia' cannot be compiled")


def test_motor_sizing_too(run: Run, table: Path) -> None:
    """The loads of the motors agree in all digits that are printed, and the compiled models assemble."""
    words = ("idm", "five_bar", table, "--loads", "--effects", "default", "--engine")
    told = {name: run(*words, name) for name in ("general", "compiled")}
    assert all(f"engine: {name} (as asked)" in said.err for name, said in told.items())
    assert told["general"].out == told["compiled"].out


def test_tables_that_are_assembled_are_worth_it_sooner() -> None:
    robot = hybridyn.load("five_bar")
    states, poses = (Layout(None, 0, {}, {}, {}, {}, full) for full in (True, False))
    assert engine.worth_of(poses, robot) < engine.worth_of(states, robot) == engine.WORTH


def test_a_model_in_the_cache_is_used_where_a_build_would_not_pay(
    run: Run, tmp_path: Path, monkeypatch: Any
) -> None:
    """Half of what is worth a build is general without a model, and compiled with it; little is general."""
    fall = FALL.replace("0.2", "0.02").format(shipped_robots()["five_bar"].file)
    scene = save(tmp_path, fall, "fall.toml")
    words, lines = ("simulate", scene, "-o", tmp_path / "fall.csv", "--overwrite"), []
    for there in (False, True):
        monkeypatch.setattr(engine, "_is_built", lambda *_, there=there: there)
        for worth in (2 * 64, 64 * 40):
            monkeypatch.setattr("hybridyn.cli.simulate.worth_in_time", lambda _, worth=worth: worth)
            said = run(*words).err
            lines.append(next(line for line in said.splitlines() if line.startswith("engine:")))
    assert [line.split()[1] for line in lines] == ["general", "general", "compiled", "general"]
    assert "the model is in the cache" in lines[2]


@pytest.mark.slow
def test_only_what_is_built_lies_in_the_cache(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path))
    robot = hybridyn.load("five_bar")
    effects = hybridyn.effects.choose(robot, None)
    assert not engine._is_built(robot, effects)
    assert hybridyn.compile(robot).library.programs
    assert engine._is_built(robot, effects)
    assert not engine._is_built(robot, hybridyn.effects.choose(robot, ["default", "rotor_inertia"]))


def test_a_build_is_weighed_against_the_time_that_simulate_saves() -> None:
    """As measured: a five_bar pays from some 650 samples on, an lx4 from some 250."""
    assert 500 * 4 < engine.worth_in_time(4) < 800 * 4
    assert 200 * 84 < engine.worth_in_time(84) < 300 * 84
