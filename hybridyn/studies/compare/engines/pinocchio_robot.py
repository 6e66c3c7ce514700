"""A robot in Pinocchio, with rigid constraints for its closures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin

from ....description.placement import placement_from
from ....description.records import Closure
from ....spatial import Array, Index
from ....structure.robot import HybridRobot
from ..peer_engine import NotComparableError
from ..states import DEPENDENT

#: Distance of the two points that stand for a hinge from its centre, relative to the robot's size.
HINGE = 0.1
#: Proximal settings: accuracy, mu and iterations. Rows may be redundant, so mu is not zero.
SETTINGS = (1e-14, 1e-10, 100)


class PinocchioEngine:
    """A Pinocchio model with rigid constraints.

    Attributes:
        model, data: Pinocchio's.
        contacts, datas: The constraints.
        owners: Names of the closures that they state, where it is known.
    """

    def __init__(
        self, robot: HybridRobot, model: pin.Model, contacts: pin.StdVec_RigidConstraintModel, way: str,
        notes: tuple[str, ...] = (), owners: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.robot, self.model, self.way, self.notes, self.owners = robot, model, way, notes, owners
        model.gravity.linear = np.array(robot.gravity)
        model.armature[:] = 0.0
        self.data, self.contacts = model.createData(), contacts
        self.datas = pin.StdVec_RigidConstraintData([contact.createData() for contact in contacts])
        pin.initConstraintDynamics(model, self.data, contacts, self.datas)
        self.settings = pin.ProximalSettings(*SETTINGS)
        numbers = [model.getJointId(name) for name in robot.joints]
        if robot.base != "fixed":
            numbers[0] = 1
        # Endless gears are angles here, and cosine and sine in models that Pinocchio reads.
        turns = [i for i, n in enumerate(numbers) if model.nqs[n] == 2 and robot.kinds[i].additive]
        sizes = [1 if i in turns else model.nqs[n] for i, n in enumerate(numbers)]
        starts = [model.idx_qs[n] for n in numbers]
        self.q_at = np.concatenate([self._range(*own) for own in zip(starts, sizes, strict=True)])
        self.turned = np.array([robot.q_slices[i].start for i in turns], dtype=int)
        self.v_at = np.concatenate([self._range(model.idx_vs[n], model.nvs[n]) for n in numbers])
        if len(self.q_at) != robot.nq or len(self.v_at) != robot.nv:
            raise NotComparableError("Pinocchio's joints have other coordinates")

    @staticmethod
    def _range(start: int, size: int) -> Index:
        return np.arange(int(start), int(start) + int(size))

    def _theirs(self, q: Array, *rates: Array) -> list[Array]:
        positions = np.zeros(self.model.nq)
        positions[self.q_at] = q
        cosines = self.q_at[self.turned]
        positions[cosines], positions[cosines + 1] = np.cos(q[self.turned]), np.sin(q[self.turned])
        out = [positions]
        for x in rates:
            own = np.zeros(self.model.nv)
            own[self.v_at] = x
            out.append(own)
        return out

    def efforts(self, tau: Array) -> Array:
        """Spread the motors' efforts over the joints, shape (nv,)."""
        out = np.zeros(self.robot.nv)
        out[self.robot.motor_v] = tau
        return out

    def forward(self, q: Array, v: Array, force: Array) -> Array:
        """Compute accelerations by `constraintDynamics` (`aba` where there is no constraint)."""
        state = (self.model, self.data, *self._theirs(q, v, force))
        if len(self.contacts):
            found = pin.constraintDynamics(*state, self.contacts, self.datas, self.settings)
        else:
            found = pin.aba(*state)
        out: Array = np.asarray(found)[self.v_at]
        return out

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Compute forces by `rnea`."""
        out: Array = np.array(pin.rnea(self.model, self.data, *self._theirs(q, v, a)))[self.v_at]
        return out

    def rows(self, q: Array) -> Array:
        """Return the constraints' Jacobian, shape (rows, nv), at Pinocchio's own positions."""
        pin.computeJointJacobians(self.model, self.data, q)
        for contact, data in zip(self.contacts, self.datas, strict=True):
            contact.calc(self.model, self.data, data)
        K: Array = pin.getConstraintsJacobian(self.model, self.data, self.contacts, self.datas)
        return K

    def freedoms(self, q: Array) -> int:
        """Count freedoms by the rank of the constraints' Jacobian."""
        rank = np.linalg.matrix_rank(self.rows(*self._theirs(q)), rtol=DEPENDENT) if len(self.contacts) else 0
        return int(self.model.nv - rank)


def with_constraints(robot: HybridRobot) -> PinocchioEngine:
    """Add a rigid constraint for each closure that Pinocchio has; a note names what it has none for."""
    model = robot.unchanged_model.copy()
    contacts, left_out, owners = pin.StdVec_RigidConstraintModel(), list[str](), list[str]()
    for closure in robot.description.closures:
        found = list(_contacts(robot, model, closure))
        left_out += [] if found else [closure.name]
        owners += len(found) * [closure.name]
        for contact in found:
            contacts.append(contact)
    left_out += [coupling.name for coupling in robot.description.couplings]
    note = (f"Pinocchio has no constraint for {', '.join(left_out)}",) if left_out else ()
    return PinocchioEngine(robot, model, contacts, "rigid constraints", note, owners)


def _contacts(robot: HybridRobot, model: pin.Model, closure: Closure) -> Iterator[pin.RigidConstraintModel]:
    """Yield the constraints of a closure: a point, a weld, or two points on the axis of a hinge.

    Of the six rows of two points, five are independent. There are none for other closures.
    """
    if closure.translations != (0, 1, 2) or closure.rotation == "perpendicular":
        return
    ends = []
    for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
        body, R, p = robot.bodies.place[link]
        root = 0 if robot.base == "fixed" else 1
        joint = model.getJointId(robot.bodies.joints[body - 1].joint.name) if body else root
        ends.append((joint, pin.SE3(np.asarray(R), np.asarray(p)), frame))
    fixed, reach = closure.rotation == "fixed", HINGE * robot.bodies.size
    contact = pin.ContactType.CONTACT_6D if fixed else pin.ContactType.CONTACT_3D
    for shift in (-reach, reach) if closure.rotation == "parallel" else (0.0,):
        way = placement_from(np.eye(3), np.array([0.0, 0.0, shift]))
        frames = [x for joint, at, frame in ends for x in (joint, at * pin.SE3(frame @ way))]
        yield pin.RigidConstraintModel(contact, model, *frames)
