"""Scenes with absurd numbers, state files that were changed, files that must not be replaced, full disks."""

import errno
import io
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.cli import main
from hybridyn.scenes.stage import stage
from hybridyn.simulation.result import SimulationResult
from hybridyn.simulation.run import BLOCK
from tests.support.command_line import ROOT
from tests.support.comparing import refused
from tests.support.files import save

SCENE = f"""duration = 2.0
[robot]
file = "{ROOT}/urdf/five_bar.urdf.xacro"
[controller]
kind = "efforts"
efforts = {{ m1_left_drive = 0.5 }}
"""


def written(folder: Path, more: str, text: str = SCENE) -> Path:
    return save(folder, text + more, "scene.toml")


# ---------------------------------------------------------------- rows and steps


@pytest.mark.parametrize(
    ("more", "key"),
    [
        ("[output]\nrate = 2e12\n", "output.rate"),
        ("[output]\nrate = 1e15\n", "output.rate"),
        ("[output]\nrate = 1e308\n", "output.rate"),
        ('[solver]\nmethod = "rk4"\nstep = 1e-320\n', "solver.step"),
        ('[solver]\nmethod = "implicit"\nstep = 1e-15\n', "solver.step"),
    ],
)
def test_more_than_memory_holds_is_refused_at_once(run, tmp_path: Path, more: str, key: str) -> None:
    run(
        "simulate",
        written(tmp_path, more),
        "-o",
        tmp_path / "x.csv",
        status=1,
        says=[f"'{key}'", "GB of memory"],
    )
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


def test_what_fits_depends_on_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, "[output]\nrate = 1000.0\n")
    assert len(stage(path).output_times) == 2001
    monkeypatch.setattr("hybridyn.simulation.simulate.memory", lambda: 1e6)
    words = r"scene.toml:\d+: 'output.rate': 2e\+03 rows need 0.00"
    refused(lambda: stage(path), hybridyn.HybridynError, words)


def pendulum() -> tuple[hybridyn.HybridRobot, np.ndarray, np.ndarray]:
    robot = hybridyn.load(ROOT / "urdf/benchmarks/heavy_top.urdf.xacro")
    return robot, robot.home, np.full(robot.nv, 0.1)


def test_an_interrupt_among_many_rows_of_one_step_waits_for_a_block_only(tmp_path: Path) -> None:
    """And more steps than memory holds are refused."""
    robot, q0, v0 = pendulum()
    many = partial(hybridyn.simulate, robot, q0, v0, (0, 1), method="rk4", step=1e-320)
    refused(many, hybridyn.TrajectoryError, "take longer steps")
    times = np.linspace(0, 0.02, 3 * BLOCK)
    options = {"method": "rk4", "step": 0.01, "output_times": times}
    heard: list[float] = []

    def stop(t: float, end: float) -> None:
        heard.append(t)
        raise KeyboardInterrupt

    part = hybridyn.simulate(robot, q0, v0, (0, 0.02), progress=stop, **options)
    assert heard == [0.0]  # within the first step
    assert (part.status, part.counters.steps, part.state.t) == ("interrupted", 0, 0.0)
    assert (part.t <= part.state.t).all()
    part.save(tmp_path / "x.npz")
    again = hybridyn.simulate(robot, None, None, (0, 0.02), resume=tmp_path / "x.npz", **options)
    whole = hybridyn.simulate(robot, q0, v0, (0, 0.02), **options)
    for name in ("t", "q", "v", "a", "kinetic", "potential"):
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name


# ---------------------------------------------------------------- state files


@pytest.fixture(scope="module")
def stopped_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scene, the table of its stopped run and its state."""
    folder = tmp_path_factory.mktemp("stopped")
    path, target = written(folder, "[output]\nrate = 100.0\n"), folder / "run.csv"
    assert main(["simulate", str(path), "--until", "0.1", "-o", str(target), "-q"]) == 0
    return folder


@pytest.fixture
def stopped(stopped_once: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A copy of them: the scene and the table."""
    folder = tmp_path / "stopped"
    shutil.copytree(stopped_once, folder)
    return folder / "scene.toml", folder / "run.csv"


def not_resumed(run, stopped: tuple[Path, Path], text: str) -> None:
    scene, target = stopped
    state = Path(f"{target}.state")
    before = target.read_bytes(), state.read_bytes()
    said = run("simulate", scene, "--resume", "-o", target, status=1, says=["run.csv.state", text])
    assert "bug" not in said.err
    assert (target.read_bytes(), state.read_bytes()) == before


def arrays(state: Path) -> dict[str, np.ndarray]:
    with np.load(state) as file:
        return dict(file)


def packed(data: dict[str, np.ndarray]) -> bytes:
    """Return an archive of arrays as a program would write it, the archive's own check sums included."""
    out = io.BytesIO()
    np.savez(out, **data)
    return out.getvalue()


CHANGED: dict[str, tuple[Callable[[Path], bytes], str]] = {
    **{
        f"cut at {part}": (
            lambda state, part=part: state.read_bytes()[: int(part * state.stat().st_size)],
            "not a result of a simulation",
        )
        for part in (0.0, 0.01, 0.4, 0.9, 0.999)
    },
    **{
        f"{name} missing": (
            lambda state, name=name: packed({key: x for key, x in arrays(state).items() if key != name}),
            "not a result of a simulation",
        )
        for name in ("said", "state_q", "event_t")
    },
    **{
        f"{name} edited": (
            lambda state, name=name, new=new: packed(arrays(state) | {name: new}),
            "not a result of a simulation as it was written: its numbers have changed",
        )
        for name, new in (
            ("said", np.array("3")),
            ("state_t", np.array("later")),
            ("state_q", np.zeros(3)),
            ("tau", np.zeros((1, 9))),
            ("kinetic", np.zeros(0, dtype="datetime64[s]")),
        )
    },
}


@pytest.mark.parametrize("how", CHANGED)
def test_a_state_file_that_is_not_as_it_was_written_is_refused(
    run, stopped: tuple[Path, Path], how: str
) -> None:
    state, (change, told) = Path(f"{stopped[1]}.state"), CHANGED[how]
    state.write_bytes(change(state))
    not_resumed(run, stopped, told)


@pytest.mark.parametrize(("t", "text"), [(np.nan, "no run can continue"), (-5.0, "before the start")])
def test_a_time_that_makes_no_sense_is_refused(run, stopped: tuple[Path, Path], t: float, text: str) -> None:
    state = Path(f"{stopped[1]}.state")
    result = SimulationResult.load(state)
    replace(result, state=replace(result.state, t=t)).save(state)
    not_resumed(run, stopped, text)


def test_a_state_of_a_robot_with_other_numbers_is_refused(stopped: tuple[Path, Path]) -> None:
    ready = stage(stopped[0])
    other = hybridyn.load("five_bar", gravity=(0, 0, -1.62))
    result = SimulationResult.load(f"{stopped[1]}.state")
    assert (result.origin.robot, len(result.origin.digest), len(result.origin.scene)) == ("five_bar", 64, 64)
    for robot, words in ((other, "with other numbers"), (ready.robot, "is of a scene")):
        again = partial(hybridyn.simulate, robot, None, None, (0, 2), resume=result, effort=ready.effort)
        refused(again, hybridyn.TrajectoryError, words)


def test_a_checkpoint_of_a_killed_run_knows_its_scene(
    run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hybridyn.simulation.run.CHECKPOINT_STEPS", 2)
    saved: list[str] = []
    save = SimulationResult.save

    def watch(self: SimulationResult, path: str) -> None:
        save(self, path)
        saved.append(SimulationResult.load(path).origin.scene)

    monkeypatch.setattr(SimulationResult, "save", watch)
    run("simulate", written(tmp_path, "", SCENE.replace("2.0", "0.05")), "-o", tmp_path / "run.csv", "-q")
    assert len(saved) > 1
    assert len(saved[0]) == 64
    assert len(set(saved)) == 1


# ---------------------------------------------------------------- files that must stay


def test_simulate_does_not_replace_what_it_reads(run, tmp_path: Path) -> None:
    table = save(
        tmp_path, "time,m1_left_drive/effort,m1_right_drive/effort\n0,0,0\n2,0.1,0.2\n", "efforts.csv"
    )
    head = SCENE.partition("[controller]")[0]
    text = f'{head}[controller]\nkind = "efforts"\ntable = "efforts.csv"\n'
    before = table.read_bytes()
    link = tmp_path / "link.csv"
    link.symlink_to(table)
    for target in (table, link):
        run(
            "simulate",
            written(tmp_path, "[output]\nrate = 10.0\n", text),
            "-o",
            target,
            status=2,
            says="is read, and would be replaced",
        )
        assert table.read_bytes() == before
    run("simulate", written(tmp_path, '[output]\nfile = "efforts.csv"\n', text), status=2)
    assert table.read_bytes() == before


@pytest.mark.parametrize("name", ["../mine.csv", "{folder}/mine.csv", "door/mine.csv"])
def test_a_scene_replaces_nothing_outside_its_folder(run, tmp_path: Path, name: str) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "door").symlink_to(tmp_path)
    mine = save(tmp_path, "precious", "mine.csv")
    run(
        "simulate",
        written(inner, f'[output]\nfile = "{name.format(folder=tmp_path)}"\n'),
        status=1,
        says="outside the scene's folder",
    )
    assert mine.read_text() == "precious"


def test_a_state_file_is_not_written_through_a_link(run, tmp_path: Path) -> None:
    inner, mine = tmp_path / "inner", tmp_path / "mine"
    inner.mkdir()
    mine.write_text("precious")
    (inner / "run.csv.state").symlink_to(mine)
    run("simulate", written(inner, '[output]\nfile = "run.csv"\n'), status=2, says="run.csv.state' is a link")
    assert mine.read_text() == "precious"
    assert not (inner / "run.csv").exists()


# ---------------------------------------------------------------- full disks


def test_a_full_disk_leaves_no_part_of_a_state(
    stopped: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    state = Path(f"{stopped[1]}.state")
    result, before = SimulationResult.load(state), state.read_bytes()

    def full(file: object, **_: object) -> None:
        file.write(b"half")  # type: ignore[attr-defined]
        raise OSError(errno.ENOSPC, "No space left on device")

    around = {file.name for file in state.parent.iterdir()}
    monkeypatch.setattr(np, "savez", full)
    refused(lambda: result.save(state), OSError, r"No space left on device: .*run\.csv\.state")
    assert state.read_bytes() == before
    assert {file.name for file in state.parent.iterdir()} == around
