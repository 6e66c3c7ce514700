"""The rule for freedoms that poses leave stands wherever poses stand: an arm whose tool has two coordinates.

Each case is given once by the tool and a rule, once by the motors' motion that `assemble` finds by this rule.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot
from hybridyn.cli import main
from hybridyn.cli.view import _run
from hybridyn.errors import ModelError
from hybridyn.scenes.stage import play, stage
from hybridyn.spatial import Array
from hybridyn.studies.sweep.compiled_chunks import evaluate_chunk
from hybridyn.studies.sweep.designs import designs_of
from hybridyn.studies.sweep.evaluation import Chunk
from hybridyn.studies.sweep.reading import read_study
from hybridyn.studies.workspace.workspace import workspace
from hybridyn.view.posing import Poser
from tests.assembly.test_second_tasks import MIDDLE, limited, waves
from tests.support.command_line import call
from tests.support.comparing import close_to
from tests.support.extras import needs
from tests.support.files import save

TIME = np.linspace(0.0, 0.5, 4)
X, Z = waves(1.1, 0.05, 1.0)(TIME), waves(0.2, 0.05, 2.0)(TIME)
LEVELS = ("position", "velocity", "acceleration")
EXACT = 1e-9  # of postures, relative to the largest


class Ruled(NamedTuple):
    """The arm, and the postures along its tool's motion by the rule; tables of both stand in the folder."""

    robot: HybridRobot
    q: Array


def write(folder: Path, name: str, columns: list[str], values: tuple[Array, ...]) -> None:
    """Write a table of columns over time."""
    header, rows = ",".join(["time", *columns]), np.column_stack([TIME, *values])
    np.savetxt(folder / f"{name}.csv", rows, "%.17g", ",", header=header, comments="")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ruled]:
    folder = tmp_path_factory.mktemp("arm")
    robot = limited(folder)
    names = [f"l3/{level}/{axis}" for axis in "xz" for level in ("pose", *LEVELS[1:])]
    write(folder, "tool", names, (*X, *Z))
    levels = tuple({"x": x, "z": z} for x, z in zip(X, Z, strict=True))
    states = hybridyn.assemble(robot, platforms={"l3": levels}, redundancy=MIDDLE)
    each = [(f"{name}/{LEVELS[k]}", states[k][:, i]) for i, name in enumerate(robot.motors) for k in range(3)]
    write(folder, "motors", [name for name, _ in each], tuple(x for _, x in each))
    return folder, Ruled(robot, states[0])


@pytest.fixture
def arm(found: tuple[Path, Ruled], monkeypatch: pytest.MonkeyPatch) -> Ruled:
    monkeypatch.chdir(found[0])
    return found[1]


def scene(text: str) -> Path:
    head = f"duration = {TIME[-1]}\nredundancy = '{MIDDLE}'\n[robot]\nfile = 'arm.urdf'\n"
    return save(Path(), f"{head}{text}\n", "scene.toml")


def tool_at(row: int) -> str:
    """Return the keys of a scene for the tool in a row."""
    return f"platforms = {{ l3 = {{ x = {float(X[0][row])!r}, z = {float(Z[0][row])!r} }} }}\n"


def study(tasks: str) -> Path:
    """Write a study of one design with some tasks."""
    head = '[robot]\nfile = "arm.urdf"\n[designs]\nmethod = "grid"\n'
    head += '[parameters]\nmass = { scale_inertia = "l1", values = [0.9] }\n'
    return save(Path(), head + tasks, "study.toml")


def measured(tasks: str) -> tuple[float, ...]:
    """Return what a study of one design measures."""
    source = read_study(study(tasks))
    (row,) = evaluate_chunk(source, Chunk(0, designs_of(source)), None).rows
    assert row.status == "ok", row.message
    return row.measures


def of_sweep(arm: Ruled) -> None:
    means, tasks = ", ".join(f'{name} = "mean {name}/position"' for name in arm.robot.motors), ""
    for name, rule in (("motors", ""), ("tool", f"redundancy = '{MIDDLE}'\n")):
        tasks += f"[tasks.{name}]\ntrajectory = '{name}.csv'\n{rule}measure = {{ {means} }}\n"
    wanted, ours = np.reshape(measured(tasks), (2, -1))
    close_to(ours, wanted, EXACT)


def of_workspace(arm: Ruled) -> None:
    """Postures have the conditioning of those that `assemble` finds at the same poses."""
    where, task = {"link": "l3", "axes": ["z"], "steps": {"z": 0.8}}, "measure = ['min_conditioning']\n"
    task += f"redundancy = '{MIDDLE}'\nworkspace = {{ link = 'l3', axes = ['z'], steps = {{ z = 0.8 }} }}\n"
    (least,) = measured(f"[tasks.reach]\n{task}")
    found = workspace(arm.robot, **where, redundancy=MIDDLE)
    poses = dict(zip(found.sweep.names, found.coordinates.T, strict=True))
    q = hybridyn.assemble(arm.robot, platforms={"l3": (poses,)}, guess=found.q[0], redundancy=MIDDLE)[0]
    close_to(found.q, q, EXACT)
    assert found.measures["conditioning"].min() == pytest.approx(least, rel=EXACT)


def of_start(arm: Ruled) -> None:
    close_to(stage(scene("[initial]\n" + tool_at(3))).q0, arm.q[3], EXACT)


def of_motion(arm: Ruled) -> None:
    close_to(play(stage(scene("[motion]\ntable = 'tool.csv'\n[output]\nrate = 6.0"))).q, arm.q, EXACT)


def of_points(arm: Ruled) -> None:
    points = "".join(f"[[motion.points]]\ntime = {TIME[k]}\n{tool_at(k)}" for k in (2, 3))
    motion = stage(scene(f"[initial]\n{tool_at(0)}{points}")).motion
    assert motion is not None
    close_to(motion.x[0], arm.q[[0, 2, 3]], EXACT)


def of_view(arm: Ruled) -> None:
    close_to(_run(arm.robot, "tool.csv", ("default",), MIDDLE).q, arm.q, EXACT)


def of_drag(arm: Ruled) -> None:
    """A planar arm of four joints keeps x, z and the pitch of its tool."""
    start, poser = arm.q[0], Poser(arm.robot, MIDDLE)
    moved = poser.drag(start, "l3", poser.pose(arm.q[3], "l3")[0])
    pose = {"x": X[0][3], "z": Z[0][3], "pitch": np.sum(start)}
    given = hybridyn.assemble(arm.robot, platforms={"l3": (pose,)}, guess=start, redundancy=MIDDLE)
    assert not moved.message
    close_to(moved.q, given[0], EXACT)


def of_effects(arm: Ruled) -> None:
    peaks = []
    for name, more in (("motors", ()), ("tool", ("--redundancy", MIDDLE))):
        assert main(["idm", "arm.urdf", f"{name}.csv", "--by-effect", "-o", f"{name}_e.csv", *more]) == 0
        peaks.append(np.loadtxt(f"{name}_e.csv", delimiter=",", skiprows=1, usecols=(3, 4)))
    close_to(peaks[1], peaks[0], EXACT)


@pytest.mark.parametrize(
    "case",
    [of_sweep, of_workspace, of_start, of_motion, of_points, of_view, of_drag, of_effects],
    ids=lambda f: f.__name__,
)
def test_tools_with_a_rule_move_as_the_motors_that_it_finds(
    case: Callable[[Ruled], None], arm: Ruled
) -> None:
    case(arm)


@pytest.mark.slow
def test_cost_follows_the_rule(arm: Ruled, capsys: pytest.CaptureFixture[str]) -> None:
    given = "cost", "arm.urdf", "tool.csv", "--redundancy", MIDDLE
    assert "closing: 4 of 4 samples are closed in Python" in call(capsys, *given).out


@pytest.mark.parametrize("command", ["idm", "ddm", "cost", "view", "idm --by-effect", "workspace"])
def test_commands_refuse_unknown_rules(command: str, arm: Ruled, capsys: pytest.CaptureFixture[str]) -> None:
    name, *more = command.split()
    if name == "view":
        needs("view")
    table = ("tool.csv",) if name != "workspace" else ()
    assert main([name, "arm.urdf", *table, *more, "--redundancy", "middle"]) == 1
    assert "unknown redundancy 'middle'" in capsys.readouterr().err


def test_exported_c_has_the_least_motion_alone(arm: Ruled, capsys: pytest.CaptureFixture[str]) -> None:
    given = "convert", "arm.urdf", "--c", "-o", "c", "--given", "l3/pose/x,l3/pose/z", "--redundancy"
    assert main([*given, MIDDLE]) == 2
    assert "exported C knows 'least motion' alone. Give it the motors' positions" in capsys.readouterr().err


def test_scenes_and_studies_refuse_unknown_rules(arm: Ruled, capsys: pytest.CaptureFixture[str]) -> None:
    text = scene("").read_text().replace(MIDDLE, "middle")
    assert main(["simulate", str(save(Path(), text, "wrong.toml"))]) == 1
    known = "should be 'least motion', 'middle of ranges' or 'away from singular'"
    with pytest.raises(ModelError, match="study.toml:8: 'tasks.a.redundancy': " + known):
        read_study(study("[tasks.a]\nredundancy = 'middle'\ntrajectory = 'tool.csv'\nmeasure = ['time']\n"))
    with pytest.raises(ModelError, match="a scene states its own 'redundancy': write it there"):
        read_study(study(f"[tasks.a]\nredundancy = '{MIDDLE}'\nscene = 'scene.toml'\nmeasure = ['time']\n"))
    assert f"wrong.toml:2: 'redundancy': {known}" in capsys.readouterr().err
    assert main(["cost", "scene.toml", "--redundancy", MIDDLE]) == 2
    assert "write the rule in the scene" in capsys.readouterr().err
