"""Closure rows of one module at one posture through Pinocchio, for time integration.

`Closures` is built for batches; for a single sample it takes ten times as long as Pinocchio. Rows, residuals
and scales are the same (`linkage/closures.py` defines them, a test compares both).
"""

import numpy as np

from ..linkage.closures import TreeClosure
from ..linkage.couplings import CouplingRows
from ..linkage.retraction import Retraction
from ..spatial import Array, rotation_vector
from ..structure.mechanism import Mechanism

#: Largest residual of closed loops (relative to the module's length), in addition to rounding of the file.
CHART_CLOSED = 1e-11


class ScaledLoopRows:
    """Dimensionless closure residuals and rows on a module's spanning tree.

    Attributes:
        unit: Unit of each freedom, shape (nv,): xi = unit * scaled xi.
        rank: Number of independent rows.
        closed: Largest scaled residual of an assembled posture.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        import pinocchio as pin

        from ..structure.pinocchio_model import pinocchio_joint

        tree, closures = mechanism.spanning, mechanism.spanning_closures
        self.unit = mechanism.spanning_col_scale
        self.rank = tree.nv - mechanism.mobility
        self.closed = CHART_CLOSED + mechanism.rounding
        self._retraction = Retraction([j.kind for j in tree.joints])
        self._closures = closures
        self._scale = mechanism.spanning_row_scale
        self.model = pin.Model()
        for joint in tree.joints:
            self.model.addJoint(joint.parent, pinocchio_joint(joint), pin.SE3(joint.R, joint.p), joint.name)

        def frame(name: str, body: int, R: Array, p: Array) -> int:
            """Add a closure's frame to the model."""
            where = f"{name} {self.model.nframes}"
            return int(self.model.addFrame(pin.Frame(where, body, pin.SE3(R, p), pin.FrameType.OP_FRAME)))

        self._frames = [
            (frame(c.name, c.body_a, c.R_a, c.p_a), frame(c.name, c.body_b, c.R_b, c.p_b))
            for c in closures.closures
        ]
        self.data = self.model.createData()
        support = tree.support.astype(float)
        self._sign = [support[c.body_b] - support[c.body_a] for c in closures.closures]
        self._coupled = CouplingRows(tree, closures.couplings)

    def moved(self, q: Array, x: Array) -> Array:
        """Compute the posture at a scaled displacement x from q, shapes (nq,), (nv,)."""
        return self._retraction.move(q, self.unit * x)

    def at(self, q: Array) -> tuple[Array, Array]:
        """Compute scaled residuals (rows,) and scaled rows (rows, nv) at q, shape (nq,)."""
        import pinocchio as pin

        J = pin.computeJointJacobians(self.model, self.data, q).reshape(6, -1)  # of one freedom it gives (6,)
        residual, K = np.zeros(len(self._scale)), np.zeros((len(self._scale), self.model.nv))
        rows = self._closures.row_slices
        for c, (a, b), sign, at in zip(self._closures.closures, self._frames, self._sign, rows, strict=False):
            A = pin.updateFramePlacement(self.model, self.data, a)
            B = pin.updateFramePlacement(self.model, self.data, b)
            residual[at], K[at] = _closure(c, A.rotation, A.translation, B.rotation, B.translation, J * sign)
        if self._closures.couplings:
            first = len(self._scale) - len(self._closures.couplings)
            residual[first:], K[first:] = self._coupled.residual(q[None])[0], self._coupled.matrix(q[None])
        return residual * self._scale, K * self._scale[:, None] * self.unit


def _closure(c: TreeClosure, A: Array, pa: Array, B: Array, pb: Array, J: Array) -> tuple[Array, Array]:
    """Compute residual and rows of one closure from its frames and the relative Jacobian at the origin."""
    picked = A[:, c.translations]
    x, y, z = pb
    lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # minus the vector product with pb
    shift, slide = picked.T @ (pb - pa), picked.T @ (J[:3] + lever @ J[3:])
    if c.rotation == "free":
        return shift, slide
    if c.rotation == "fixed":
        turn, normals = rotation_vector(A.T @ B), A.T
    elif c.rotation == "perpendicular":
        turn, normals = np.array([A[:, 2] @ B[:, 2]]), _cross(B[:, 2], A[:, 2])[None]
    else:
        turn, normals = _tilt(A.T @ B[:, 2]), np.array([_cross(B[:, 2], A[:, i]) for i in (0, 1)])
    return np.concatenate([shift, turn]), np.concatenate([slide, normals @ J[3:]])


def _cross(a: Array, b: Array) -> Array:
    """Compute a x b (np.cross takes thirty times as long)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _tilt(axis: Array) -> Array:
    """Compute the tilt of an axis from z, as angles along x and y, shape (2,), [rad]."""
    sine = float(np.hypot(axis[0], axis[1]))
    if sine > 1e-9:
        return np.asarray(axis[:2] * (np.arctan2(sine, axis[2]) / sine))
    return np.array([axis[0] + (np.pi if axis[2] < 0 else 0.0), axis[1]])
