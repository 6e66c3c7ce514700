"""Time and memory against the number of modules. Every point runs in a process of its own."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

import hybridyn
from benchmarks.cases import case_of, stack_motion
from benchmarks.gate import round_trip, round_trip_limit
from benchmarks.methods import Method, NotMeasuredError, Setting, written
from benchmarks.peers import METHODS
from benchmarks.peers.ours import COMPILED, GENERAL, SINGLE, compiled
from benchmarks.processes import MIB, forget_peak, in_own_process, peak, resident
from benchmarks.results import CHECK, NAN, Row
from benchmarks.timing import interleaved
from hybridyn import HybridRobot
from hybridyn.description.cache_folder import VARIABLE
from hybridyn.spatial import Array

BATCH = 500
ROUNDS = 3
#: For one point, compilation included [s].
PATIENCE = 900.0
#: One setting for each peer that is swept: what reaches 1e-10 up to 16 modules, or comes nearest.
SETTINGS: dict[str, Setting] = {
    "pin.constraintDynamics": {"mu": 1e-8, "iterations": 2},
    "pin.lcaba": {"mu": 1e-2, "iterations": 10},
    "MuJoCo": {"impedance": 0.9999, "iterations": 5},
}


class Line(NamedTuple):
    """A line of the figure."""

    model: str
    method: str
    batch: int


def lines() -> Iterator[Line]:
    """Give every method, one sample per call, and in batches where it takes them."""
    for method in METHODS:
        if method.name in ("pin.aba", "pin.rnea", SINGLE):
            continue
        yield Line(method.model, method.name, 1)
        if method.batches:
            yield Line(method.model, method.name, BATCH)
    yield Line("assemble", GENERAL, BATCH)


def measure(family: str, modules: int, samples: int = BATCH, only: tuple[str, ...] = ()) -> list[Row]:
    """Measure all methods on one robot, or only the direct model by some."""
    case = f"{family} {modules}"
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, {VARIABLE: folder}):
        motion = Path(folder) / "motion.npz"
        error, nv = in_own_process(write_motion, case, samples, motion)
        what = "ddm(idm(a)) against a"
        out = [Row(case, CHECK, setting=what, error=error, limit=round_trip_limit(modules))]
        jobs: list[tuple[Line, Callable[..., tuple[float, float]], tuple[object, ...]]] = []
        if not only:  # into an empty cache; what is built serves the other points
            jobs.append((Line("compile", COMPILED, 1), compilation, (case,)))
        for line in lines():
            if not only or (line.model == "ddm" and line.method in only):
                line = line._replace(batch=min(line.batch, samples))
                jobs.append((line, point, (case, line, motion)))
        for line, task, arguments in jobs:
            us, mib, note = NAN, NAN, ""
            try:
                if line.model != "assemble":
                    _method(line).check_size(nv)
                us, mib = in_own_process(task, *arguments, patience=PATIENCE)
            except NotMeasuredError as why:
                note = str(why)
            setting = written(SETTINGS.get(line.method, {}))
            name = f"{line.method}, {setting}" if setting else line.method
            row = Row(family, line.model, name, at=modules, batch=line.batch)
            out.append(row._replace(us=us, mib=mib, note=note))
    return out


def write_motion(case: str, samples: int, path: Path) -> tuple[float, int]:
    """Write states and efforts of a robot's motion; give how well the models invert each other, and nv.

    Raises:
        WrongModelError: They do not.
    """
    own = case_of(case)
    robot = own.load()
    q, v, a = own.states(robot, samples)
    np.savez(path, q=q, v=v, a=a, tau=hybridyn.idm(robot, q, v, a))
    return round_trip(robot, q[:8], v[:8], a[:8]), robot.nv


def compilation(case: str) -> tuple[float, float]:
    """Return the time [us] and the memory [MiB] of compiling a robot.

    Raises:
        NotMeasuredError: It cannot be.
    """
    robot = case_of(case).load()
    before = resident()
    forget_peak()
    started = time.perf_counter()
    compiled(robot)
    return 1e6 * (time.perf_counter() - started), (peak() - before) / MIB


def point(case: str, line: Line, path: Path) -> tuple[float, float]:
    """Return time per sample [us], and what the process grew by from the loaded robot on [MiB].

    Raises:
        NotMeasuredError: The method cannot do this robot.
    """
    robot = case_of(case).load()
    with np.load(path) as file:
        q, v, a, tau = (file[name][: line.batch] for name in ("q", "v", "a", "tau"))
    before = resident()
    forget_peak()
    (least, _) = interleaved([_call(robot, line, (q, v, a, tau))], ROUNDS)[0]
    return 1e6 * least / line.batch, (peak() - before) / MIB


def _call(robot: HybridRobot, line: Line, motion: tuple[Array, Array, Array, Array]) -> Callable[[], object]:
    """Return the call of a line."""
    q, v, a, tau = motion
    if line.model == "assemble":
        target = (
            stack_motion(len(robot.modules), line.batch) if robot.name == "lx4" else _motors(robot, q, v, a)
        )
        kind = "platforms" if robot.name == "lx4" else "motors"
        return lambda: hybridyn.assemble(robot, guess=q[0], **{kind: target})
    solve = _method(line).prepare(robot)(SETTINGS.get(line.method, {}))
    given = a if line.model == "idm" else tau
    if line.batch == 1:
        q, v, given = q[0], v[0], given[0]
    return lambda: solve(q, v, given)


def _method(line: Line) -> Method:
    """Return the method of a line; what is compiled serves both models."""
    model = "ddm" if line.model == "compile" else line.model
    return next(m for m in METHODS if (m.model, m.name) == (model, line.method))


def _motors(robot: HybridRobot, q: Array, v: Array, a: Array) -> dict[str, tuple[Array, Array, Array]]:
    """Return the motors' part of a motion, sliding motors only."""
    out = {}
    for name in robot.motors:
        k = robot.joint_index[name]
        at_q, at_v = robot.q_slices[k].start, robot.v_slices[k].start
        out[name] = (q[:, at_q], v[:, at_v], a[:, at_v])
    return out
