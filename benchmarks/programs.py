"""What a user's program waits for around the models: steps of controllers, the command line, a cold start.

Times are processor times of this process or of the programs that it starts, the least of several, so that
what else runs on the machine counts little. A cold start is wall time, because it builds in two processes.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import hybridyn
from benchmarks import closing
from benchmarks.cases import LX4, case_of, write_long_trajectory
from benchmarks.operations import flattened
from benchmarks.results import NAN, Row
from benchmarks.simulation import KD, KP
from benchmarks.timing import only_cores, spent, timed
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.model import CompiledRobot
from hybridyn.compiled.programs.inverse import inverse_program
from hybridyn.description.cache_folder import VARIABLE
from hybridyn.effects.choice import choose
from hybridyn.scenes.controllers import ComputedTorque, Pd
from hybridyn.scenes.references import MotorAxes, RestPosture, from_points
from hybridyn.spatial import Array
from hybridyn.studies.compare.peer_engine import NotComparableError

#: Robots that are measured.
ROBOTS = ("five_bar", "gough_stewart", "delta", "tanev", "lx4")
#: What is said of a guard.
GUARD = "operations with the guard over those without"
#: Step [s], number of steps and way of the motors [rad, m] of a controlled run.
STEP, STEPS, MOVE = 1e-5, 5_000, 0.002
#: Stages of an RK4 step, each of which asks the controller.
STAGES = 4
#: Runs with each controller, of which the fastest counts.
RUNS = 7
#: Rows of the short and of the long table.
SHORT, LONG = 3, 10_000
#: How often a program is started, of which the least time counts.
STARTS, COLD_STARTS = 12, 3
#: Rows and cores of the whole program.
JOBS = ((10_000, 1), (10_000, 2), (10_000, 4), (1_000, 2), (40_000, 2))
WHOLE = "hybridyn idm, whole program"
#: The command line, and then the most memory it ever held [KiB] on standard output.
COMMAND = """
import re, sys
from pathlib import Path
from hybridyn.cli import main
status = main(sys.argv[1:])
proc = Path("/proc/self/status")
peak = re.search(r"VmHWM:\\s*(\\d+)", proc.read_text()) if proc.exists() else None
print(peak[1] if peak else "nan")
sys.exit(status)
"""
#: Loads the LX4, then computes with a model that CasADi runs, the cache being empty; prints the seconds.
COLD = """
import sys, time
import hybridyn
robot = hybridyn.load(sys.argv[1])
q, v = robot.home, [0.0] * robot.nv
started = time.perf_counter()
compiled = hybridyn.compile(robot)
compiled.idm(q, v, v)
print(time.perf_counter() - started)
"""


def measure(case: str, count: int = closing.STEPS) -> list[Row]:
    """Measure everything around the models of a robot; the command line with the LX4 alone.

    Args:
        case: Robot.
        count: Number of control steps from Python, of which percentiles are given.
    """
    compiled = hybridyn.compile(case_of(case).load(), wait=True)
    rows = [*guard(case), *closing.measure(case, compiled, count), *controlled_steps(case, compiled)]
    return [*rows, *command_line(), *jobs(), *cold()] if case == "lx4" else rows


def guard(case: str) -> Iterator[Row]:
    """Yield how many operations the inverse model has with its guard and without, and their ratio."""
    robot = case_of(case).load()
    asked = request(robot, choose(robot, None))
    for program, compared in (("idm", True), ("idm_from_motors", False)):
        with_guard, alone = flattened(inverse_program(replace(asked, compared=compared)))
        yield _row(case, program, "operations with the guard", with_guard, "")
        yield _row(case, program, "operations without the guard", alone, "")
        yield _row(case, program, GUARD, with_guard / alone, "")


def controlled_steps(case: str, compiled: CompiledRobot) -> Iterator[Row]:
    """Yield the time of an RK4 step, and what controllers make of it."""
    robot = compiled.robot
    q, still = robot.home, np.zeros(robot.nv)
    held = compiled.idm(q, still, still)
    motors = dict(zip(robot.motors, MotorAxes.of(robot).positions(q) + MOVE, strict=True))
    reference = from_points(robot, [RestPosture(STEP * STEPS, motors, {})], q)

    def law(t: float, q: Array, v: Array) -> Array:
        """Hold the robot."""
        return held

    laws: dict[str, Any] = {
        "bare": held,
        "PD": Pd(robot, reference, KP, KD),
        "computed torque": ComputedTorque(robot, reference, KP, KD),
        "Python": law,
    }
    times = dict.fromkeys(laws, math.inf)
    for _ in range(RUNS):
        for name, effort in laws.items():
            times[name] = min(times[name], _step(compiled, effort))
    bare = times["bare"]
    yield _row(case, "simulate, RK4", "a bare step", 1e6 * bare, "us")
    for name in ("PD", "computed torque"):
        yield _row(case, "simulate, RK4", f"a step with {name}", times[name] / bare, "bare steps")
    own = min(timed(lambda: law(0.0, q, still), 10_000, time.process_time) for _ in range(RUNS))
    beyond = (times["Python"] - bare) / STAGES - own
    yield _row(case, "simulate, RK4", "a law in Python, beyond its own call", 1e6 * beyond, "us")


def _step(compiled: CompiledRobot, effort: Any) -> float:
    """Return the processor time of a step in a run from home [s]."""
    robot, end = compiled.robot, STEP * STEPS
    started = time.process_time()
    run = hybridyn.simulate(
        robot, robot.home, np.zeros(robot.nv), (0.0, end), effort=effort, compiled=compiled,
        output_times=[0.0, end], method="rk4", step=STEP,
    )  # fmt: skip
    spent = time.process_time() - started
    if run.status != "finished":
        raise NotComparableError(f"the run ended: {run.message}")
    return spent / run.counters.steps


def command_line() -> Iterator[Row]:
    """Yield the processor time of `hybridyn idm` on the LX4's poses, beside that of importing Pinocchio."""
    with tempfile.TemporaryDirectory() as folder, only_cores(1):
        programs, out = [["-c", "import pinocchio"]], str(Path(folder, "efforts.csv"))
        for rows in (SHORT, LONG):
            table = Path(folder, f"{rows}.csv")
            write_long_trajectory(table, rows)
            programs.append(["-m", "hybridyn", "idm", str(LX4), str(table), "-o", out, "-q"])
        pinocchio, short, long = _least(programs)
    yield _row("lx4", "python", "import pinocchio", pinocchio, "s")
    yield _row("lx4", "hybridyn idm", f"{SHORT} rows", short, "s")
    yield _row("lx4", "hybridyn idm", f"{SHORT} rows", short / pinocchio, "imports of pinocchio")
    yield _row("lx4", "hybridyn idm", f"{LONG:,} rows, beyond {SHORT}", long - short, "s")


def jobs() -> Iterator[Row]:
    """Yield time and memory of `hybridyn idm` on the LX4's poses, from the start of the program on."""
    for rows, cores in JOBS:
        with tempfile.TemporaryDirectory() as folder, only_cores(cores) as given:
            table = Path(folder) / "trajectory.csv"
            write_long_trajectory(table, rows)
            words = ["idm", str(LX4), str(table), "-o", str(Path(folder) / "efforts.csv"), "-q"]
            _, wall, mib = spent(["-c", COMMAND, *words])
        what = f"{rows:,} rows on {cores} core{'s' * (cores > 1)}"
        yield _row("lx4", WHOLE, what, wall if given else NAN, "s")._replace(mib=float(mib) / 1024.0)


def _least(programs: list[list[str]]) -> list[float]:
    """Return the least processor time of each Python program and of what it starts, by turns [s]."""
    rounds = [[spent(words)[0] for words in programs] for _ in range(STARTS)]
    return [min(times) for times in zip(*rounds, strict=True)]


def cold() -> Iterator[Row]:
    """Yield the time from the loaded LX4 to its first efforts, with an empty cache."""
    least = math.inf
    for _ in range(COLD_STARTS):
        with tempfile.TemporaryDirectory() as folder:
            _, _, seconds = spent(["-c", COLD, str(LX4)], env=os.environ | {VARIABLE: folder})
        least = min(least, float(seconds))
    yield _row("lx4", "compile, quick", "from the loaded robot to its first efforts, empty cache", least, "s")


def _row(case: str, program: str, what: str, value: float, unit: str) -> Row:
    """Return a row of what a user's program waits for."""
    return Row(case, program, setting=what, value=value, unit=unit)
