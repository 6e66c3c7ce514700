"""Runs of generated mechanisms: accelerations, energy, stopped and resumed runs, changed state files.

A case is one run, or one mutated state file. A state file that was changed is refused in one line.
"""

from __future__ import annotations

import random
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.residual import closure_residual
from hybridyn.errors import HybridynError
from hybridyn.simulation.result import Result
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.generated import Case, State, generated
from tests.generated_judge import condition, natural_acceleration
from tests.waiting import must_end

STEP = 1e-3  # of the runs [s]
CLOSED = 1e-10  # the project's claim on closures
FORWARD = 1e-12  # of the condition number
ENERGY = 1e-8  # of what is exchanged: a step's error is its fifth power
BITS = ("t", "q", "v", "a", "tau", "kinetic", "potential", "residual", "pivot")


@lru_cache(maxsize=1)
def run_of(seed: int, freedoms: int) -> tuple[Case, State, HybridRobot, Result]:
    """Return a mechanism that moved two steps from its home under constant efforts."""
    case = generated(seed, freedoms)
    state = case.states(1)[0]
    robot = build_robot(case.description, base=case.base)
    return case, state, robot, moved(case, state, robot, 2)


def moved(case: Case, state: State, robot: HybridRobot, steps: int, **options: object) -> Result:
    """Simulate so many steps; a base that is prescribed rests."""
    v, more = state.v.copy(), {}
    if case.base == "moving":
        v = case.oracle.project_velocity(state.q, np.concatenate([np.zeros(6), v[6:]]))
        pose, rest = state.q[:7].copy(), np.zeros(6)
        more = {"base_motion": lambda t: (pose, rest, rest)}
    return hybridyn.simulate(
        robot, state.q, v, (0.0, steps * STEP), method="rk4", step=STEP, effort=state.tau, **more, **options
    )  # type: ignore[arg-type]


def judge_run(seed: int, freedoms: int) -> None:
    """Check one run by the oracle and by its energy, and against a run that stopped in between."""
    case, state, robot, run = run_of(seed, freedoms)
    assert run.status == "finished", run.message
    assert closure_residual(robot, run.q).max() <= CLOSED
    q, v, a = run.q[-1], run.v[-1], run.a[-1]
    wanted = case.oracle.ddm(q, v, state.tau)
    unit = case.oracle.unit
    size = np.abs(wanted / unit).max() + natural_acceleration(case, v[None])[0]
    off = np.abs((a - wanted) / unit).max() / size
    assert off <= FORWARD * condition(case, q), f"accelerations differ by {off:.1e}"
    work = np.trapezoid(np.sum(run.tau * run.v[:, case.oracle.motors], axis=1), run.t)
    gained = run.energy[-1] - run.energy[0]
    exchanged = np.abs(run.tau * run.v[:, case.oracle.motors]).sum() * STEP + np.ptp(run.kinetic)
    curved = (
        (size * STEP) * np.abs(run.tau).sum() * np.abs(v / unit).max(initial=1.0) * STEP
    )  # of the trapezoids
    assert abs(gained - work) <= ENERGY * (exchanged + np.abs(run.energy).max()) + curved, "energy is lost"
    half = moved(case, state, robot, 1)
    again = moved(case, state, robot, 2, resume=half)
    assert all(getattr(again, name).tobytes() == getattr(run, name).tobytes() for name in BITS)


def judge_runs(first: int, count: int, freedoms: int) -> None:
    for seed in range(first, first + count):
        with must_end(f"seed {seed}"):
            try:
                judge_run(seed, freedoms)
            except (AssertionError, HybridynError) as error:
                pytest.fail(f"seed {seed}, {freedoms} freedoms: {error}")


def test_runs() -> None:
    judge_runs(0, 8, 4)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(20))
def test_many_runs(block: int) -> None:
    judge_runs(1000 + 50 * block, 50, 9)


# -------------------------------------------------------------------- state files


def mutated(data: bytes, draw: random.Random) -> bytes:
    """Change a file's bytes: one, some, cut, doubled, zeroed, or moved."""
    raw = bytearray(data)
    start, size = draw.randrange(len(raw)), draw.choice([1, 2, 8, 64, 1000])
    kind = draw.randrange(6)
    if kind == 0:
        raw[start] ^= 1 << draw.randrange(8)
    elif kind == 1:
        raw[start : start + size] = draw.randbytes(len(raw[start : start + size]))
    elif kind == 2:
        del raw[start : start + size]
    elif kind == 3:
        raw[start:start] = raw[start : start + size]
    elif kind == 4:
        raw[start : start + size] = bytes(len(raw[start : start + size]))
    else:
        return bytes(raw[:start])
    return bytes(raw)


def read_or_refused(path: Path) -> Result | str:
    """Return a result, or why its file is refused."""
    try:
        return Result.load(path)
    except HybridynError as error:
        return str(error)


def judge_state_files(folder: Path, first: int, count: int) -> int:
    """Resume from mutated state files; return how many were refused."""
    case, state, robot, _ = run_of(3, 4)
    whole = moved(case, state, robot, 1)
    path, refused = folder / "run.state", 0
    whole.save(path)
    data = path.read_bytes()
    for number in range(first, first + count):
        draw = random.Random(f"state {number}")
        changed = mutated(data, draw)
        path.write_bytes(changed)
        with must_end(f"state file {number}"):
            found = read_or_refused(path)
        if isinstance(found, str):
            assert "\n" not in found, number
            assert str(path) in found, number
            assert path.read_bytes() == changed
            refused += 1
            continue
        # bytes that hold no content, such as dates in the archive
        assert all(getattr(found, name).tobytes() == getattr(whole, name).tobytes() for name in BITS), number
        assert found.state.v.tobytes() == whole.state.v.tobytes(), number
    return refused


def test_changed_state_files(tmp_path: Path) -> None:
    assert judge_state_files(tmp_path, 0, 480) > 360


@pytest.mark.slow
@pytest.mark.parametrize("block", range(4))
def test_many_changed_state_files(tmp_path: Path, block: int) -> None:
    assert judge_state_files(tmp_path, 1000 + 2500 * block, 2500) > 2000
