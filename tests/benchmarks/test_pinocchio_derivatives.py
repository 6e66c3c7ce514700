"""What the pages say of Pinocchio's `computeConstraintDynamicsDerivatives`, in Pinocchio alone.

A release that mends a fault fails its test: then reword `DERIVATIVES` in `benchmarks/texts.py` and
`docs/when-to-take-something-else.md`.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

#: Differences of accelerations with steps of 1e-6 are good to about 1e-9 of the largest entry.
RIGHT, WRONG = 1e-6, 0.1
STEP = 1e-6
POINT, WELD = pin.ContactType.CONTACT_3D, pin.ContactType.CONTACT_6D


class Loop(NamedTuple):
    """A tree, the constraint that closes it, and a posture."""

    model: pin.Model
    constraint: pin.RigidConstraintModel
    q: np.ndarray


def along_x(x: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))


def add(model: pin.Model, parent: int, x: float, joint: pin.JointModel | None = None) -> int:
    """Add a bar that turns about z, or moves by another joint, and return its number."""
    new = model.addJoint(parent, joint or pin.JointModelRZ(), along_x(x), f"joint{model.njoints}")
    model.appendBodyToJoint(new, pin.Inertia.FromBox(1.0, 0.4, 0.05, 0.05), along_x(0.2))
    return new


def two_arms(kind: pin.ContactType = POINT, first: pin.JointModel | None = None) -> Loop:
    """Return two arms of two bars whose tips are joined where they meet."""
    model = pin.Model()
    left, right = (add(model, add(model, 0, x, joint), 0.5) for x, joint in ((0.0, first), (0.8, None)))
    q = np.array([0.3 if first is None else 0.05, 0.7, 2.4, -0.5])
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    tip = along_x(0.6)
    meet = data.oMi[right].inverse() * data.oMi[left] * tip
    return Loop(model, pin.RigidConstraintModel(kind, model, left, tip, right, meet, pin.LOCAL), q)


def pinned(world_first: bool) -> Loop:
    """Return a chain of three bars, the last of which is pinned to the world."""
    model = pin.Model()
    last = add(model, add(model, add(model, 0, 0.0), 0.5), 0.6)
    q, data = np.array([0.9, -0.6, -1.2]), model.createData()
    pin.forwardKinematics(model, data, q)
    ends = [(0, data.oMi[last] * along_x(0.55)), (last, along_x(0.55))]
    (one, at_one), (other, at_other) = ends if world_first else ends[::-1]
    return Loop(model, pin.RigidConstraintModel(POINT, model, one, at_one, other, at_other, pin.LOCAL), q)


def errors(loop: Loop, calls: int = 1) -> tuple[np.ndarray, float]:
    """Return the error of each column of ddq_dq, and that of ddq_dv, of the last of some calls."""
    model, tau = loop.model, np.linspace(1.0, -1.0, loop.model.nv)
    v = np.zeros(model.nv)
    given = pin.StdVec_RigidConstraintModel([loop.constraint])

    def solved(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, pin.Data, list[object]]:
        data, datas = model.createData(), pin.StdVec_RigidConstraintData([loop.constraint.createData()])
        pin.initConstraintDynamics(model, data, given, datas)
        settings = pin.ProximalSettings(1e-14, 1e-8, 10)
        a = pin.constraintDynamics(model, data, q, v, tau, given, datas, settings).copy()
        return a, data, [given, datas, settings]

    _, data, rest = solved(loop.q, v)
    for _ in range(calls):
        pin.constraintDynamics(model, data, loop.q, v, tau, *rest)
        pin.computeConstraintDynamicsDerivatives(model, data, *rest)
    steps = STEP * np.eye(model.nv)
    over_q = np.array([solved(loop.q + h, v)[0] - solved(loop.q - h, v)[0] for h in steps]).T / (2 * STEP)
    over_v = np.array([solved(loop.q, v + h)[0] - solved(loop.q, v - h)[0] for h in steps]).T / (2 * STEP)
    columns = np.abs(data.ddq_dq - over_q).max(axis=0) / np.abs(over_q).max()
    return columns, float(np.abs(data.ddq_dv - over_v).max() / np.abs(over_q).max())


def test_a_point_between_two_bodies_spoils_the_column_of_a_first_rotation() -> None:
    over_q, over_v = errors(two_arms())
    assert over_q[0] > WRONG, f"Pinocchio {pin.__version__} mends ddq_dq of loops closed at points"
    assert over_q[1:].max() < RIGHT
    assert over_v < RIGHT


@pytest.mark.parametrize(
    "loop", [two_arms(WELD), two_arms(first=pin.JointModelPX()), pinned(world_first=False)],
    ids=["weld", "first joint slides", "world second"],
)  # fmt: skip
def test_other_loops_have_right_derivatives(loop: Loop) -> None:
    for calls in (1, 3):
        over_q, over_v = errors(loop, calls)
        assert max(over_q.max(), over_v) < RIGHT


def test_with_the_world_first_repeated_calls_add_up() -> None:
    assert errors(pinned(world_first=True))[0].max() < RIGHT
    again = errors(pinned(world_first=True), 2)[0].max()
    assert again > WRONG, f"Pinocchio {pin.__version__} mends repeated calls with the world as first body"
