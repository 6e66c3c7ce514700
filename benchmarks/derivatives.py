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
from benchmarks.operations import total
from benchmarks.reference import LongDouble, refuse
from benchmarks.results import CHECK, Row
from benchmarks.timing import Candidate, measured
from hybridyn import HybridRobot
from hybridyn.compiled.derivatives import Derivatives
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.programs.derivatives.sweeps import DENSE
from hybridyn.compiled.programs.whole_robot import programs
from hybridyn.compiled.second.programs import second_program
from hybridyn.effects.choice import choose
from hybridyn.spatial import Array
from hybridyn.studies.compare.engines import pinocchio_solvers
from hybridyn.studies.compare.methods import MODELS, Model, Setting, grid, written
from hybridyn.studies.compare.peer_engine import NotComparableError
from tests.oracle import Oracle

ROBOTS = ("ur5", "five_bar", "gough_stewart", "lx4")
#: Names of our calls: with new arrays, and with arrays that are filled again, as Pinocchio's data are.
OURS, GIVEN = "hybridyn, compiled", "hybridyn, compiled, given arrays"
#: What follows the name of a model whose derivatives are over the motors.
MOTORS = " over motors"
#: Coordinates, what follows the name of a product over them, and what it is compared with.
OVER = ("joints", "", "the model"), ("motors", MOTORS, "the model and closing")
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


def measure(case: str, batch: int, rounds: int) -> list[Row]:
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
    given = {"idm": (q, v, a), "ddm": (q, v, tau)}
    return [row for model in MODELS for row in _measure(robot, case, model, given[model], rounds)]


def _measure(robot: HybridRobot, case: str, model: Model, given: Blocks, rounds: int) -> list[Row]:
    """Measure the derivatives of one model."""
    batch, what = len(given[0]), f"{model}_jacobian"
    q, v, x = (np.ascontiguousarray(array[0]) for array in given)
    reference = exact(robot, model, q, v, x)
    said = f"{what}: the reference (long double), its own error"
    out = [Row(case, CHECK, setting=said, error=reference.error)]
    own = total(programs(robot, models=(model,))[model])
    candidates: list[Candidate] = []
    for coordinates, words, truth in (
        ("joints", what, reference),
        ("motors", what + MOTORS, reference.of_motors(robot, model)),
    ):
        derive = Derivatives(robot, model, coordinates=coordinates)
        found = derive(q, v, x)
        error = truth.off((found["q"], found["v"], found["a" if model == "idm" else "tau"]))
        refuse(error, LIMIT, f"{words} of {case}")
        out.append(Row(case, CHECK, setting=f"{words} by {OURS}", error=error, limit=LIMIT))
        whole, sparse = (total(derive.program, part) / own for part in ("", DENSE))
        count = f"{whole:.3g} times the model's operations, {sparse:.3g} without dense products"
        row = Row(case, words, OURS, count, error=error)
        candidates.append(Candidate(row, 1, partial(derive, q, v, x)))
        filled = partial(derive, q, v, x, out=derive.allocate())
        candidates.append(Candidate(row._replace(method=GIVEN), 1, filled))
        candidates.append(Candidate(row._replace(batch=batch), batch, partial(derive, *given)))
    try:
        for name, setting, blocks, call in peers(robot, model, (q, v, x)):
            row = Row(case, what, name, written(setting), error=reference.off(blocks))
            candidates.append(Candidate(row, 1, call))
    except NotComparableError as why:
        out.append(Row(case, what, "pinocchio", note=str(why)))
    return out + products(robot, case, model) + measured(candidates, rounds, clock=time.process_time)


def products(robot: HybridRobot, case: str, model: Model) -> list[Row]:
    """Count the operations of products of second derivatives, over those of the model; not timed."""
    out = []
    for coordinates, over, what in OVER:
        count = f"{cost_of_product(robot, model, coordinates):.3g} times the operations of {what}"
        out.append(Row(case, f"{model} product{over}", OURS, count))
    return out


def cost_of_product(robot: HybridRobot, model: Model, coordinates: str) -> float:
    """Return the operations of a product of second derivatives over those of the model.

    Args:
        coordinates: "joints" or "motors"; closing the loops belongs to the model over motors.
    """
    product = second_program(robot, choose(robot, None), model, "product", coordinates=coordinates)
    own = programs(robot, models=(model, "close") if coordinates == "motors" else (model,))
    return total(product) / sum(map(total, own.values()))


Peer = tuple[str, Setting, Blocks, Callable[[], object]]


def peers(robot: HybridRobot, model: Model, given: Blocks) -> Iterator[Peer]:
    """Return Pinocchio's name, setting, derivatives at a sample, and the call to be timed.

    Raises:
        NotComparableError: Pinocchio cannot do this robot.
    """
    q, v, x = given
    closed = bool(robot.description.closures)
    if closed and model == "idm":
        raise NotComparableError("Pinocchio has no derivatives of the inverse model of robots with loops")
    own = pinocchio_solvers.closed(robot)
    m, data = own.model, own.data
    if not closed and model == "idm":
        pin.computeRNEADerivatives(m, data, q, v, x)
        whole = np.triu(data.M) + np.triu(data.M, 1).T
        rnea = tuple(J[robot.motor_v].copy() for J in (data.dtau_dq, data.dtau_dv, whole))
        yield "pin.computeRNEADerivatives", {}, rnea, lambda: pin.computeRNEADerivatives(m, data, q, v, x)
        return
    efforts = own.efforts(x)
    if not closed:
        pin.computeABADerivatives(m, data, q, v, efforts)
        whole = np.triu(data.Minv) + np.triu(data.Minv, 1).T
        aba = (data.ddq_dq.copy(), data.ddq_dv.copy(), whole[:, robot.motor_v])
        yield "pin.computeABADerivatives", {}, aba, lambda: pin.computeABADerivatives(m, data, q, v, efforts)
        return
    for setting in SETTINGS:
        yield _constrained(robot, given, setting)


def _constrained(robot: HybridRobot, given: Blocks, setting: Setting) -> Peer:
    """Return Pinocchio's derivatives of a robot with loops."""
    own = pinocchio_solvers.closed(robot)
    q, v, x = given
    m, data = own.model, own.data
    settings = pin.ProximalSettings(ACCURACY, setting["mu"], int(setting["iterations"]))
    closures = (own.contacts, own.datas, settings)
    pin.constraintDynamics(m, data, q, v, own.efforts(x), *closures)

    def call() -> None:
        pin.computeConstraintDynamicsDerivatives(m, data, *closures)

    call()
    blocks = (data.ddq_dq.copy(), data.ddq_dv.copy(), data.ddq_dtau[:, robot.motor_v].copy())
    return "pin.computeConstraintDynamicsDerivatives", setting, blocks, call
