"""Scenes with absurd numbers and state files with changed bytes: one line, or a result; never a hang.

Seeded. The robot is a plain URDF, so that a run takes little.
"""

from __future__ import annotations

import random
import re
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import HybridynError
from hybridyn.simulation.result import Result
from tests.command_line import call
from tests.robot_texts import door, save
from tests.waiting import must_end

SCENE = """duration = 0.02
[robot]
file = "door.urdf"
gravity = [0.0, 0.1, -9.81]
[initial]
joints = { hinge = 0.3 }
[initial.rates]
joints = { hinge = -1.0 }
[solver]
method = "dopri5"
rtol = 1e-8
atol = 1e-9
[output]
rate = 100.0
"""
ABSURD = (
    "0", "-1", "1e300", "-1e300", "1e-320", "2e9", "1e15", "nan", "inf", "-inf", "1e-12", "true", '"0.1"',
    "[]", "9" * 40,
)  # fmt: skip
NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(e-?\d+)?(?![\w.])")
METHODS = ("dopri5", "rk4", "conserving", "implicit")


def absurd(draw: random.Random) -> str:
    """Replace one or two numbers of the scene by others, and perhaps its method."""
    text = SCENE.replace("dopri5", draw.choice(METHODS))
    if "dopri5" not in text and "implicit" not in text:
        text = text.replace("rtol = 1e-8\natol = 1e-9", "step = 0.01")
    for _ in range(draw.choice([1, 1, 2])):
        at = draw.choice([*NUMBER.finditer(text)])
        text = text[: at.start()] + draw.choice(ABSURD) + text[at.end() :]
    return text


def run_scenes(folder: Path, capsys: pytest.CaptureFixture[str], count: int, seed: int) -> int:
    """Run so many scenes; say how many came to an end of their own."""
    save(folder, door(2), "door.urdf")
    draw, through = random.Random(seed), 0
    for number in range(count):
        text = absurd(draw)
        scene, target = folder / "scene.toml", folder / "run.csv"
        scene.write_text(text)
        target.unlink(missing_ok=True)
        case = f"seed {seed}, case {number}:\n{text}"
        with must_end(case), np.errstate(all="ignore"):
            said = call(capsys, "simulate", scene, "-o", target, "-q", "--engine", "general")
        assert "bug" not in said.err, (case, said.err)
        assert said.status in (0, 1), case
        if not target.exists():
            assert (said.status, said.err.count("\n")) == (1, 1), (case, said.err)
        through += said.status == 0
    return through


def test_absurd_numbers_in_scenes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert 0 < run_scenes(tmp_path, capsys, 40, 0) < 40


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 11))
def test_more_absurd_numbers_in_scenes(seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert 0 < run_scenes(tmp_path, capsys, 200, seed) < 200


def loaded(state: Path) -> Result | str:
    """Return a state file's result, or what is said against it."""
    try:
        return Result.load(state)
    except HybridynError as error:
        return str(error)


@pytest.mark.parametrize(("seed", "count"), [(0, 300), pytest.param(1, 20_000, marks=pytest.mark.slow)])
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
        with must_end(case):
            found = loaded(state)
        if isinstance(found, str):
            assert "\n" not in found, case
            refused += 1
            continue
        for name in ("t", "q", "v", "a", "tau", "residual"):
            assert getattr(found, name).tobytes() == getattr(result, name).tobytes(), case
    assert refused > 0.9 * count
