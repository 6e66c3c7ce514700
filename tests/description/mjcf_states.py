"""A robot read from MJCF beside MuJoCo's own model of the same file, at the same states."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from hybridyn.description import Closure, read
from hybridyn.description.loop_signs import WeldedBodies
from hybridyn.structure.building import build_robot
from tests.judges.mujoco_matrices import mass_matrix
from tests.support.extras import needs

mujoco = needs("mjcf")

FREE, BALL = 0, 1


class Pair:
    """A robot and MuJoCo's model of the same file.

    Attributes:
        description: The robot as hybridyn reads it.
        robot: Its tree, loops left open: states need not be closed.
        model, data: MuJoCo's, compiled from the file without hybridyn.
    """

    def __init__(self, file: Path) -> None:
        self.description = read(file)
        self.robot = build_robot(replace(self.description, closures=(), couplings=()))
        if hasattr(mujoco, "MjLogConfig"):  # or it writes a file where the tests run
            quiet = mujoco.MjLogConfig.get()
            quiet.logto_file = False
            quiet.set()
        self.model = mujoco.MjModel.from_xml_path(str(file))
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(self.model)
        self.pin_data = self.robot.model.createData()

    def place(self, draw: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Set a random state in MuJoCo, closed or not, and return it as hybridyn's q and v."""
        m, d = self.model, self.data
        d.qpos[:], d.qvel[:] = draw.uniform(-1.5, 1.5, m.nq), draw.uniform(-1, 1, m.nv)
        mujoco.mj_normalizeQuat(m, d.qpos)
        mujoco.mj_forward(m, d)
        q, v = np.zeros(self.robot.model.nq), np.zeros(self.robot.model.nv)
        for joint in range(m.njnt):
            at_q, at_v, from_q, from_v = self._slices(joint)
            x = d.qpos[from_q]
            q[at_q] = np.r_[x[:-4], x[-3:], x[-4]] if m.jnt_type[joint] in (FREE, BALL) else x
            v[at_v] = d.qvel[from_v]
        return q, self.rates() @ d.qvel

    def _slices(self, joint: int) -> tuple[slice, slice, slice, slice]:
        """Return the slices of a joint in our q and v, and in MuJoCo's."""
        name = self.model.joint(joint).name
        known = self.robot.joints
        number = known.index(name) if name in known else known.index("root_joint")
        nq, nv = (
            (7, 6)
            if self.model.jnt_type[joint] == FREE
            else (4, 3)
            if self.model.jnt_type[joint] == BALL
            else (1, 1)
        )
        start_q, start_v = self.model.jnt_qposadr[joint], self.model.jnt_dofadr[joint]
        return (
            self.robot.q_slices[number], self.robot.v_slices[number],
            slice(start_q, start_q + nq), slice(start_v, start_v + nv),
        )  # fmt: skip

    def rates(self) -> np.ndarray:
        """Return the matrix of our rates by MuJoCo's: a free body's linear one is MuJoCo's in the world."""
        T = np.zeros((self.robot.model.nv, self.model.nv))
        for joint in range(self.model.njnt):
            _, rows, _, columns = self._slices(joint)
            part = np.eye(rows.stop - rows.start)
            if self.model.jnt_type[joint] == FREE:
                part[:3, :3] = self._free_rotation(joint).T
            T[rows, columns] = part
        return T

    def drift(self) -> np.ndarray:
        """Return our accelerations where MuJoCo's are zero."""
        out = np.zeros(self.robot.model.nv)
        for joint in range(self.model.njnt):
            if self.model.jnt_type[joint] == FREE:
                _, rows, _, columns = self._slices(joint)
                v = self.data.qvel[columns]
                out[rows][:3] = -np.cross(v[3:], self._free_rotation(joint).T @ v[:3])
        return out

    def _free_rotation(self, joint: int) -> np.ndarray:
        return self.data.xmat[self.model.jnt_bodyid[joint]].reshape(3, 3)

    def mass_matrix(self) -> np.ndarray:
        """Return MuJoCo's mass matrix."""
        return mass_matrix(self.model, self.data)

    def our_mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """Return Pinocchio's mass matrix of our model with the rotors, in MuJoCo's rates."""
        M = pin.crba(self.robot.model, self.pin_data, q)
        M = np.triu(M) + np.triu(M, 1).T
        for joint in self.robot.description.joints:
            if joint.rotor_inertia:
                column = self.robot.v_slices[self.robot.joints.index(joint.name)].start
                M[column, column] += joint.rotor_inertia * joint.gear_ratio**2
        T = self.rates()
        return T.T @ M @ T

    def our_bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return gravity and velocity terms of our model, in MuJoCo's rates."""
        return self.rates().T @ pin.rnea(self.robot.model, self.pin_data, q, v, self.drift())

    def our_rows(self, q: np.ndarray) -> np.ndarray:
        """Return MuJoCo's rows of its equalities, from our closures and couplings, in the order of its file.

        The rows of a weld's rotation have one sign in common that the sign of MuJoCo's quaternions decides.
        """
        pin.computeJointJacobians(self.robot.model, self.pin_data, q)
        description = self.description
        rows = {closure.name: self._closure_rows(closure) for closure in description.closures}
        for coupling in description.couplings:
            numbers = {name: self.robot.joints.index(name) for name, _ in coupling.terms}
            at = {name: q[self.robot.q_slices[number].start] for name, number in numbers.items()}
            row = np.zeros((1, self.robot.model.nv))
            for name, rate in coupling.rates(at).items():
                row[0, self.robot.v_slices[numbers[name]].start] = rate
            rows[coupling.name] = row
        names = [self.model.equality(number).name for number in range(self.model.neq)]
        T, start = self.rates(), 0
        theirs = self.data.efc_J.reshape(-1, self.model.nv)
        out = []
        for own in (rows[name] @ T for name in names if name in rows):
            if len(own) == 6:
                own[3:] *= np.sign((own[3:] * theirs[start + 3 : start + 6]).sum())
            start += len(own)
            out.append(own)
        return np.vstack(out)

    def poses(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses of all bodies that have a name, ours and MuJoCo's, shape (bodies, 4, 3)."""
        pin.computeJointJacobians(self.robot.model, self.pin_data, q)
        links = {link.name for link in self.description.links}
        bodies = [self.model.body(number) for number in range(1, self.model.nbody)]
        found = [body for body in bodies if body.name in links]
        ours = [self._frame(body.name, np.eye(4))[0].homogeneous[:3].T for body in found]
        theirs = [
            np.vstack([self.data.xmat[body.id].reshape(3, 3).T, self.data.xpos[body.id]]) for body in found
        ]
        return np.array(ours), np.array(theirs)

    def _closure_rows(self, closure: Closure) -> np.ndarray:
        (A, J_a), (B, J_b) = (
            self._frame(link, frame)
            for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
        )
        rows = J_a - J_b
        if closure.rotation == "free":
            return rows[:3]
        qa, qb = pin.Quaternion(A.rotation), pin.Quaternion(B.rotation)
        turning = [0.5 * (qb.conjugate() * pin.Quaternion(0.0, *column) * qa).vec() for column in rows[3:].T]
        return np.vstack([rows[:3], np.array(turning).T])

    def _frame(self, link: str, placement: np.ndarray) -> tuple[pin.SE3, np.ndarray]:
        """Return the pose of a frame on a link and its Jacobian, world axes, at its origin."""
        bodies, description = WeldedBodies(self.description), self.description
        above = {joint.child: joint.name for joint in description.joints}
        body = bodies.of[link]
        name = above.get(body, "root_joint" if self.robot.base != "fixed" else "universe")
        joint = self.robot.model.getJointId(name)
        frame = self.pin_data.oMi[joint] * pin.SE3(bodies.placement[link] @ placement)
        J = pin.getJointJacobian(self.robot.model, self.pin_data, joint, pin.WORLD)
        lever = pin.SE3(np.eye(3), frame.translation)
        return frame, lever.toActionMatrixInverse() @ J
