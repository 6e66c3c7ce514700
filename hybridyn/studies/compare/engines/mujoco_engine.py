"""MuJoCo: the robot as its own readers see it, and as hybridyn converts it to MJCF."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import ModelError
from ....spatial import Array
from ....structure.robot import HybridRobot
from ..engine import Engine, NotComparableError, Way, refuse_other_joints
from ..own_file import OwnFile

#: Widths of MuJoCo's positions and velocities by its number for the kind of joint: free, ball, slide, hinge.
POSITIONS, VELOCITIES = (7, 4, 1, 1), (6, 3, 1, 1)


class MujocoEngine:
    """A compiled MuJoCo model, without contacts, limits and passive forces."""

    def __init__(self, robot: HybridRobot, model: Any, way: str, notes: tuple[str, ...] = ()) -> None:
        import mujoco

        self._mujoco, self.robot, self.model, self.way, self.notes = mujoco, robot, model, way, notes
        for name in ("dof_damping", "dof_frictionloss", "dof_armature", "jnt_stiffness"):
            getattr(model, name)[:] = 0.0
        bits = mujoco.mjtDisableBit
        flags = (bits.mjDSBL_CONTACT, bits.mjDSBL_LIMIT, bits.mjDSBL_ACTUATION)
        model.opt.disableflags |= sum(int(bit) for bit in flags)
        model.opt.gravity[:] = robot.gravity
        self.data = mujoco.MjData(model)
        self.step = float(model.opt.timestep)
        joints = [model.joint(i).name for i in range(model.njnt)]
        base = [name for i, name in enumerate(joints) if model.jnt_type[i] == 0]
        named = {robot.joints[0] if robot.base != "fixed" and name in base[:1] else name: i
                 for i, name in enumerate(joints)}  # fmt: skip
        refuse_other_joints(robot, list(named), "MuJoCo")
        self.numbers = [named[name] for name in robot.joints]

    def _kinds(self) -> Iterator[tuple[str, slice, slice, slice, slice]]:
        """Yield kind, own q and v, and MuJoCo's for each joint."""
        for number, kind, q, v in zip(
            self.numbers, self.robot.kinds, self.robot.q_slices, self.robot.v_slices, strict=True
        ):
            word = int(self.model.jnt_type[number])
            at, dof = int(self.model.jnt_qposadr[number]), int(self.model.jnt_dofadr[number])
            yield kind, q, v, slice(at, at + POSITIONS[word]), slice(dof, dof + VELOCITIES[word])

    def _set(self, q: Array, v: Array, force: Array | None = None) -> None:
        """Write a state into MuJoCo's data."""
        data = self.data
        self._mujoco.mj_resetData(self.model, data)
        for kind, own, _, at, _ in self._kinds():
            x = q[own]
            if kind in ("spherical", "floating"):
                data.qpos[at] = [*x[:-4], x[-1], *x[-4:-1]]
            else:
                data.qpos[at] = np.arctan2(x[1], x[0]) if kind == "continuous" else x
        turns = self._turns(q)
        data.qvel[:] = turns.T @ v
        data.qfrc_applied[:] = 0.0 if force is None else turns.T @ force

    def _turns(self, q: Array) -> Array:
        """Return the matrix T of our rates from MuJoCo's, v = T qvel, shape (nv, nv); it is orthogonal."""
        T = np.zeros((self.robot.nv, self.model.nv))
        for kind, own_q, own, _, dof in self._kinds():
            T[own, dof] = np.eye(dof.stop - dof.start)
            if kind == "floating":
                x, y, z, w = q[own_q][3:]
                R = np.zeros(9)
                self._mujoco.mju_quat2Mat(R, np.array([w, x, y, z]))
                T[own, dof][:3, :3] = R.reshape(3, 3).T
        return T

    def _drift(self, q: Array, v: Array) -> Array:
        """Return our accelerations where MuJoCo's are zero: it has the world's axes for a free joint."""
        out = np.zeros(self.robot.nv)
        for kind, _, own, _, _ in self._kinds():
            if kind == "floating":
                out[own][:3] = -np.cross(v[own][3:], v[own][:3])
        return out

    def _ours(self) -> Array:
        """Return MuJoCo's positions as ours, shape (nq,)."""
        out = np.zeros(self.robot.nq)
        for kind, own, _, at, _ in self._kinds():
            x = self.data.qpos[at]
            if kind in ("spherical", "floating"):
                out[own] = [*x[:-4], *x[-3:], x[-4]]
            else:
                out[own] = [np.cos(x[0]), np.sin(x[0])] if kind == "continuous" else x
        return out

    def forward(self, q: Array, v: Array, force: Array) -> Array:
        """Compute accelerations by `mj_forward`, without the tolerance at which its solver stops.

        Beside a heavy body, the solver stops before it holds the equalities of a light one.
        """
        tolerance = self.model.opt.tolerance
        self.model.opt.tolerance = 0.0
        self.call(q, v, force)()
        self.model.opt.tolerance = tolerance
        out: Array = self._turns(q) @ self.data.qacc + self._drift(q, v)
        return out

    def call(self, q: Array, v: Array, force: Array) -> Callable[[], object]:
        """Return `mj_forward` at a state."""
        self._set(q, v, force)
        return lambda: self._mujoco.mj_forward(self.model, self.data)

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Compute forces by `mj_rne`."""
        self._set(q, v)
        self._mujoco.mj_fwdPosition(self.model, self.data)
        self._mujoco.mj_fwdVelocity(self.model, self.data)
        T = self._turns(q)
        self.data.qacc[:] = T.T @ (a - self._drift(q, v))
        out = np.zeros(self.model.nv)
        self._mujoco.mj_rne(self.model, self.data, 1, out)
        return T @ out

    def freedoms(self, q: Array) -> int:
        """Count freedoms by the rank of the equalities' Jacobian."""
        self._set(q, np.zeros(self.robot.nv))
        self._mujoco.mj_forward(self.model, self.data)
        rows = np.zeros((self.data.nefc, self.model.nv))
        if self.data.nefc:
            if self._mujoco.mj_isSparse(self.model):
                d = self.data
                self._mujoco.mju_sparse2dense(rows, d.efc_J, d.efc_J_rownnz, d.efc_J_rowadr, d.efc_J_colind)
            else:
                rows[:] = self.data.efc_J.reshape(rows.shape)
        s = np.linalg.svd(rows, compute_uv=False) if len(rows) else np.zeros(0)
        return int(self.model.nv) - int((s > 1e-9 * max(s[0], 1e-300)).sum() if len(s) else 0)

    def run(self, q: Array, seconds: float) -> list[Array]:
        """Simulate with the file's integrator and time step."""
        self._set(q, np.zeros(self.robot.nv))
        out = []
        steps = max(1, round(seconds / self.step))
        for step in range(steps):
            self._mujoco.mj_step(self.model, self.data)
            if step % max(1, steps // 100) == 0 or step == steps - 1:
                out.append(self._ours())
        return out


def ways(robot: HybridRobot, own: OwnFile) -> Iterator[Way]:
    """Yield the ways into MuJoCo: by its reader, and by hybridyn's MJCF."""
    if own.format in ("URDF", "MJCF"):
        yield f"its {own.format} reader", lambda: _read(robot, own)
    if own.format != "MJCF":
        yield "hybridyn convert to MJCF", lambda: _converted(robot)


def _compiled(text: str, folder: str | None = None) -> Any:
    import mujoco

    try:
        if folder:
            return mujoco.MjModel.from_xml_path(folder)
        return mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise NotComparableError(f"MuJoCo refuses it: {' '.join(str(error).split())[:200]}") from None


def _read(robot: HybridRobot, own: OwnFile) -> Engine:
    """Read the robot's own file with MuJoCo's reader."""
    model = _compiled("", own.path) if own.format == "MJCF" else _compiled(own.text)
    return MujocoEngine(robot, model, f"its {own.format} reader")


def _converted(robot: HybridRobot) -> Engine:
    from ....conversion.convert import convert

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.xml"
        try:
            done = convert(robot, file)
        except ModelError as error:
            raise NotComparableError(f"cannot be written as MJCF: {error}") from None
        model = _compiled("", str(file))
    names = [closure.name for closure in robot.description.closures]
    names += [coupling.name for coupling in robot.description.couplings]
    lost = tuple(line for line in done.losses if any(f"'{name}'" in line for name in names))
    return MujocoEngine(robot, model, "hybridyn convert to MJCF", tuple(f"lost: {line}" for line in lost))
