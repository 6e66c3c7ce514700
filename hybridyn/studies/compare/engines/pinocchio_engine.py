"""Pinocchio: the robot as its own readers see it, and with constraint models for its closures."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from ....description.records import Closure
from ....spatial import Array, Index
from ....structure.robot import HybridRobot
from ..engine import Engine, NotComparableError, Way, refuse_other_joints
from ..own_file import OwnFile
from .joinings import joinings

#: Proximal settings: accuracy, mu and iterations. Rows may be redundant, so mu is not zero.
SETTINGS = (1e-14, 1e-10, 100)


class PinocchioEngine:
    """A Pinocchio model with rigid constraints.

    Attributes:
        model, data: Pinocchio's.
        contacts, datas: The constraints.
        owners: Names of the closures that they state, where it is known.
    """

    step = 1e-3

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
        turns = [i for i, n in enumerate(numbers) if (model.nqs[n], robot.kinds[i]) == (2, "revolute")]
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
        """Compute accelerations by `constraintDynamics`."""
        out: Array = np.asarray(self.call(q, v, force)())[self.v_at]
        return out

    def call(self, q: Array, v: Array, force: Array) -> Callable[[], object]:
        """Return `constraintDynamics` at a state (`aba` where there is no constraint)."""
        state = self._theirs(q, v, force)
        if not len(self.contacts):
            return lambda: pin.aba(self.model, self.data, *state)
        return lambda: pin.constraintDynamics(
            self.model, self.data, *state, self.contacts, self.datas, self.settings
        )

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Compute forces by `rnea`."""
        out: Array = np.array(pin.rnea(self.model, self.data, *self._theirs(q, v, a)))[self.v_at]
        return out

    def freedoms(self, q: Array) -> int:
        """Count freedoms by the rank of the constraints' Jacobian."""
        if not len(self.contacts):
            return int(self.model.nv)
        (x,) = self._theirs(q)
        pin.computeJointJacobians(self.model, self.data, x)
        for contact, data in zip(self.contacts, self.datas, strict=True):
            contact.calc(self.model, self.data, data)
        rows = np.asarray(pin.getConstraintsJacobian(self.model, self.data, self.contacts, self.datas))
        s = np.linalg.svd(rows, compute_uv=False)
        return int(self.model.nv) - int((s > 1e-9 * max(s[0], 1e-300)).sum())

    def run(self, q: Array, seconds: float) -> list[Array]:
        """Simulate by semi-implicit Euler steps; Pinocchio has no simulator of its own."""
        (x,), v, out = self._theirs(q), np.zeros(self.model.nv), []
        zero = np.zeros(self.model.nv)
        for step in range(round(seconds / self.step)):
            if len(self.contacts):
                a = pin.constraintDynamics(
                    self.model, self.data, x, v, zero, self.contacts, self.datas, self.settings
                )
            else:
                a = pin.aba(self.model, self.data, x, v, zero)
            v = v + self.step * np.asarray(a)
            x = pin.integrate(self.model, x, self.step * v)
            if step % 10 == 9:
                posture, cosines = np.array(x)[self.q_at], self.q_at[self.turned]
                posture[self.turned] = np.arctan2(x[cosines + 1], x[cosines])
                out.append(posture)
        return out


def ways(robot: HybridRobot, own: OwnFile) -> Iterator[Way]:
    """Yield the ways into Pinocchio: by its reader, and by constraint models."""
    if own.format in ("URDF", "MJCF"):
        yield f"its {own.format} reader", lambda: _read(robot, own)
    yield "rigid constraints", lambda: with_constraints(robot)


def _read(robot: HybridRobot, own: OwnFile) -> Engine:
    """Read the robot's own file with Pinocchio's reader."""
    contacts = pin.StdVec_RigidConstraintModel()
    root = [] if robot.base == "fixed" else [pin.JointModelFreeFlyer()]
    try:
        if own.format == "URDF":
            model = pin.buildModelFromXML(own.text, *root)
        else:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "robot.xml"
                file.write_text(own.text)
                model, *anchors = pin.buildModelAndConstraintsFromMJCF(str(file), *root)
            for anchor in (one for many in anchors for one in many):
                contacts.append(pin.convertToRigidConstraintModel(model, anchor))
    except (RuntimeError, ValueError) as error:
        raise NotComparableError(
            f"Pinocchio's reader refuses it: {' '.join(str(error).split())[:200]}"
        ) from None
    theirs = [str(name) for name in model.names][1:]
    names = theirs if robot.base == "fixed" else [robot.joints[0], *theirs[1:]]
    refuse_other_joints(robot, names, "Pinocchio's reader")
    return PinocchioEngine(robot, model, contacts, f"its {own.format} reader")


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
    """Yield the constraints of a closure: a point, a weld, or two points on the axis of a hinge."""
    ends = []
    for link in (closure.link_a, closure.link_b):
        body, R, p = robot.bodies.place[link]
        root = 0 if robot.base == "fixed" else 1
        joint = model.getJointId(robot.bodies.joints[body - 1].joint.name) if body else root
        ends.append((joint, pin.SE3(np.asarray(R), np.asarray(p))))
    for kind, frame_a, frame_b in joinings(closure, robot.bodies.size):
        contact = pin.ContactType.CONTACT_3D if kind == "point" else pin.ContactType.CONTACT_6D
        (joint_a, at_a), (joint_b, at_b) = ends
        yield pin.RigidConstraintModel(
            contact, model, joint_a, at_a * pin.SE3(frame_a), joint_b, at_b * pin.SE3(frame_b)
        )
