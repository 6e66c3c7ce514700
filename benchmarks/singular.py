"""Error against the distance to a singular posture, for every method.

Two plane mechanisms, so that the state can be written down and the reference computed in 60 digits:

- a parallelogram near its flat posture, where the closures are about to lose rank: the direct model;
- a slider-crank driven by its slider near the dead centre, where the motor is about to lose its lever: the
  inverse model, whose effort grows as one over the distance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import hybridyn
from benchmarks.cases import ROOT
from benchmarks.peers import methods_of
from benchmarks.reference import relative
from benchmarks.results import CHECK, Row
from hybridyn import HybridRobot, HybridynError
from hybridyn.spatial import Array
from hybridyn.studies.compare.methods import Model, Solver, written
from hybridyn.studies.compare.peer_engine import NotComparableError
from tests.oracle import Extended, Oracle

DIGITS = 60
#: Below the least singular value at the nearest distance, above the rounding of the frames.
RANK = 1e-13
CRANK, ROD = 0.25, 0.5  # of the slider-crank [m]
RATE, CHANGE = 1.0, 2.0  # of its crank [rad/s, rad/s^2]
#: On the parallelogram's crank [N m].
EFFORT = 3.0

State = tuple[Array, Array, Array]


def parallelogram(angle: float) -> State:
    """Return the state q, v, tau at an angle of the crank."""
    side = np.array([1.0, -1.0, 1.0])
    return angle * side, RATE * side, np.array([EFFORT])


def slider_crank(angle: float) -> State:
    """Return the state q, v, a at an angle of the crank: crank, rod, slide."""
    s, c, ratio = math.sin(angle), math.cos(angle), CRANK / ROD
    lean = math.asin(ratio * s)  # of the rod, the other way
    lean_rate = ratio * c * RATE / math.cos(lean)
    change = (ratio * (c * CHANGE - s * RATE**2) + math.sin(lean) * lean_rate**2) / math.cos(lean)
    q = np.array([angle, -angle - lean, CRANK * (c - 1) + ROD * (math.cos(lean) - 1)])
    v = np.array([RATE, -RATE - lean_rate, -CRANK * s * RATE - ROD * math.sin(lean) * lean_rate])
    a = np.array(
        [
            CHANGE,
            -CHANGE - change,
            -CRANK * (c * RATE**2 + s * CHANGE)
            - ROD * (math.cos(lean) * lean_rate**2 + math.sin(lean) * change),
        ]
    )
    return q, v, a


@dataclass(frozen=True)
class Approach:
    """A way to a singular posture."""

    file: str
    model: Model
    state: Callable[[float], State]


APPROACHES = {
    "parallelogram, flat": Approach("parallelogram", "ddm", parallelogram),
    "slider-crank, dead centre": Approach("slider_crank", "idm", slider_crank),
}


def load(approach: Approach) -> HybridRobot:
    """Load the robot of an approach."""
    return hybridyn.load(ROOT / "benchmarks" / "robots" / f"{approach.file}.urdf")


def exact(robot: HybridRobot, model: Model, state: State) -> tuple[Array, float]:
    """Return the answer at a state in 60 digits, and how far it moves when the loop is closed to the last."""
    import mpmath

    with mpmath.workdps(DIGITS):
        oracle = Oracle(robot.description, arithmetic=Extended(mpmath.mp), rank_tolerance=RANK)
        q, v, given = state
        call = oracle.ddm if model == "ddm" else oracle.idm
        answer = call(q, v, given)
        closed = oracle.close(q)
        v = oracle.project_velocity(closed, v)
        moved = call(closed, v, given if model == "ddm" else oracle.consistent_acceleration(closed, v, given))
        size = max(abs(x) for x in answer)
        floor = float(max(abs(x) for x in answer - moved) / size)
        return answer.astype(float), floor


def measure(case: str, distances: tuple[float, ...]) -> list[Row]:
    """Measure every method at every setting; give each at its best setting for every distance."""
    approach = APPROACHES[case]
    robot, model = load(approach), approach.model
    states = {distance: approach.state(distance) for distance in distances}
    answers = {distance: exact(robot, model, state) for distance, state in states.items()}
    said = f"{model}: what closing the loop to the last of {DIGITS} digits moves the answer by"
    out = [Row(case, CHECK, setting=said, error=max(floor for _, floor in answers.values()))]
    for method in methods_of(model):
        try:
            at = method.prepare(robot)
        except NotComparableError as why:
            out.append(Row(case, model, method.name, note=str(why)))
            continue
        for distance, state in states.items():
            row = Row(case, model, method.name, at=distance)
            tried = [
                error(at(setting), state, answers[distance][0], row._replace(setting=written(setting)))
                for setting in method.settings
            ]
            out.append(min(tried, key=lambda row: math.inf if math.isnan(row.error) else row.error))
    return out


def error(solve: Solver, state: State, answer: Array, row: Row) -> Row:
    """Fill in a method's relative error at a state, or what it said instead of an answer."""
    try:
        found = solve(*state)
    except (HybridynError, np.linalg.LinAlgError) as said:
        return row._replace(note=f"{type(said).__name__}: {str(said).splitlines()[0]}")
    return row._replace(error=relative(found, answer) if np.isfinite(found).all() else math.inf)
