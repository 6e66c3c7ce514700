"""A module of a robot (its names, and its indices in q, v and tau), and its state at every sample."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import AssemblyError, ModelError
from ..joints.kinds import JointKind
from ..linkage.motion import Motion
from ..spatial import Array, Index
from .mechanism import Mechanism

#: Motors are independent if the least singular value of their part in orthonormal motions is above this.
INDEPENDENT_MOTORS = 1e-8
#: A smallest residual below this part of the module's length may be rounding in a coarse file.
COARSE = 1e-2


@dataclass(frozen=True, eq=False)
class Module:
    """One module of a robot.

    Attributes:
        name: Name for messages: that of its first platform or output, or else of its last body.
        base: Link that names the base body.
        outputs: Links that name the output bodies.
        legs: Legs as (name, joint names).
        joints: Names of all its joints.
        closures: Names of its closures and couplings.
        motors: Names of its driven joints.
        mechanism: The numbers, shared by equal modules.
        parent: Number of the module that carries it, or -1 if its base is the root body.
        parent_output: Number of the parent's output that is its base.
        q_index: Indices of its coordinates in the robot's q.
        v_index: Indices of its freedoms in the robot's v.
        motor_index: Indices of its motors in the robot's tau.
        motor_columns: Indices of its motors' freedoms in x.
    """

    name: str
    base: str
    outputs: tuple[str, ...]
    legs: tuple[tuple[str, tuple[str, ...]], ...]
    joints: tuple[str, ...]
    closures: tuple[str, ...]
    motors: tuple[str, ...]
    mechanism: Mechanism
    parent: int
    parent_output: int
    q_index: Index
    v_index: Index
    motor_index: Index
    motor_columns: Index

    @property
    def mobility(self) -> int:
        """Mobility of the module, the paper's N_k."""
        return self.mechanism.mobility

    @property
    def moving_motors(self) -> Index:
        """Numbers, among its motors, of the motors that the closures do not lock."""
        return np.flatnonzero(~self.mechanism.locked[self.motor_columns])

    @cached_property
    def driven(self) -> int:
        """Number of independent motions that its motors drive: less than they are if they are redundant."""
        m, moving = self.mechanism, self.motor_columns[self.moving_motors]
        if not len(moving) or not len(m.postures):
            return 0
        Psi = np.linalg.qr(m.generic_Psi / m.reduction.col_scale[:, None])[0]
        return int(np.linalg.matrix_rank(Psi[:, moving], tol=INDEPENDENT_MOTORS).max())

    @property
    def label(self) -> str:
        """Name of its only output, or its own name if it has several or none."""
        return self.outputs[0] if len(self.outputs) == 1 else self.name

    def freedom_names(self) -> list[str]:
        """Return names of the freedoms of the tree after the cuts: the joints' and six of each platform."""
        m = self.mechanism
        names = []
        for i, (joint, source) in enumerate(zip(m.tree.joints, m.spec.tree_joint, strict=True)):
            label = f"platform '{self.name}'" if source is None else f"joint '{self.joints[source]}'"
            axes = [f"{label} ({axis})" for axis in ("x", "y", "z", "rx", "ry", "rz")]
            width = m.tree.v_slices[i].stop - m.tree.v_slices[i].start
            names += axes if joint.kind is JointKind.FLOATING else [label] * width
        return names

    def freedom_units(self) -> list[str]:
        """Return the unit of each of these freedoms, "m" or "rad"."""
        kinds = (joint.kind for joint in self.mechanism.tree.joints)
        return [unit for kind in kinds for unit in ["m"] * kind.shift + ["rad"] * (kind.nv - kind.shift)]

    def named_rows(self) -> list[tuple[str, slice]]:
        """Return the name and the rows of each closure after the cuts.

        The order is: the author's closures, the wrists that carry platforms, the couplings.
        """
        closures, authors = self.mechanism.closures, len(self.mechanism.spec.closures)
        wrists = len(closures.closures) - authors
        carried = ([f"wrist of '{name}'" for name in self.outputs] * wrists)[:wrists]
        names = [*self.closures[:authors], *carried, *self.closures[authors:]]
        return list(zip(names, closures.row_slices, strict=True))


def check_mechanism(mechanism: Mechanism, name: str, source: str | None, closure_tolerance: float) -> None:
    """Raise if no posture closes the loops of a module, or if the rank of its closures is in doubt.

    Raises:
        AssemblyError: No posture closes the loops.
        ModelError: Singular values leave the rank in doubt.
    """
    if not len(mechanism.postures):
        best, mend = mechanism.best_residual, ""
        limit = f" (limit {closure_tolerance:.0e})"
        if best <= closure_tolerance:
            limit = ", but Newton's method does not converge to a closed posture there"
        elif best <= COARSE:
            mend = ". If the file is rounded that much, raise closure_tolerance"
        raise AssemblyError(
            f"module '{name}': no posture closes its loops; the best residual found is {best:.2g} of the "
            f"module's size{limit}. Check the closures' frames and axes, or give a home posture near an "
            f"assembled one{mend}",
            module=name,
            residual=best,
        )
    report = mechanism.reduction.report
    doubt = report.doubted if report.clear else (report.kept, report.dropped)
    if doubt and not mechanism.rank_is_given:
        raise ModelError(
            f"module '{name}': the rank of its closures is in doubt: of the relative singular values "
            f"{doubt[0]:.1e} and {doubt[1]:.1e}, the smaller may be a constraint or rounding in the file. "
            f"Set rank_tolerance to {np.sqrt(doubt[0] * doubt[1]):.0e} if it is rounding, or to "
            f"{doubt[1] / 10:.0e} if it is a constraint",
            file=source,
            element=name,
        )


@dataclass(eq=False)
class ModuleState:
    """State of one module at every sample.

    Attributes:
        whole: Motion of its whole tree relative to its base.
        motion: The part of it that belongs to the tree after the cuts.
        q: Positions on the tree after the cuts, shape (T, nq).
        v: Rates x_dot, shape (T, n).
        a: Accelerations x_ddot, shape (T, n); zero if none were given.
        V: Twist of the base, shape (T, 6), base frame.
        V_dot: Spatial acceleration of the base minus gravity, shape (T, 6), base frame.
        outputs: Twists V_o of the outputs, shape (T, outputs, 6), own frames.
        outputs_dot: Spatial accelerations of the outputs minus gravity, shape (T, outputs, 6), own frames.
        convective: The velocity term crm(V_o) v_o of these accelerations, where v_o is the relative twist,
            shape (T, outputs, 6).

    With `forward(..., classical=True)`, twists and accelerations are relative to an observer who moves with
    the velocity of the frame's origin: V_lin = 0, and V_dot_lin is the classical acceleration.
    """

    module: Module
    whole: Motion
    motion: Motion
    q: Array
    v: Array
    a: Array
    V: Array
    V_dot: Array
    outputs: Array
    outputs_dot: Array
    convective: Array

    @property
    def z(self) -> Array:
        """Positions of the whole tree, shape (T, its nq)."""
        assert self.whole.q is not None
        return self.whole.q

    @cached_property
    def K(self) -> Array:
        """Closure rows of the module, shape (T, rows, n)."""
        return self.mechanism.closures.matrix(self.motion)

    @property
    def mechanism(self) -> Mechanism:
        """The module's numbers."""
        return self.module.mechanism

    @property
    def placements(self) -> tuple[Array, Array]:
        """Placements (R, p) of the outputs in the base, shapes (T, outputs, 3, 3), (T, outputs, 3)."""
        bodies = list(self.mechanism.spec.outputs)
        return self.motion.R[:, bodies], self.motion.p[:, bodies]

    def spanning_accelerations(self, v: Array, x_ddot: Array) -> Array:
        """Compute accelerations of the module's spanning tree from those of the tree after the cuts.

        Args:
            v: Rates of the robot, shape (T, nv).
            x_ddot: Accelerations of the tree after the cuts, shape (T, n).

        Returns:
            Shape (T, nv of the module). The joints of wrists that were cut follow the bodies they connect.
        """
        m = self.mechanism
        if not m.spec.wrists:
            return m.cut.to_spanning(x_ddot)
        z_dot = m.cut.with_still_wrists(self.v)
        z_dot[:, m.cut.v_of] = v[:, self.module.v_index]
        return m.cut.to_spanning(m.wrists.accelerations(z_dot, x_ddot, self.whole))
