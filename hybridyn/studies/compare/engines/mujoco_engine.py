"""MuJoCo: the robot as its own readers see it, and as hybridyn converts it to MJCF."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import ModelError
from ....joints.kinds import JointKind
from ....spatial import Array
from ....structure.robot import HybridRobot
from ..methods import Method, Setting, Solver, grid
from ..peer_engine import NotComparableError, OwnFile, PeerEngine, at_points, refuse_other_joints
from ..states import DEPENDENT

#: Widths of MuJoCo's positions and velocities by its number for the kind of joint: free, ball, slide, hinge.
POSITIONS, VELOCITIES = (7, 4, 1, 1), (6, 3, 1, 1)
#: What is swept. At a closed posture only the impedance (solimp) and the iterations count for accelerations:
#: the reference acceleration of `solref` vanishes there.
SWEPT = grid(impedance=(0.9, 0.99, 0.999, 0.9999), iterations=(1, 2, 5, 20, 100))
#: Most velocities: 70 ms a call there, four seconds at four times as many.
MOST = 1_600


class MujocoEngine:
    """A compiled MuJoCo model.

    Attributes:
        mujoco, model, data: The package, its model and data.
        q_at: Index in MuJoCo's positions of each of the robot's; an endless joint's cosine and sine are one.
        v_at: Index in its velocities of each of the robot's.
    """

    def __init__(
        self, robot: HybridRobot, model: Any, way: str, notes: tuple[str, ...] = (), *, rigid: bool = True
    ) -> None:
        """Take a model; a rigid one is without contacts, limits and passive forces."""
        import mujoco

        self.robot, self.way, self.notes = robot, way, notes
        self.mujoco: Any = mujoco
        self.model: Any = model
        if rigid:
            for name in ("dof_damping", "dof_frictionloss", "dof_armature", "jnt_stiffness"):
                getattr(model, name)[:] = 0.0
            bits = mujoco.mjtDisableBit
            flags = (bits.mjDSBL_CONTACT, bits.mjDSBL_LIMIT, bits.mjDSBL_ACTUATION)
            model.opt.disableflags |= sum(int(bit) for bit in flags)
            model.opt.gravity[:] = robot.gravity
        self.data = mujoco.MjData(model)
        joints = [model.joint(i).name for i in range(model.njnt)]
        base = [name for i, name in enumerate(joints) if model.jnt_type[i] == 0]
        named = {robot.joints[0] if robot.base != "fixed" and name in base[:1] else name: i
                 for i, name in enumerate(joints)}  # fmt: skip
        refuse_other_joints(robot, list(named), "MuJoCo")
        q_at, v_at = list[int](), list[int]()
        for name, kind in zip(robot.joints, robot.kinds, strict=True):
            number = named[name]
            word, q, v = (int(x[number]) for x in (model.jnt_type, model.jnt_qposadr, model.jnt_dofadr))
            at = [*range(q, q + POSITIONS[word])]
            if kind.ball:  # its quaternions begin with the real part
                at = [*at[:-4], *at[-3:], at[-4]]
            q_at += 2 * at if kind.endless else at
            v_at += range(v, v + VELOCITIES[word])
        self.q_at, self.v_at = np.array(q_at, dtype=int), np.array(v_at, dtype=int)
        self._turned = np.array(
            [at.start for at in self._slices(JointKind.CONTINUOUS, robot.q_slices)], dtype=int
        )
        self._free = [
            *zip(
                *(self._slices(JointKind.FLOATING, x) for x in (robot.q_slices, robot.v_slices)), strict=True
            )
        ]

    def _slices(self, kind: JointKind, slices: Sequence[slice]) -> list[slice]:
        """Return the slices of the joints of a kind."""
        return [at for own, at in zip(self.robot.kinds, slices, strict=True) if own == kind]

    def place(self, q: Array, v: Array) -> None:
        """Write a state into MuJoCo's data."""
        self.data.qpos[self.q_at] = q
        if len(self._turned):
            self.data.qpos[self.q_at[self._turned]] = np.arctan2(q[self._turned + 1], q[self._turned])
        self.data.qvel[:] = self._theirs(q, v)

    def state(self) -> tuple[Array, Array]:
        """Return the state in MuJoCo's data, shapes (nq,) and (nv,)."""
        q = self.data.qpos[self.q_at]
        angles = q[self._turned]
        q[self._turned], q[self._turned + 1] = np.cos(angles), np.sin(angles)
        return q, self._ours(q, self.data.qvel)

    def _set(self, q: Array, v: Array, force: Array | None = None) -> None:
        """Begin at a state, under forces on the robot's coordinates."""
        self.mujoco.mj_resetData(self.model, self.data)
        self.place(q, v)
        self.data.qfrc_applied[:] = 0.0 if force is None else self._theirs(q, force)

    def _theirs(self, q: Array, x: Array) -> Array:
        """Return rates or forces as MuJoCo's, which has the world's axes for the way of a free joint."""
        out = np.zeros(self.model.nv)
        out[self.v_at] = x
        for of_q, of_v in self._free:
            out[self.v_at[of_v][:3]] = self._rotation(q[of_q]) @ x[of_v][:3]
        return out

    def _ours(self, q: Array, x: Array) -> Array:
        """Return MuJoCo's rates, accelerations or forces as ours."""
        out: Array = np.array(x)[self.v_at]
        for of_q, of_v in self._free:
            out[of_v][:3] = self._rotation(q[of_q]).T @ out[of_v][:3]
        return out

    def _rotation(self, place: Array) -> Array:
        """Return the rotation matrix of a free joint."""
        x, y, z, w = place[3:]
        R = np.zeros(9)
        self.mujoco.mju_quat2Mat(R, np.array([w, x, y, z]))
        return R.reshape(3, 3)

    def _drift(self, v: Array) -> Array:
        """Return our accelerations where MuJoCo's are zero: its axes do not turn with a free joint."""
        out = np.zeros(self.robot.nv)
        for _, of_v in self._free:
            out[of_v][:3] = -np.cross(v[of_v][3:], v[of_v][:3])
        return out

    def forward(self, q: Array, v: Array, force: Array) -> Array:
        """Compute accelerations by `mj_forward`, without the tolerance at which its solver stops.

        Beside a heavy body, the solver stops before it holds the equalities of a light one.
        """
        tolerance = self.model.opt.tolerance
        self.model.opt.tolerance = 0.0
        self._set(q, v, force)
        self.mujoco.mj_forward(self.model, self.data)
        self.model.opt.tolerance = tolerance
        return self._ours(q, self.data.qacc) + self._drift(v)

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Compute forces by `mj_rne`."""
        self._set(q, v)
        self.mujoco.mj_fwdPosition(self.model, self.data)
        self.mujoco.mj_fwdVelocity(self.model, self.data)
        self.data.qacc[:] = self._theirs(q, a - self._drift(v))
        out = np.zeros(self.model.nv)
        self.mujoco.mj_rne(self.model, self.data, 1, out)
        return self._ours(q, out)

    def freedoms(self, q: Array) -> int:
        """Count freedoms by the rank of the equalities' Jacobian."""
        d = self.data
        self._set(q, np.zeros(self.robot.nv))
        self.mujoco.mj_forward(self.model, d)
        if not d.nefc:
            return int(self.model.nv)
        rows = np.zeros((d.nefc, self.model.nv))
        if self.mujoco.mj_isSparse(self.model):
            self.mujoco.mju_sparse2dense(rows, d.efc_J, d.efc_J_rownnz, d.efc_J_rowadr, d.efc_J_colind)
        else:
            rows[:] = d.efc_J.reshape(rows.shape)
        return int(self.model.nv - np.linalg.matrix_rank(rows, rtol=DEPENDENT))


def ways(robot: HybridRobot, own: OwnFile) -> Iterator[tuple[str, Callable[[], PeerEngine]]]:
    """Yield the ways into MuJoCo: by its reader, and by hybridyn's MJCF."""
    if own.format in ("URDF", "MJCF"):
        yield f"its {own.format} reader", partial(_read, robot, own)
    if own.format != "MJCF":
        yield "hybridyn convert to MJCF", partial(_converted, robot)


def _compiled(load: Callable[[str], Any], given: str) -> Any:
    try:
        return load(given)
    except ValueError as error:
        raise NotComparableError(f"MuJoCo refuses it: {' '.join(str(error).split())[:200]}") from None


def _read(robot: HybridRobot, own: OwnFile) -> PeerEngine:
    """Read the robot's own file with MuJoCo's reader."""
    from mujoco import MjModel

    own_path = own.format == "MJCF"
    load, given = (MjModel.from_xml_path, own.path) if own_path else (MjModel.from_xml_string, own.text)
    return MujocoEngine(robot, _compiled(load, given), f"its {own.format} reader")


def _converted(robot: HybridRobot) -> PeerEngine:
    """Write the robot as MJCF."""
    model, losses = converted(robot)
    names = [closure.name for closure in robot.description.closures]
    names += [coupling.name for coupling in robot.description.couplings]
    lost = tuple(line for line in losses if any(f"'{name}'" in line for name in names))
    return MujocoEngine(robot, model, "hybridyn convert to MJCF", tuple(f"lost: {line}" for line in lost))


def converted(robot: HybridRobot) -> tuple[Any, tuple[str, ...]]:
    """Return the model that MuJoCo makes of the robot as MJCF, and what was lost on the way.

    Raises:
        NotComparableError: It cannot be written, or MuJoCo refuses it.
    """
    from mujoco import MjModel

    from ....conversion.convert import convert

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.xml"
        try:
            done = convert(robot, file)
        except ModelError as error:
            raise NotComparableError(f"cannot be written as MJCF: {error}") from None
        return _compiled(MjModel.from_xml_path, str(file)), tuple(done.losses)


def closed(robot: HybridRobot, rigid: bool = True) -> MujocoEngine:
    """Return a robot with its closures, as `convert` writes it; a rigid one is nothing but these and bodies.

    Raises:
        NotComparableError: MuJoCo is not installed, or cannot state the robot.
    """
    try:
        import mujoco
    except ImportError:
        raise NotComparableError("the package mujoco is not installed") from None
    if robot.base != "fixed":
        raise NotComparableError("only robots on a fixed base are compared")
    robot = at_points(robot) if rigid else robot
    own = MujocoEngine(robot, converted(robot)[0], "", rigid=rigid)
    if rigid:
        mujoco.mj_setConst(own.model, own.data)  # rotors are gone
        own.model.opt.tolerance = 0.0
        own.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
    return own


def _setup(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the direct model."""
    own = closed(robot)
    motors = own.v_at[robot.motor_v]

    def at(setting: Setting) -> Solver:
        def solve(q: Array, v: Array, tau: Array) -> Array:
            own.model.eq_solimp[:, :2] = setting["impedance"]
            own.model.opt.iterations = int(setting["iterations"])
            own.place(q, v)
            own.data.qfrc_applied[motors] = tau
            own.mujoco.mj_forward(own.model, own.data)
            out: Array = own.data.qacc[own.v_at]
            return out

        return solve

    return at


#: MuJoCo leaves J_dot v out, which shows as error. There is no inverse model: `mj_inverse` gives efforts on
#: every joint, not the motors' alone.
METHODS = (Method("MuJoCo", "ddm", _setup, SWEPT, most=MOST),)
