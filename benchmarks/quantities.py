"""Compiled closed-loop quantities beside Pinocchio's algorithms for the open tree of the same robot.

Pinocchio's `crba` and `nonLinearEffects` know no closures: their results are those of the open tree, which
the loops turn into M by dq/du on both sides. So is that of `computeDelassusMatrix` of the link, which is
compared with J M^-1 J^T of the open tree before anything is timed. They are called sample by sample.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

import hybridyn
from benchmarks.peers.ours import COMPILED
from benchmarks.results import Row
from benchmarks.timing import Candidate, measured
from hybridyn.compiled.equations.states import moving_states
from hybridyn.spatial import Array
from hybridyn.studies.compare.peer_engine import NotComparableError

ROBOTS = ("five_bar", "gough_stewart", "lx4")
#: Largest difference between Pinocchio's Delassus matrix and J M^-1 J^T, of the largest entry.
SAME = 1e-9
#: Samples in a batch, and how often it is measured.
SAMPLES, ROUNDS = 1_000, 9


def measure(case: str, samples: int = SAMPLES, rounds: int = ROUNDS) -> list[Row]:
    """Measure a robot.

    Raises:
        NotComparableError: The general path had to compute a sample.
    """
    compiled = hybridyn.compile(hybridyn.load(case), wait=True)
    row = Row(case, "quantities", batch=samples)
    calls = calls_of(compiled, samples).items()
    rows = measured([Candidate(row._replace(method=name), samples, call) for name, call in calls], rounds)
    if compiled.recomputed:
        raise NotComparableError(f"the general path computed {compiled.recomputed} samples")
    return rows


def calls_of(compiled: hybridyn.CompiledRobot, samples: int) -> dict[str, Callable[[], object]]:
    """Return what is measured, by name."""
    robot = compiled.robot
    model, link = robot.model.copy(), list(robot.bodies.place)[-1]
    data, delassus = model.createData(), delassus_of_tree(model, link)
    q, v, _ = moving_states(robot, samples, 1)
    pairs = list(zip(q, v, strict=True))
    return {
        f"{COMPILED}, mass_matrix": lambda: compiled.mass_matrix(q),
        "pin.crba, loops open": lambda: [pin.crba(model, data, x) for x in q],
        f"{COMPILED}, bias": lambda: compiled.bias(q, v),
        "pin.nonLinearEffects, loops open": lambda: [
            pin.nonLinearEffects(model, data, *pair) for pair in pairs
        ],
        f"{COMPILED}, coriolis": lambda: compiled.coriolis(q, v),
        f"{COMPILED}, gravity": lambda: compiled.gravity(q),
        f"{COMPILED}, motion_map": lambda: compiled.motion_map(q),
        f"{COMPILED}, motion_map with its rate": lambda: compiled.motion_map(q, v),
        f"{COMPILED}, link_jacobian": lambda: compiled.link_jacobian(q, link),
        f"{COMPILED}, delassus": lambda: compiled.delassus(q, link),
        "pin.computeDelassusMatrix, loops open": lambda: [delassus(x) for x in q],
        f"{COMPILED}, energy": lambda: compiled.energy(q, v),
    }


def delassus_of_tree(model: pin.Model, link: str) -> Callable[[Array], Array]:
    """Return Pinocchio's Delassus matrix of a link of the open tree, in its axes, at one posture."""
    data, frame = model.createData(), model.getFrameId(link, pin.BODY)
    at = model.frames[frame]
    constraints, states = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    constraints.append(
        pin.RigidConstraintModel(pin.ContactType.CONTACT_6D, model, at.parentJoint, at.placement, pin.LOCAL)
    )
    states.append(constraints[0].createData())
    q = pin.neutral(model)
    M = pin.crba(model, data, q)
    J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
    right = J @ np.linalg.solve(np.triu(M) + np.triu(M, 1).T, J.T)
    off = np.abs(pin.computeDelassusMatrix(model, data, q, constraints, states) - right).max()
    assert off <= SAME * np.abs(right).max(), off
    return lambda q: np.asarray(pin.computeDelassusMatrix(model, data, q, constraints, states))
