"""Compiled closed-loop quantities beside Pinocchio's algorithms for the open tree of the same robot.

Run `python -m benchmarks.quantities [robots]`. Times are per sample of a batch of `SAMPLES` [us]. Pinocchio's
`crba` and `nonLinearEffects` know no closures: their results are those of the open tree, which the loops turn
into M by dq/du on both sides. So is that of `computeDelassusMatrix` of the link alone, which is compared with
J M^-1 J^T of the open tree before anything is timed. They are called from Python, sample by sample.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import pinocchio as pin

import hybridyn
from benchmarks.timing import interleaved, one_thread
from hybridyn.compiled.equations.states import moving_states
from hybridyn.spatial import Array

ROBOTS = ("five_bar", "gough_stewart", "lx4")
#: Largest difference between Pinocchio's Delassus matrix and J M^-1 J^T, of the largest entry.
SAME = 1e-9
#: Samples in a batch, and how often it is measured.
SAMPLES, ROUNDS = 1_000, 9


def main() -> int:
    """Measure the robots that are named, and print a table."""
    one_thread()
    for name in sys.argv[1:] or ROBOTS:
        compiled = hybridyn.compile(hybridyn.load(name))
        calls = calls_of(compiled)
        for call in calls.values():
            call()
        for what, time in zip(calls, interleaved(list(calls.values()), ROUNDS), strict=True):
            print(f"{name:<15}{what:<35}{1e6 * time.least / SAMPLES:9.2f}", flush=True)
        assert compiled.recomputed == 0
    return 0


def calls_of(compiled: hybridyn.CompiledRobot) -> dict[str, Callable[[], object]]:
    """Return what is measured, by name."""
    robot = compiled.robot
    model, link = robot.model.copy(), list(robot.bodies.place)[-1]
    data, delassus = model.createData(), delassus_of_tree(model, link)
    q, v, _ = moving_states(robot, SAMPLES, 1)
    pairs = list(zip(q, v, strict=True))
    return {
        "mass_matrix": lambda: compiled.mass_matrix(q),
        "crba (open tree)": lambda: [pin.crba(model, data, x) for x in q],
        "bias": lambda: compiled.bias(q, v),
        "nonLinearEffects (open tree)": lambda: [pin.nonLinearEffects(model, data, *pair) for pair in pairs],
        "coriolis": lambda: compiled.coriolis(q, v),
        "gravity": lambda: compiled.gravity(q),
        "motion_map": lambda: compiled.motion_map(q),
        "motion_map with its rate": lambda: compiled.motion_map(q, v),
        "link_jacobian": lambda: compiled.link_jacobian(q, link),
        "delassus": lambda: compiled.delassus(q, link),
        "computeDelassusMatrix (open tree)": lambda: [delassus(x) for x in q],
        "energy": lambda: compiled.energy(q, v),
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


if __name__ == "__main__":
    raise SystemExit(main())
