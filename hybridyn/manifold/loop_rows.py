"""Closure rows of one module at one posture through Pinocchio, for time integration.

`Closures` is built for batches; for a single sample Pinocchio places the frames in a tenth of the time.
Residuals and rows are those of `linkage.closures`.
"""

import numpy as np

from ..linkage.closure_rows import directions_of, residual_of, rows_of
from ..linkage.couplings import CouplingRows
from ..linkage.retraction import Retraction
from ..spatial import Array, cross
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
            frames = (A.rotation, A.translation), (B.rotation, B.translation)
            residual[at] = residual_of(c.translations, c.rotation, *frames)
            linear, angular = (J * sign).T[:, :3], (J * sign).T[:, 3:]  # at the base's origin
            at_b = linear + cross(angular, B.translation)
            directions = directions_of(c.translations, c.rotation, A.rotation, B.rotation[:, 2])
            K[at] = rows_of(directions, (at_b, angular))
        if self._closures.couplings:
            first = len(self._scale) - len(self._closures.couplings)
            residual[first:], K[first:] = self._coupled.residual(q[None])[0], self._coupled.matrix(q[None])
        return residual * self._scale, K * self._scale[:, None] * self.unit
