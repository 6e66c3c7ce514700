"""Compare exported control steps of drawn mechanisms with the general path, tick by tick."""

import contextlib
import ctypes
import os
import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np

import hybridyn
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.idle.motion import idle_motions
from hybridyn.compiled.export_reference import rates_read
from hybridyn.compiled.exporting import export
from hybridyn.compiled.programs.given_control import given_motion
from hybridyn.compiled.programs.whole_robot import programs
from hybridyn.manifold.manifold import Manifold
from hybridyn.structure.robot import joint_position
from tests.compiled.found import CLOSED, SOLVED, Found
from tests.compiled.test_export import compiler
from tests.compiled.test_given import Stepper, Task

TICKS = 8
#: What is given of a link, by the freedoms of its module.
GIVEN = {1: ("x", "y", "z"), 2: ("x y", "x z", "y z"), 3: ("x y z",), 6: ("",)}

States = tuple[np.ndarray, ...]


def compare_steps(robot: hybridyn.HybridRobot, q: np.ndarray, seed: int, case: str, found: Found) -> None:
    """Compare the control step from motors, and on a fixed base one from coordinates of a link."""
    task = task_of(robot, seed) if robot.base == "fixed" else None
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ):
        os.environ.pop("CC", None)
        export(robot, folder, name="m", given=task.columns if task else ())
        source, library = Path(folder) / "m.c", Path(folder) / "m.so"
        told = compiler("-O0", "-fPIC", "-shared", source, "-o", library, "-lm")
        loaded = ctypes.CDLL(str(library))
    assert told == ""
    from_motors(Stepper(robot, loaded.m_idm_from_motors), q, case, found)
    if task:
        from_given(Stepper(robot, loaded.m_idm_from_given), task, q, case, found)


def task_of(robot: hybridyn.HybridRobot, seed: int) -> Task | None:
    """Draw what is given: a link of a module, and the motors of the others; None if C takes none of it."""
    rng = np.random.default_rng([seed, 54])
    children = {joint.name: joint.child for joint in robot.description.joints}
    modules = [m for m in robot.modules if m.mobility in GIVEN and m.mechanism.spec.closures]
    for k in rng.permutation(len(modules)):
        module, others = modules[k], [m for m in robot.modules if m is not modules[k]]
        links = [children[joint] for joint in module.joints]
        for link in rng.permutation([x for x in links if "platform" in x] or links).tolist():
            task = Task(robot, link, str(rng.choice(GIVEN[module.mobility])))
            task.motors = tuple(motor for m in others for motor in m.motors)
            with contextlib.suppress(hybridyn.HybridynError):
                given_motion(robot, task.columns)
                return task
    return None


def from_motors(step: Stepper, q: np.ndarray, case: str, found: Found) -> None:
    """Compare ticks from positions of motors and rates of what they do not tell."""
    robot = step.robot
    read = rates_read(programs(robot, models=("close",))["close"])
    rng, last = np.random.default_rng(5), q.copy()
    position = np.array([float(joint_position(robot, q, x)) for x in robot.motors])
    for _ in range(TICKS):
        position = position + 0.01 * robot.unit[robot.motor_v] * rng.normal(size=len(position))
        given = last, position, *rng.normal(size=(2, robot.nv)) * robot.unit * (read > 0)
        state = ticked(step, given, "step", case, found)
        last = last if state is None else state[0]


def from_given(step: Stepper, task: Task, q: np.ndarray, case: str, found: Found) -> None:
    """Compare ticks from coordinates of a link; where no rod spins, their motion, too."""
    robot, rng, last = step.robot, np.random.default_rng(6), q.copy()
    spins = any(idle_motions(m.mechanism, m.motor_columns) for m in robot.modules)
    for _ in range(TICKS):
        levels = task.next(rng, last)
        state = ticked(step, (last, *levels), "given step", case, found)
        if state is None:
            continue
        if not spins:
            for x, right in zip(state, task.judge(last, levels), strict=True):
                found.compare("given motion", case, x, right, SOLVED)
        last = state[0]


def ticked(step: Stepper, given: States, what: str, case: str, found: Found) -> States | None:
    """Run a tick; compare its efforts at the motion that it found, whose loops must be closed."""
    guard, (*state, tau) = step(*given)
    if not guard <= GUARD_LIMIT:
        found.count[f"{what}s not trusted"] += 1
        return None
    try:
        wanted = hybridyn.idm(step.robot, *state)
    except hybridyn.HybridynError as error:
        found.wrong.append(f"{case}: {what}: {error}")
        return None
    found.compare(what, case, tau, wanted, SOLVED)
    found.add(f"{what} closes", case, Manifold(step.robot).residual(state[0])[0], CLOSED)
    return tuple(state)
