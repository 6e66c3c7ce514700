"""Postures, rates and the rule of least motion by least squares on Pinocchio's kinematics.

The rows are those of the file: closures, couplings, and what is prescribed of links and joints. Nothing knows
of modules. Of the package it imports `hybridyn.description`, the records that a robot's files state, and no
more.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from hybridyn.description.records import Closure, Description, Joint

Array = np.ndarray
#: What a robot stands in, and the joint by which it does.
WORLD, ROOT = "world", "root_joint"
#: Names of a link's coordinates: its position, then its turns about z, y' and x'' in reverse order.
LENGTHS, ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")
#: Singular values below this part of the largest belong to dependent rows.
DEPENDENT = 1e-8
#: Steps of Gauss and Newton, and the last one [m or rad].
STEPS, LAST = 30, 1e-13
#: Central difference of order six: steps and weights.
STENCIL = ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))
_CROSSES = {
    "free": (),
    "perpendicular": ((2, 2),),
    "parallel": ((0, 2), (1, 2)),
    "fixed": ((0, 1), (1, 2), (2, 0)),
}

#: Numbers over time: value, rate and acceleration, shape (n,) each.
Course = Callable[[float], tuple[Array, Array, Array]]


@dataclass(frozen=True)
class Wanted:
    """What is prescribed over time: coordinates of a link in another, or the position of a joint.

    Attributes:
        names: Coordinates; "pose" alone for all six, the turn by its rotation vector from `start`.
        course: Their numbers; for "pose" the position, then the rotation vector.
        link: The link, or the joint where there is no other link.
        other: The link in which the coordinates are measured.
        start: The rotation at time zero, of "pose".
    """

    link: str
    names: tuple[str, ...]
    course: Course
    other: str = ""
    start: Array = field(default_factory=lambda: np.eye(3))

    def rotation(self, t: float) -> tuple[Array, Array, Array]:
        """Return the rotation of a "pose", its angular velocity and acceleration, axes of the other link."""
        turn, rate, change = (x[3:] for x in self.course(t))
        J, h = pin.Jexp3(-turn), 1e-4
        slope = (pin.Jexp3(-turn - h * rate) - pin.Jexp3(-turn + h * rate)) / (2 * h)
        return pin.exp3(turn) @ self.start, J @ rate, J @ change + slope @ rate

    def pose(self, t: float) -> tuple[Array, Array, Array]:
        """Return a "pose" as `assemble` takes it, shapes (7,), (6,), (6,)."""
        R, w, dw = self.rotation(t)
        p, v, a = (x[:3] for x in self.course(t))
        return (
            np.concatenate([p, pin.Quaternion(R).coeffs()]),
            np.concatenate([v, w]),
            np.concatenate([a, dw]),
        )


def in_turn(description: Description) -> list[Joint]:
    """Return the joints, parents first."""
    left, done, out = list(description.joints), {description.root}, []
    while left:
        ready = [joint for joint in left if joint.parent in done]
        out += ready
        done |= {joint.child for joint in ready}
        left = [joint for joint in left if joint.child not in done]
    return out


def _joint(joint: Joint) -> pin.JointModel:
    if joint.kind in ("revolute", "continuous"):
        return pin.JointModelRevoluteUnaligned(joint.axis)
    if joint.kind == "prismatic":
        return pin.JointModelPrismaticUnaligned(joint.axis)
    if joint.kind == "planar":
        return pin.JointModelPlanar()
    return {"spherical": pin.JointModelSpherical, "floating": pin.JointModelFreeFlyer}[joint.kind]()


def _se3(M: Array) -> pin.SE3:
    return pin.SE3(M[:3, :3], M[:3, 3])


class Fitted:
    """A robot by its file's rows.

    Attributes:
        model: Pinocchio's tree; continuous joints are revolute ones.
        places: Joint and placement of each link.
        joints: The moving joints by name.
    """

    def __init__(self, description: Description, *, floating: bool = False) -> None:
        """Build the tree of a robot; its root is fixed to the `WORLD`, or moves in it."""
        self.description, self.model = description, pin.Model()
        self.places, self.joints = {WORLD: (0, pin.SE3.Identity())}, dict[str, Joint]()
        mount = Joint(
            ROOT, "floating" if floating else "fixed", WORLD, description.root, np.eye(4), np.eye(3)[2]
        )
        for joint in (mount, *in_turn(description)):
            parent, at = self.places[joint.parent]
            here = at * _se3(joint.placement)
            if joint.kind == "fixed":
                self.places[joint.child] = parent, here
                continue
            number = self.model.addJoint(parent, _joint(joint), here, joint.name)
            self.places[joint.child], self.joints[joint.name] = (number, pin.SE3.Identity()), joint
        self.data = self.model.createData()

    # ---------------------------------------------------------------- coordinates

    def slices(self, name: str) -> tuple[slice, slice]:
        """Return where a joint's coordinates and rates are."""
        m, i = self.model, self.model.getJointId(name)
        return slice(m.idx_qs[i], m.idx_qs[i] + m.nqs[i]), slice(m.idx_vs[i], m.idx_vs[i] + m.nvs[i])

    def taken(self, q: Array, slices: Mapping[str, slice], *, rates: bool = False) -> Array:
        """Return coordinates in the order of `model` from those of another tree, by its slices."""
        out = np.zeros(self.model.nv if rates else self.model.nq)
        for name in self.joints:
            at, x = self.slices(name)[int(rates)], q[slices[name]]
            both = not rates and len(x) == 2 and at.stop - at.start == 1
            out[at] = np.arctan2(x[1], x[0]) if both else x
        return out

    def given(self, x: Array, slices: Mapping[str, slice], size: int) -> Array:
        """Return coordinates in the order of another tree from those of `model`, shape (size,)."""
        out = np.zeros(size)
        for name in self.joints:
            own, at = x[self.slices(name)[0]], slices[name]
            turning = at.stop - at.start == 2 and len(own) == 1
            out[at] = [np.cos(own[0]), np.sin(own[0])] if turning else own
        return out

    def apart(self, x: Array, y: Array) -> Array:
        """Return the motion from one posture to another, shape (nv,); whole turns do not count."""
        out = np.array(pin.difference(self.model, x, y))
        for name, joint in self.joints.items():
            if joint.kind in ("revolute", "continuous"):
                at = self.slices(name)[1]
                out[at] = (out[at] + np.pi) % (2 * np.pi) - np.pi
        return out

    # ---------------------------------------------------------------- rows

    def at(self, x: Array) -> None:
        """Place all links."""
        pin.computeJointJacobians(self.model, self.data, x)

    def frame(self, link: str, inner: pin.SE3 | None = None) -> tuple[pin.SE3, Array]:
        """Return a frame of a link in the base, and its Jacobian, shape (6, nv), base axes."""
        joint, at = self.places[link]
        at = at if inner is None else at * inner
        if not joint:
            return at, np.zeros((6, self.model.nv))
        M = self.data.oMi[joint] * at
        J = pin.getJointJacobian(self.model, self.data, joint, pin.LOCAL)
        J = at.toActionMatrixInverse() @ J
        return M, np.concatenate([M.rotation @ J[:3], M.rotation @ J[3:]])

    def relative(
        self, a: tuple[str, pin.SE3 | None], b: tuple[str, pin.SE3 | None]
    ) -> tuple[Array, Array, Array]:
        """Return position and rotation of frame b in frame a, and their rates' Jacobian, shape (6, nv)."""
        (A, Ja), (B, Jb) = self.frame(*a), self.frame(*b)
        d = B.translation - A.translation
        linear = Jb[:3] - Ja[:3] + pin.skew(d) @ Ja[3:]
        J = np.concatenate([A.rotation.T @ linear, A.rotation.T @ (Jb[3:] - Ja[3:])])
        return A.rotation.T @ d, A.rotation.T @ B.rotation, J

    def of_closure(self, c: Closure) -> tuple[Array, Array]:
        """Return residuals and Jacobian of a closure's rows."""
        p, R, J = self.relative((c.link_a, _se3(c.frame_a)), (c.link_b, _se3(c.frame_b)))
        slides, pairs = list(c.translations), _CROSSES[c.rotation]
        values = [R[i, j] for i, j in pairs]
        turns = [np.cross(R[:, j], np.eye(3)[i]) @ J[3:] for i, j in pairs]
        return np.array([*p[slides], *values]), np.array([*J[slides], *turns]).reshape(-1, self.model.nv)

    def of_wanted(self, one: Wanted, t: float) -> tuple[Array, Array, Array]:
        """Return residuals, Jacobian and prescribed rates of what is prescribed at a time."""
        value, rate, _ = one.course(t)
        if not one.other:
            at, to = self.slices(one.link)
            J = np.zeros((1, self.model.nv))
            J[0, to] = 1.0
            return np.array(self._x[at] - value), J, rate
        p, R, J = self.relative((one.other, None), (one.link, None))
        if one.names == ("pose",):
            goal, w, _ = one.rotation(t)
            off = goal @ pin.log3(goal.T @ R)
            return np.concatenate([p - value[:3], off]), J, np.concatenate([rate[:3], w])
        rows = [(*LENGTHS, *ANGLES).index(name) for name in one.names]
        turns = np.array(rows) >= 3
        found = []
        for beyond in (False, True) if turns.sum() > 1 else (False,):
            here, whole = self._coordinates(p, R, J, beyond=beyond)
            off = here[rows] - value
            off[turns] = (off[turns] + np.pi) % (2 * np.pi) - np.pi
            found.append((off, whole[rows], rate))
        return min(found, key=lambda f: float(np.abs(f[0]).max()))

    @staticmethod
    def _coordinates(p: Array, R: Array, J: Array, *, beyond: bool = False) -> tuple[Array, Array]:
        """Return the six coordinates, and their rates' rows, also by the angles beyond the pole of pitch."""
        angles = pin.rpy.matrixToRpy(R)
        if beyond:  # the same rotation
            angles = np.array([angles[0] + np.pi, np.pi - angles[1], angles[2] + np.pi])
        to_rates = pin.rpy.computeRpyJacobianInverse(angles, pin.LOCAL_WORLD_ALIGNED)
        return np.concatenate([p, angles]), np.concatenate([J[:3], to_rates @ J[3:]])

    def coordinates(self, x: Array, link: str, other: str) -> tuple[Array, Array]:
        """Return the six coordinates of a link in another, and their Jacobian, shape (6, nv)."""
        self.at(x)
        return self._coordinates(*self.relative((other, None), (link, None)))

    def rows(self, x: Array, wanted: Sequence[Wanted] = (), t: float = 0.0) -> tuple[Array, Array, Array]:
        """Return residuals, Jacobian and prescribed rates of all rows, the loops' first."""
        self.at(x)
        self._x, n = x, self.model.nv
        parts = [self.of_closure(c) for c in self.description.closures]
        blocks = [(r, J, np.zeros(len(r))) for r, J in parts]
        for coupling in self.description.couplings:
            J, value = np.zeros((1, n)), -coupling.offset
            for name, ratio in coupling.terms:
                at, to = self.slices(name)
                J[0, to], value = ratio, value + ratio * x[at][0]
            blocks.append((np.array([value]), J, np.zeros(1)))
        blocks += [self.of_wanted(one, t) for one in wanted]
        residual, rates = (np.concatenate([np.zeros(0), *(b[i] for b in blocks)]) for i in (0, 2))
        return residual, np.concatenate([np.zeros((0, n)), *(b[1] for b in blocks)]), rates

    # ---------------------------------------------------------------- solving

    def close(self, x: Array, wanted: Sequence[Wanted], t: float, ease: Array, rank: int) -> Array | None:
        """Return the posture by least steps from a start, None where none is found."""
        size = np.inf
        for _ in range(STEPS):
            residual, J, _ = self.rows(x, wanted, t)
            step = ease * least(J * ease, -residual, rank)
            x, before, size = pin.integrate(self.model, x, step), size, np.abs(step).max(initial=0.0)
            if size < LAST or (size < 1e-10 and size > before / 2):
                break
        return x if size < 1e-9 and np.abs(self.rows(x, wanted, t)[0]).max(initial=0.0) < 1e-11 else None

    def rates(self, x: Array, wanted: Sequence[Wanted], t: float, ease: Array, rank: int) -> Array:
        """Return the rates of the least motion, measured by `ease`, at a posture that meets all rows."""
        _, J, rates = self.rows(x, wanted, t)
        return ease * least(J * ease, rates, rank)

    def values(self, x: Array, wanted: Sequence[Wanted], t: float = 0.0, ease: Array | None = None) -> Array:
        """Return the singular values of all rows."""
        J = self.rows(x, wanted, t)[1]
        return np.linalg.svd(J if ease is None else J * ease, compute_uv=False)

    def motions(self, x: Array, ease: Array, wanted: Sequence[Wanted] = (), t: float = 0.0) -> Array:
        """Return a basis of the motions that the rows leave, shape (nv, n), orthonormal by `ease`."""
        J = self.rows(x, wanted, t)[1] * ease
        _, s, Vt = np.linalg.svd(J)
        rank = int((s > DEPENDENT * s[0]).sum()) if len(s) else 0
        out: Array = ease[:, None] * Vt[rank:].T
        return out


def least(J: Array, b: Array, rank: int) -> Array:
    """Return the least solution of rows, of which so many are independent."""
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    out: Array = Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank])
    return out


def differenced(values: Mapping[int, Array], h: float) -> Array:
    """Return the derivative of numbers at -3 to 3 steps h."""
    return sum(w * (values[k] - values[-k]) for k, w in STENCIL) / h  # type: ignore[return-value]
