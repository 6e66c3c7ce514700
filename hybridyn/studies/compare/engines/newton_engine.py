"""Newton: the robot as its own readers see it, with SolverFeatherstone on the processor.

Newton computes in single precision; its objects are `Any` here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ....spatial import Array
from ....structure.robot import HybridRobot
from ..engine import (
    Engine,
    NotComparableError,
    SingleJoints,
    Way,
    refuse_other_joints,
    refuse_several_freedoms,
)
from ..own_file import OwnFile

#: Step whose change of rates gives the accelerations, which the solver computes at its start [s].
LONG_STEP = 1e-2
#: Arrays of a model that are set to zero, so that rigid bodies alone are left.
SWITCHED_OFF = (
    "joint_armature", "joint_damping", "joint_friction", "joint_stiffness", "joint_target_ke",
    "joint_target_kd", "joint_limit_ke", "joint_limit_kd",
)  # fmt: skip


class NewtonEngine:
    """A Newton model on a fixed base, stepped by SolverFeatherstone."""

    step = 1e-3

    def __init__(self, robot: HybridRobot, model: Any, way: str) -> None:
        import newton

        self._newton, self.robot, self.model, self.way = newton, robot, model, way
        for name in SWITCHED_OFF:
            if getattr(model, name, None) is not None:
                getattr(model, name).zero_()
        self.solver = newton.solvers.SolverFeatherstone(model, angular_damping=0.0)
        self.before, self.after, self.control = model.state(), model.state(), model.control()
        starts = model.joint_qd_start.numpy()
        widths = np.diff(starts)
        names = [str(label).rsplit("/", 1)[-1] for label in model.joint_label]
        moving = {name: i for i, name in enumerate(names) if widths[i]}
        refuse_other_joints(robot, list(moving), "Newton's reader")
        order = [moving[name] for name in robot.joints]
        q_starts = model.joint_q_start.numpy()
        self.map = SingleJoints(robot, q_starts[order], starts[order])
        loops = int(getattr(model, "equality_constraint_count", 0) or 0)
        self.notes: tuple[str, ...] = (f"the model states {loops} equalities",) if loops else ()

    def _set(self, q: Array, v: Array, force: Array) -> None:
        count, dofs = int(self.model.joint_coord_count), int(self.model.joint_dof_count)
        self.before.joint_q.assign(self.map.positions(q, count).astype(np.float32))
        self.before.joint_qd.assign(self.map.rates(v, dofs).astype(np.float32))
        self.control.joint_f.assign(self.map.rates(force, dofs).astype(np.float32))
        self._newton.eval_fk(self.model, self.before.joint_q, self.before.joint_qd, self.before)

    def forward(self, q: Array, v: Array, force: Array) -> Array:
        """Compute accelerations: the change of the rates over one step."""
        self.call(q, v, force)()
        change = self.after.joint_qd.numpy().astype(float) - self.before.joint_qd.numpy()
        return self.map.rates_back(change / LONG_STEP)

    def call(self, q: Array, v: Array, force: Array) -> Callable[[], object]:
        """Return one step of the solver."""
        self._set(q, v, force)
        return lambda: self.solver.step(self.before, self.after, self.control, None, LONG_STEP)

    def inverse(self, q: Array, v: Array, a: Array) -> Array | None:
        """Return None: Newton has no inverse dynamics."""
        return None

    def freedoms(self, q: Array) -> int:
        """Return the freedoms of the joints: SolverFeatherstone has no constraints."""
        return int(self.model.joint_dof_count)

    def run(self, q: Array, seconds: float) -> list[Array]:
        """Simulate in steps of a millisecond."""
        self._set(q, np.zeros(self.robot.nv), np.zeros(self.robot.nv))
        out = []
        for step in range(round(seconds / self.step)):
            self.before.clear_forces()
            self.solver.step(self.before, self.after, self.control, None, self.step)
            self.before, self.after = self.after, self.before
            if step % 10 == 9:
                out.append(self.map.back(self.before.joint_q.numpy().astype(float)))
        return out


def ways(robot: HybridRobot, own: OwnFile) -> Iterator[Way]:
    """Yield the way into Newton: its reader."""
    if own.format in ("URDF", "MJCF"):
        yield f"its {own.format} reader, SolverFeatherstone", lambda: _read(robot, own)


def _read(robot: HybridRobot, own: OwnFile) -> Engine:
    """Read the robot's own file with Newton's reader."""
    import warp

    warp.config.log_level = warp.LOG_WARNING  # before Newton is imported, or it writes to standard output
    import newton

    if robot.base != "fixed":
        raise NotComparableError("Newton is compared on a fixed base only")
    refuse_several_freedoms(robot, "Newton")
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    builder.gravity = tuple(float(g) for g in robot.gravity)
    try:
        if own.format == "URDF":
            builder.add_urdf(own.text, floating=False)
        else:
            builder.add_mjcf(own.text)
        model = builder.finalize(device="cpu")
    except (RuntimeError, ValueError, KeyError, TypeError, ImportError) as error:
        reason = " ".join(str(error).split())[:200]
        raise NotComparableError(f"Newton refuses it: {reason}") from None
    return NewtonEngine(robot, model, f"its {own.format} reader, SolverFeatherstone")
