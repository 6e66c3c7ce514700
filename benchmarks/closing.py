"""Loops closed in C: one control step, and rows of a table, beside the inverse model of the same robot.

A step closes the loops from the motors' positions, rates and accelerations and the posture before, and
computes the efforts, in two calls from Python or in one. A step "in C" is the processor time of the C
function that takes it, with the 0.1 us of a loop of Python around it. Rows are those of a table of motors
and, for robots whose platforms have six freedoms, of poses.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

import hybridyn
from benchmarks.results import Row
from benchmarks.timing import interleaved
from hybridyn import HybridRobot
from hybridyn.assembly.chain.places import motion_of
from hybridyn.compiled.model import CompiledRobot
from hybridyn.compiled.programs.closing.platform_program import platform_motions, posed_modules
from hybridyn.spatial import Array, quaternion_from_rotation

#: Time between two ticks [s], amplitude [rad, m] and number of steps, of which percentiles are given.
TICK, SIZE, STEPS = 1e-3, 0.03, 1_000_000
#: Rows of a table, and how often they are measured.
ROWS, ROUNDS = 2_000, 5
PERCENTILES = {"least": 0.0, "median": 50.0, "90 %": 90.0, "99 %": 99.0, "99.9 %": 99.9}

Motors = tuple[Array, Array, Array]


def measure(case: str, compiled: CompiledRobot, count: int = STEPS) -> Iterator[Row]:
    """Yield what was measured of a robot [us].

    Args:
        case: Its name.
        compiled: Its model.
        count: Number of steps from Python.
    """
    motors = ticks(compiled.robot)
    row = Row(case, unit="us")
    for what, times in steps(compiled, motors, count).items():
        for words, share in PERCENTILES.items():
            us = float(np.percentile(times, share))
            yield row._replace(model=what, setting=f"from Python, {words}", value=us)
    yield row._replace(model="control step", setting="in C", value=step_alone(compiled, motors))
    for what, call in tables(compiled, motors):
        ((least, _),) = interleaved([call], ROUNDS)
        yield row._replace(model="assemble", setting=what, value=1e6 * least / ROWS)
    if pair := tool_and_platforms(compiled, motors):
        (tool, _), (platforms, _) = interleaved(pair, ROUNDS)
        yield row._replace(model="assemble", setting="a row of a tool's pose, in C", value=1e6 * tool / ROWS)
        setting = "a tool's pose over all platforms' poses, in C"
        yield row._replace(model="assemble", setting=setting, unit="", value=tool / platforms)


def ticks(robot: HybridRobot) -> Motors:
    """Return positions, rates and accelerations of the motors at `ROWS` ticks."""
    at = [robot.q_slices[robot.joint_index[motor]] for motor in robot.motors]
    home: Array = np.array(
        [np.arctan2(*x[::-1]) if len(x) > 1 else x[0] for x in (robot.home[s] for s in at)]
    )
    w: Array = 2.0 + 0.1 * np.arange(len(home), dtype=float)
    phase: Array = np.outer(TICK * np.arange(ROWS), w)
    sine: Array = np.sin(phase)
    cosine: Array = np.cos(phase)
    return home + SIZE * sine, SIZE * w * cosine, -SIZE * w * w * sine


def steps(compiled: CompiledRobot, motors: Motors, count: int) -> dict[str, Array]:
    """Return times of `idm`, of closing the loops, of both, of a step in one call, shapes (count,), [us]."""
    there = [[x[i] for i in [*range(ROWS), *reversed(range(ROWS))]] for x in motors]
    q = compiled.close(*(x[0] for x in there))[0]
    closing, inverse, step = np.empty(count), np.empty(count), np.empty(count)
    for i in range(count):
        position, rate, acceleration = (x[i % (2 * ROWS)] for x in there)
        start = time.perf_counter()
        q, v, a = compiled.close(position, rate, acceleration, last=q)
        between = time.perf_counter()
        compiled.idm(q, v, a)
        end = time.perf_counter()
        closing[i], inverse[i] = 1e6 * (between - start), 1e6 * (end - between)
    q = compiled.idm_from_motors(*(x[0] for x in there))[1]
    for i in range(count):
        position, rate, acceleration = (x[i % (2 * ROWS)] for x in there)
        start = time.perf_counter()
        q = compiled.idm_from_motors(position, rate, acceleration, last=q)[1]
        step[i] = 1e6 * (time.perf_counter() - start)
    return {
        "idm, a call": inverse,
        "close": closing,
        "close, then idm": closing + inverse,
        "control step": step,
    }


def step_alone(compiled: CompiledRobot, motors: Motors) -> float:
    """Return the least processor time of the C function that takes a control step [us]."""
    nq, least = compiled.robot.nq, float("inf")
    out = np.empty(nq + 2 * compiled.robot.nv + len(compiled.robot.motors))
    last, ticks = out[:nq], [tuple(x[i] for x in motors) for i in range(ROWS)]
    for _ in range(4 * ROUNDS):
        last[:] = compiled.idm_from_motors(*ticks[0])[1]
        call = compiled._models.control_at_once
        start, refused = time.process_time(), 0
        for position, rate, acceleration in ticks:
            refused += call(last, position, rate, acceleration, out)
        if not refused:
            least = min(least, time.process_time() - start)
    return 1e6 * least / ROWS


def tables(compiled: CompiledRobot, motors: Motors) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield calls that assemble `ROWS` rows, from motors and from poses, in C and by the general path."""
    robot = compiled.robot
    named = {name: tuple(x[:, i] for x in motors) for i, name in enumerate(robot.motors)}
    yield "a row of motors, in C", lambda: compiled.assemble(motors=named)
    yield "a row of motors, general", lambda: hybridyn.assemble(robot, motors=named)
    if not (poses := platforms(robot, compiled.assemble(motors=named))):
        return
    yield "a row of poses, in C", lambda: compiled.assemble(platforms=poses)
    yield "a row of poses, general", lambda: hybridyn.assemble(robot, platforms=poses)


def platforms(robot: HybridRobot, states: Motors) -> dict[str, Motors]:
    """Return the poses of all platforms in states, each in its base; none if they do not suffice."""
    posed = posed_modules(robot)
    if len(posed) < len(robot.modules):
        return {}
    pose, twist, change = platform_motions(robot, *states).values()
    return {
        f"{robot.modules[k].outputs[0]}@{robot.modules[k].base}": (
            pose[:, 7 * i : 7 * i + 7],
            twist[:, 6 * i : 6 * i + 6],
            change[:, 6 * i : 6 * i + 6],
        )
        for i, k in enumerate(posed)
    }


def tool_and_platforms(compiled: CompiledRobot, motors: Motors) -> list[Callable[[], object]]:
    """Return calls that assemble the same rows from the pose of a stack's last platform, and from all."""
    robot = compiled.robot
    named = {name: tuple(x[:, i] for x in motors) for i, name in enumerate(robot.motors)}
    if len(robot.modules) < 2 or len(posed_modules(robot)) < len(robot.modules):
        return []
    tool = robot.modules[-1].outputs[0]
    motion = motion_of(robot, tool, compiled.assemble(motors=named))
    pose = np.concatenate([motion.p, quaternion_from_rotation(motion.R)], axis=1)
    twist = np.concatenate([motion.p_dot, motion.w], axis=1)
    own = {tool: (pose, twist, np.concatenate([motion.p_ddot, motion.w_dot], axis=1))}
    every = platforms(robot, compiled.assemble(platforms=own))
    return [lambda: compiled.assemble(platforms=own), lambda: compiled.assemble(platforms=every)]
