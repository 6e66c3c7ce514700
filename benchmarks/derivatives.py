"""Derivatives of both models beside Pinocchio's, of robots with loops and of serial arms.

They are measured over all joints and over the motors, which is what a controller or an optimiser reads.
Errors are those of one directional derivative, along a random motion that keeps the loops closed, against
differences of the oracle in long double. Pinocchio's `computeConstraintDynamicsDerivatives` needs
`constraintDynamics`, which is called before and not counted.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from benchmarks.cases import case_of
from benchmarks.gate import refuse
from benchmarks.methods import Model, NotMeasuredError, Setting, grid, written
from benchmarks.peers.pinocchio_loops import loops
from benchmarks.reference import LongDouble
from benchmarks.results import Check, Point
from benchmarks.timing import interleaved
from hybridyn import HybridRobot
from hybridyn.compiled.code.kernels import kernel_graph
from hybridyn.compiled.derivatives import Derivatives
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.program import Call, Program
from hybridyn.compiled.programs.derivatives.adjoints import DENSE
from hybridyn.compiled.programs.whole_robot import programs
from hybridyn.spatial import Array
from tests.oracle import Oracle

ROBOTS = ("ur5", "five_bar", "gough_stewart", "lx4")
#: Names of our calls: with new arrays, and with arrays that are filled again, as Pinocchio's data are.
OURS, GIVEN = "hybridyn, compiled", "hybridyn, compiled, given arrays"
#: What follows the name of a model whose derivatives are over the motors.
MOTORS = " over motors"
#: Largest error of hybridyn's derivatives.
LIMIT = 1e-10
#: Step of the differences: its fourth power, and the rounding of long doubles over it, are about 1e-15.
STEP = 1e-4
#: Pinocchio's proximal settings.
SETTINGS = grid(mu=(1e-8, 1e-12), iterations=(1,))
ACCURACY = 1e-14

Blocks = tuple[Array, Array, Array]


class Exact(NamedTuple):
    """A directional derivative.

    Attributes:
        along: Changes of q (along the freedoms), of v, and of a or tau.
        value: Change of tau or a.
        error: Its own estimated error, relative to the largest entry.
    """

    along: Blocks
    value: Array
    error: float

    def off(self, blocks: Blocks) -> float:
        """Return the error of derivatives, relative to the largest entry of the exact change."""
        found = sum(J @ x for J, x in zip(blocks, self.along, strict=True))
        error = np.abs(found - self.value).max() / np.abs(self.value).max()
        return float(error) if np.isfinite(error) else math.inf

    def of_motors(self, robot: HybridRobot, model: Model) -> Exact:
        """Return the same of the motors alone."""
        at = robot.motor_v
        dq, dv, dx = self.along
        if model == "idm":
            return Exact((dq[at], dv[at], dx[at]), self.value, self.error)
        return Exact((dq[at], dv[at], dx), self.value[at], self.error)


def exact(robot: HybridRobot, model: Model, q: Array, v: Array, given: Array) -> Exact:
    """Compute a directional derivative along a random motion that keeps the loops closed."""
    oracle = Oracle(robot.description, robot.base, arithmetic=LongDouble())
    rng = np.random.default_rng(1)
    start = oracle.close(q)
    dq, dv, dx = (rng.uniform(-1.0, 1.0, len(x)) * np.abs(x).max() for x in (v, v, given))

    def state(h: float) -> list[Array]:
        """Return q, v, what is given and the result a step away."""
        at = oracle.close(oracle.integrate(start, np.longdouble(h) * dq))
        rates = oracle.project_velocity(at, v + np.longdouble(h) * dv)
        x = given + np.longdouble(h) * dx
        if model == "idm":
            x = oracle.consistent_acceleration(at, rates, x)
            return [at, rates, x, oracle.idm(at, rates, x)]
        return [at, rates, x, oracle.ddm(at, rates, x)]

    at = {n: state(n * STEP) for n in (-4, -2, -1, 1, 2, 4)}
    fine, coarse = (
        [_rate([at[n * k][i] for n in (-2, -1, 1, 2)], k * STEP) for i in range(4)] for k in (1, 2)
    )
    moves = [
        _rate([oracle.integrate(start, np.longdouble(n * STEP) * e) for n in (-2, -1, 1, 2)], STEP)
        for e in np.eye(robot.nv)
    ]
    along: Array = np.linalg.lstsq(np.array(moves).T, fine[0], rcond=None)[0].astype(float)
    error = float(np.abs(fine[3] - coarse[3]).max() / np.abs(fine[3]).max())
    return Exact((along, fine[1], fine[2]), fine[3], error)


def _rate(values: list[Array], h: float) -> Array:
    """Return a derivative from values at -2 h, -h, h and 2 h."""
    a, b, c, d = values
    return np.asarray((a - 8 * b + 8 * c - d) / (12 * np.longdouble(h)), float)


def measure(case: str, batch: int, rounds: int) -> list[Check | Point]:
    """Measure the derivatives of both models of a robot.

    Args:
        case: The robot.
        batch: Samples of a batch.
        rounds: Measurements of each call.

    Raises:
        WrongModelError: hybridyn's derivatives are off.
    """
    robot = case_of(case).load()
    q, v, a, tau = random_states(robot, batch)
    out: list[Check | Point] = []
    for model, given in (("idm", a), ("ddm", tau)):
        out += _measure(robot, case, "idm" if model == "idm" else "ddm", (q, v, given), rounds)
    return out


def _measure(robot: HybridRobot, case: str, model: Model, given: Blocks, rounds: int) -> list[Check | Point]:
    """Measure the derivatives of one model."""
    batch, what = len(given[0]), f"{model}_jacobian"
    q, v, x = (np.ascontiguousarray(array[0]) for array in given)
    reference = exact(robot, model, q, v, x)
    out: list[Check | Point] = [
        Check(case, f"{what}: the reference (long double), its own error", reference.error, math.nan)
    ]
    model_alone = operations(programs(robot, models=(model,))[model])
    rows: list[tuple[str, str, str, int, float]] = []
    calls: list[Callable[[], object]] = []
    for coordinates, words, truth in (
        ("joints", what, reference),
        ("motors", what + MOTORS, reference.of_motors(robot, model)),
    ):
        derive = Derivatives(robot, model, coordinates=coordinates)
        found = derive(q, v, x)
        error = truth.off((found["q"], found["v"], found["a" if model == "idm" else "tau"]))
        refuse(error, LIMIT, f"{words} of {case}")
        out.append(Check(case, f"{words} by hybridyn, compiled", error, LIMIT))
        dense, whole = operations(derive.program, DENSE), operations(derive.program)
        ratios = f"{whole / model_alone:.3g}", f"{(whole - dense) / model_alone:.3g}"
        count = f"{ratios[0]} times the model's operations, {ratios[1]} without dense products"
        rows += [(words, name, count, samples, error) for name in (OURS, GIVEN) for samples in (1, batch)]
        one, many = derive.allocate(), derive.allocate(batch)
        calls += [
            partial(derive, q, v, x), partial(derive, *given), partial(derive, q, v, x, out=one),
            partial(derive, *given, out=many),
        ]  # fmt: skip
    try:
        for name, setting, blocks, call in peers(robot, model, (q, v, x)):
            rows.append((what, name, written(setting), 1, reference.off(blocks)))
            calls.append(call)
    except NotMeasuredError as why:
        nothing = math.nan
        out.append(Point(what, case, "pinocchio", "", 0, 0, nothing, nothing, nothing, str(why)))
    times = interleaved(calls, rounds, clock=time.process_time)
    for (model_of, name, words, samples, off), taken in zip(rows, times, strict=True):
        us = 1e6 / samples
        out.append(
            Point(model_of, case, name, words, samples, 1, off, us * taken.least, us * taken.median, "")
        )
    return out


Peer = tuple[str, Setting, Blocks, Callable[[], object]]


def peers(robot: HybridRobot, model: Model, given: Blocks) -> Iterator[Peer]:
    """Return Pinocchio's name, setting, derivatives at a sample, and the call to be timed.

    Raises:
        NotMeasuredError: Pinocchio cannot do this robot.
    """
    q, v, x = given
    closed = bool(robot.description.closures)
    if closed and model == "idm":
        raise NotMeasuredError("Pinocchio has no derivatives of the inverse model of robots with loops")
    own = loops(robot)
    m, data = own.model, own.data
    if not closed and model == "idm":
        pin.computeRNEADerivatives(m, data, q, v, x)
        whole = np.triu(data.M) + np.triu(data.M, 1).T
        rnea = tuple(J[own.motors].copy() for J in (data.dtau_dq, data.dtau_dv, whole))
        yield "pin.computeRNEADerivatives", {}, rnea, lambda: pin.computeRNEADerivatives(m, data, q, v, x)
        return
    efforts = own.efforts(x)
    if not closed:
        pin.computeABADerivatives(m, data, q, v, efforts)
        whole = np.triu(data.Minv) + np.triu(data.Minv, 1).T
        aba = (data.ddq_dq.copy(), data.ddq_dv.copy(), whole[:, own.motors])
        yield "pin.computeABADerivatives", {}, aba, lambda: pin.computeABADerivatives(m, data, q, v, efforts)
        return
    for setting in SETTINGS:
        yield _constrained(robot, given, setting)


def _constrained(robot: HybridRobot, given: Blocks, setting: Setting) -> Peer:
    """Return Pinocchio's derivatives of a robot with loops."""
    own = loops(robot)
    q, v, x = given
    m, data = own.model, own.data
    pin.initConstraintDynamics(m, data, own.constraints, own.constraint_data)
    settings = pin.ProximalSettings(ACCURACY, setting["mu"], int(setting["iterations"]))
    closures = (own.constraints, own.constraint_data, settings)
    pin.constraintDynamics(m, data, q, v, own.efforts(x), *closures)

    def call() -> None:
        pin.computeConstraintDynamicsDerivatives(m, data, *closures)

    call()
    blocks = (data.ddq_dq.copy(), data.ddq_dv.copy(), data.ddq_dtau[:, own.motors].copy())
    return "pin.computeConstraintDynamicsDerivatives", setting, blocks, call


def operations(program: Program, part: str = "") -> int:
    """Return the number of operations of one sample, or of one part; a fused product counts as two."""
    counts = [
        sum({"input": 0, "constant": 0, "fma": 2}.get(node.name, 1) for node in kernel_graph(kernel).nodes)
        for kernel in program.kernels
    ]
    calls = [step for step in program.steps if isinstance(step, Call)]
    wanted = [call for call in calls if part in ("", program.kernels[call.kernel].part)]
    return sum(call.copies * counts[call.kernel] for call in wanted)
