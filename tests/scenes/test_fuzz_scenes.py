"""Scenes with absurd numbers and state files with changed bytes: one line, or a result; never a hang.

Seeded: one to three numbers of a small scene are replaced. A scene is refused in one line, which names the
file, or its first steps are taken, and no number of them is infinite.
"""

import random
import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.scenes.stage import SceneStage, play, stage
from hybridyn.simulation.result import SimulationResult
from tests.robots.robot_texts import door, save
from tests.support.samples import fuzz, slow
from tests.support.waiting import outcome

ABSURD = (
    "nan", "inf", "-inf", "1e300", "-1e300", "1e-300", "5e-324", "1e155", "-1.0", "0", "-0.0", "1e9", "1e18",
    "1e-18", "9" * 30, "true", '"1"', "[]", "{}", "1e999", "0x10",
)  # fmt: skip
HEAD = """duration = 0.002
[robot]
file = "door.urdf"
gravity = [0.1, 0.0, -9.81]
base = "BASE"
"""
START = """[initial]
joints = { hinge = 0.3 }
[initial.rates]
joints = { hinge = 0.4 }
"""
CONTROLLERS = (
    '[controller]\nkind = "efforts"\nefforts = { hinge = 0.5 }\n',
    '[controller]\nkind = "pd"\nkp = 20.0\nkd = 1.0\n'
    "reference = { points = [{ time = 0.4, joints = { hinge = 0.1 } }] }\n",
    '[controller]\nkind = "computed_torque"\nkp = 20.0\nkd = 1.0\n'
    "reference = { points = [{ time = 0.4, joints = { hinge = 0.1 } }] }\n",
    "[motion]\npoints = [{ time = 0.0, joints = { hinge = 0.3 } }, "
    "{ time = 0.4, joints = { hinge = 0.1 } }]\n",
)
EFFECTS = (
    "",
    "[effects.damper]\ncoefficient = { hinge = 0.02 }\n",
    "[effects.coulomb_friction]\nlevel = { hinge = 0.2 }\nwidth = 0.01\n",
    "[effects.stop]\nstiffness = { hinge = 100.0 }\ndamping = 1.0\nupper = { hinge = 0.2 }\n",
    '[[effects.payload]]\nlink = "leaf"\nmass = 0.5\ncom = [0.1, 0.2, 0.3]\n',
    '[[effects.wrench]]\nlink = "leaf"\nwrench = [0.1, 0.2, 0.3, 1.0, 2.0, 3.0]\n',
    "[effects.spring]\nstiffness = { hinge = 3.0 }\nrest = { hinge = 0.1 }\n",
)
SOLVERS = (
    "",
    "[solver]\nrtol = 1e-6\natol = 1e-8\n",
    '[solver]\nmethod = "rk4"\nstep = 0.001\n',
    '[solver]\nmethod = "implicit"\nstep = 0.001\n',
    '[solver]\nmethod = "conserving"\nstep = 0.001\n',
)
OUTPUTS = ("", "[output]\nrate = 1000.0\n")
EVENTS = ("", '[[events]]\njoint = "hinge"\nat = 0.31\n', '[[events]]\nlink = "leaf"\nat = 0.2\n')
STEPS = 2


def scene(number: int) -> str:
    """Draw a scene, and replace some of its numbers."""
    draw = random.Random(f"scene {number}")
    head = HEAD.replace("BASE", draw.choice(["fixed", "fixed", "floating"]))
    parts = (CONTROLLERS, EFFECTS, SOLVERS, OUTPUTS, EVENTS)
    text = head + draw.choice(["", START]) + "".join(draw.choice(part) for part in parts)
    for _ in range(draw.choice([1, 1, 2, 3])):
        numbers = list(re.finditer(r"(?<![\w.\"])-?\d+\.\d+|(?<== )1e-\d", text))
        found = draw.choice(numbers)
        text = text[: found.start()] + draw.choice(ABSURD) + text[found.end() :]
    return text


def begin(ready: SceneStage) -> SimulationResult:
    """Play a scene's first steps."""
    steps: list[float] = []

    def progress(t: float, end: float) -> None:
        steps.append(t)
        if len(steps) >= STEPS:
            raise KeyboardInterrupt

    return play(ready, progress=progress)


def ran_finite(case: str, run: Callable[[], SimulationResult], named: str = "") -> bool:
    """Run a scene; say whether it was not refused, in words that hold a name. Its numbers must be finite."""
    result, said = outcome(case, run)
    if result is None:
        assert named in said, f"{case}: {said}"
        return False
    for name in ("t", "q", "v", "a", "tau", "kinetic", "potential"):
        assert np.isfinite(getattr(result, name)).all(), f"{case}: {name} is not finite"
    return True


def played(
    folder: Path,
    numbers: range,
    scene: Callable[[int], str],
    run: Callable[[SceneStage], SimulationResult] = play,
    named: str = "",
) -> int:
    """Play scenes; return how many were not refused."""
    save(folder, door(2), "door.urdf")
    path, through = folder / "scene.toml", 0
    for number in numbers:
        path.write_text(scene(number))
        through += ran_finite(f"scene {number}\n{path.read_text()}", lambda: run(stage(path)), named)
    return through


@pytest.fixture
def load_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Load each robot with each base and gravity once."""
    kept = lru_cache(lambda *asked: hybridyn.load(asked[0], **dict(asked[1:])))

    def load(file: str, **options: object) -> hybridyn.HybridRobot:
        said = {name: value for name, value in options.items() if name in ("base", "gravity", "motors")}
        return kept(file, *said.items())

    monkeypatch.setattr("hybridyn.scenes.stage.load", load)


@pytest.mark.usefixtures("load_once")
@pytest.mark.parametrize(
    ("first", "count"), [(0, 10), slow(1000, 500), *(fuzz(1000 + 500 * block, 500) for block in range(1, 16))]
)
def test_absurd_numbers(tmp_path: Path, first: int, count: int) -> None:
    assert 0 < played(tmp_path, range(first, first + count), scene, begin, "scene.toml") < 0.6 * count


# -------------------------------------------------------------------- state files


@pytest.mark.parametrize(("seed", "count"), [(0, 200), pytest.param(1, 20_000, marks=pytest.mark.slow)])
def test_changed_bytes_of_a_state_file(seed: int, count: int, tmp_path: Path) -> None:
    """Refused, or the same bits: what lies between an archive's members has no meaning."""
    robot = hybridyn.load(save(tmp_path, door(1), "door.urdf"))
    result = hybridyn.simulate(robot, np.array([0.3]), np.array([-1.0]), (0, 0.02))
    state, draw, refused = tmp_path / "state.npz", random.Random(seed), 0
    result.save(state)
    data = state.read_bytes()
    for number in range(count):
        at = draw.randrange(len(data))
        changed = draw.choice(
            [
                data[:at] + bytes([data[at] ^ (1 << draw.randrange(8))]) + data[at + 1 :],
                data[:at],
                data[:at] + draw.randbytes(draw.randrange(1, 9)) + data[at:],
                data[:at] + data[at + draw.randrange(1, 99) :],
            ]
        )
        state.write_bytes(changed)
        case = f"seed {seed}, case {number}"
        found, _ = outcome(case, lambda: SimulationResult.load(state))
        if found is None:
            refused += 1
            continue
        for name in ("t", "q", "v", "a", "tau", "residual"):
            assert getattr(found, name).tobytes() == getattr(result, name).tobytes(), case
    assert refused > 0.9 * count
