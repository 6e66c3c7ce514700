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
from benchmarks.accuracy import SETTINGS
from benchmarks.cases import case_of, stack_motion
from benchmarks.peers import METHODS
from benchmarks.peers.ours import COMPILED, GENERAL, SINGLE, compiled
from benchmarks.reference import round_trip, round_trip_limit
from benchmarks.results import CHECK, NAN, Row
from benchmarks.timing import MIB, forget_peak, in_own_process, interleaved, memory, timed
from hybridyn import HybridRobot
from hybridyn.assembly.chain.places import motion_of
from hybridyn.description.cache_folder import VARIABLE
from hybridyn.spatial import Array, quaternion_from_rotation
from hybridyn.studies.compare.methods import written
from hybridyn.studies.compare.peer_engine import NotComparableError

BATCH = 500
ROUNDS = 3
#: Rows of a tool's path after the first, and how far they are from one another [m].
TOOL_ROWS, TOOL_STEP = 20, 1e-3
#: For one point, compilation included [s].
PATIENCE = 900.0


class Line(NamedTuple):
    """A line of the figure."""

    model: str
    method: str
    batch: int


def lines(only: tuple[str, ...] = ()) -> Iterator[Line]:
    """Give every method, one sample per call, and in batches where it takes them; or some of one model."""
    if not only:  # into an empty cache; what is built serves the other points
        yield Line("compile", COMPILED, 1)
        yield Line("assemble", GENERAL, BATCH)
    for method in METHODS:
        left_out = ("pin.aba", "pin.rnea", SINGLE)
        if method.name not in left_out and (
            not only or (method.model, method.name) in {("ddm", x) for x in only}
        ):
            yield Line(method.model, method.name, 1)
            if method.batches:
                yield Line(method.model, method.name, BATCH)


def measure(family: str, modules: int, samples: int = BATCH, only: tuple[str, ...] = ()) -> list[Row]:
    """Measure all methods on one robot, or only the direct model by some."""
    case = f"{family} {modules}"
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, {VARIABLE: folder}):
        motion = Path(folder) / "motion.npz"
        error, nv = in_own_process(write_motion, case, samples, motion)
        what = "ddm(idm(a)) against a"
        out = [Row(case, CHECK, setting=what, error=error, limit=round_trip_limit(modules))]
        sizes = {method.name: method for method in METHODS}
        for line in lines(only):
            line = line._replace(batch=min(line.batch, samples))
            us, mib, note = NAN, NAN, ""
            try:
                if line.model != "assemble":
                    sizes[line.method].check_size(nv)
                us, mib = in_own_process(point, case, line, motion, patience=PATIENCE)
            except NotComparableError as why:
                note = str(why)
            setting = written(SETTINGS.get(line.method, {}))
            name = f"{line.method}, {setting}" if setting else line.method
            row = Row(family, line.model, name, at=modules, batch=line.batch)
            out.append(row._replace(us=us, mib=mib, note=note))
    return out


def tools(modules: int, rows: int = TOOL_ROWS) -> list[Row]:
    """Measure rows of poses of the outermost platform of a stack in its root [us of processor time]."""
    robot = case_of(f"stack {modules}").load()
    platforms = {link: tuple(x[0] for x in levels) for link, levels in stack_motion(modules, 8).items()}
    q, still = hybridyn.assemble(robot, platforms=platforms)[0], np.zeros((1, robot.nv))
    link = robot.modules[-1].outputs[0]
    start = motion_of(robot, link, (q[None], still, still))
    poses = np.tile(np.concatenate([start.p, quaternion_from_rotation(start.R)], axis=1), (rows + 1, 1))
    poses[:, 0] += TOOL_STEP * np.arange(rows + 1)

    def call(count: int) -> Callable[[], object]:
        return lambda: hybridyn.assemble(robot, guess=q, platforms={link: poses[:count]})

    first, all_rows = (
        min(timed(call(count), 1, time.process_time) for _ in range(ROUNDS)) for count in (1, rows + 1)
    )
    row = Row("stack", "assemble", GENERAL, "a row of a tool's pose", at=modules, batch=rows)
    return [row._replace(us=1e6 * (all_rows - first) / rows)]


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


def point(case: str, line: Line, path: Path) -> tuple[float, float]:
    """Return time per sample [us], and what the process grew by from the loaded robot on [MiB].

    Raises:
        NotComparableError: The method cannot do this robot.
    """
    robot = case_of(case).load()
    with np.load(path) as file:
        q, v, a, tau = (file[name][: line.batch] for name in ("q", "v", "a", "tau"))
    before = memory("VmRSS")
    forget_peak()
    if line.model == "compile":
        least = timed(lambda: compiled(robot), 1)
    else:
        (least, _) = interleaved([_call(robot, line, (q, v, a, tau))], ROUNDS)[0]
    return 1e6 * least / line.batch, (memory("VmHWM") - before) / MIB


def _call(robot: HybridRobot, line: Line, motion: tuple[Array, Array, Array, Array]) -> Callable[[], object]:
    """Return the call of a line."""
    q, v, a, tau = motion
    if line.model == "assemble" and robot.name == "lx4":
        poses = stack_motion(len(robot.modules), line.batch)
        return lambda: hybridyn.assemble(robot, guess=q[0], platforms=poses)
    if line.model == "assemble":
        motors = q[:, robot.motor_q], v[:, robot.motor_v], a[:, robot.motor_v]
        return lambda: hybridyn.assemble(robot, guess=q[0], motors=motors)
    method = next(m for m in METHODS if (m.model, m.name) == (line.model, line.method))
    solve = method.prepare(robot)(SETTINGS.get(line.method, {}))
    given = a if line.model == "idm" else tau
    if line.batch == 1:
        q, v, given = q[0], v[0], given[0]
    return lambda: solve(q, v, given)
