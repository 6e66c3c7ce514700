"""The spanning tree: its coordinates, and placements of links and constraint rows at a posture."""

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from hybridyn.description.records import Closure, Coupling, Curve, Description, Joint, JointKind

from .arithmetic import Arithmetic, Factor, Numbers
from .joints import FREEDOMS, SLIDES, displacement, moved, triad
from .rows import Frame, Row, constraint_rows, coordinate_rows, joint_rows

Base = Literal["fixed", "moving", "floating"]

ROOT_JOINT = "root_joint"
WORLD = "(world)"
#: Size of a scaled row: where all rows are zero to rounding, none is independent.
ROW = 1.0


class TreeJoint(NamedTuple):
    """A joint with its slices of q and v, and its geometry in the oracle's arithmetic."""

    joint: Joint
    at_q: slice
    at_v: slice
    R: Numbers
    t: Numbers
    triad: Numbers


class Loop(NamedTuple):
    """The rows between two frames: a closure's, or a tree joint's (its coordinates' rows come last)."""

    A: Frame
    B: Frame
    rows: list[Row]

    @property
    def at_a(self) -> Numbers:
        """Coefficients of the rows on the body of A, shape (rows, 6)."""
        return np.array([row.at_a for row in self.rows])

    @property
    def at_b(self) -> Numbers:
        """Coefficients of the rows on the body of B, shape (rows, 6)."""
        return np.array([row.at_b for row in self.rows])

    def drift(self, V: Numbers) -> Numbers:
        """Compute the rows' drift, shape (rows,), from the velocities of all bodies, shape (bodies, 6)."""
        return np.array([row.drift(V[self.A.body], V[self.B.body]) for row in self.rows])


@dataclass(frozen=True)
class Posture:
    """Kinematic quantities that depend on the posture alone.

    Attributes:
        joints: The moving joints, parents first.
        closures: The closures, in the description's order.
        G: Jacobian of body velocities over tree velocities, shape (6 bodies, nv).
        K: Closure rows, then coupling rows, over tree velocities, shape (rows, nv).
        scale: Divisor of each row of K, shape (rows,).
        factor: Factors of the scaled K, restricted to its free columns.
        Z: Null space of the scaled K, shape (nv, mobility), zero on a prescribed base.
        q: The positions, shape (nq,).
    """

    links: dict[str, Frame]
    joints: list[Loop]
    closures: list[Loop]
    G: Numbers
    K: Numbers
    scale: Numbers
    factor: Factor
    Z: Numbers
    q: Numbers

    @property
    def origins(self) -> list[Numbers]:
        """World positions of the bodies' origins, the world's own first."""
        return [self.links[WORLD].x] + [loop.B.x for loop in self.joints]


def depth_first(description: Description, base: Base) -> list[Joint]:
    """Order the joints depth-first, siblings as in q, fixed joints included, the base's joint first."""
    children: dict[str, list[Joint]] = {}
    for joint in description.joints:
        children.setdefault(joint.parent, []).append(joint)
    eye = np.eye(4)
    mount = Joint(
        ROOT_JOINT, "fixed" if base == "fixed" else "floating", WORLD, description.root, eye, eye[2, :3]
    )
    ordered, stack = [], [mount]
    while stack:
        joint = stack.pop()
        ordered.append(joint)
        stack += reversed(description.siblings(children.get(joint.child, [])))
    return ordered


class Tree:
    """The spanning tree of one robot, in one arithmetic.

    Attributes:
        nq, nv: Numbers of position and velocity coordinates.
        coordinates: Name of each moving joint to (kind, slice of q, slice of v), in the order of q and v.
        length: The longest offset in the robot, rounded to a power of two [m].
        unit: Unit of each scaled velocity coordinate, shape (nv,): `length` for slides, 1 for turns.
        free: The velocity coordinates that are not prescribed.
    """

    def __init__(
        self, description: Description, base: Base, arithmetic: Arithmetic, rank_tolerance: float
    ) -> None:
        self.description, self.arithmetic, self.rank_tolerance = description, arithmetic, rank_tolerance
        self.joints: list[TreeJoint] = []
        self.coordinates: dict[str, tuple[JointKind, slice, slice]] = {}
        self.nq = self.nv = 0
        for joint in depth_first(description, base):
            nq, nv = self.nq + FREEDOMS[joint.kind][0], self.nv + FREEDOMS[joint.kind][1]
            at_q, at_v = slice(self.nq, nq), slice(self.nv, nv)
            self.joints.append(
                TreeJoint(joint, at_q, at_v, *self._placement(joint.placement), triad(arithmetic, joint))
            )
            if joint.kind != "fixed":
                self.coordinates[joint.name] = (joint.kind, at_q, at_v)
            self.nq, self.nv = nq, nv
        self._ends = [(self._placement(c.frame_a), self._placement(c.frame_b)) for c in description.closures]
        offsets = [joint.placement for joint in description.joints]
        offsets += [frame for closure in description.closures for frame in (closure.frame_a, closure.frame_b)]
        longest = max((float(np.linalg.norm(offset[:3, 3])) for offset in offsets), default=0.0)
        self.length = 2.0 ** round(math.log2(longest)) if longest > 0 else 1.0
        self.unit = arithmetic.array(np.ones(self.nv))
        for kind, _, at in self.coordinates.values():
            self.unit[at.start : at.start + SLIDES.get(kind, 0)] = self.length
        self.free = slice(6 if base == "moving" else 0, self.nv)
        self._last: Posture | None = None

    def _placement(self, placement: Numbers) -> tuple[Numbers, Numbers]:
        """Return rotation and origin of a placement, with the rotation made orthonormal to rounding."""
        M = self.arithmetic.array(placement)
        R = M[:3, :3]
        three = 3 * np.eye(3)
        for _ in range(3):
            R = R @ (three - R.T @ R) / 2
        return R, M[:3, 3]

    def posture(self, q: Numbers) -> Posture:
        """Compute the placement of every link and every row at q, shape (nq,); the last one is remembered."""
        q = self.arithmetic.array(q)
        if self._last is None or not np.array_equal(self._last.q, q):
            self._last = self._posture(q)
        return self._last

    def _posture(self, q: Numbers) -> Posture:
        zero, eye = self.arithmetic.array(np.zeros(3)), self.arithmetic.array(np.eye(3))
        links, joints = {WORLD: Frame(zero, eye, zero, 0)}, []
        G = [self.arithmetic.array(np.zeros((6, self.nv)))]
        moved_by: list[list[int]] = [[]]  # columns of G that move each body: the others are zero
        for joint, at_q, at_v, R_P, t_P, axes in self.joints:
            A = _attach(links[joint.parent], R_P @ axes, t_P)
            if joint.kind == "fixed":
                links[joint.child] = A
                continue
            R, t = displacement(self.arithmetic, joint, q[at_q])
            B = Frame(A.x + A.E @ t, A.E @ R, zero, len(G))
            links[joint.child] = B._replace(E=B.E @ axes.T)
            loop = Loop(A, B, joint_rows(A, B, joint) + coordinate_rows(A, B, joint.kind))
            freedoms = at_v.stop - at_v.start
            columns = [*moved_by[A.body], *range(at_v.start, at_v.stop)]
            rates = -loop.at_a @ G[A.body][:, columns]
            for i in range(1, freedoms + 1):
                rates[-i, -i] += 1
            G.append(self.arithmetic.array(np.zeros((6, self.nv))))
            G[-1][:, columns] = self.arithmetic.solve(loop.at_b, rates)
            moved_by.append(columns)
            joints.append(loop)
        closures = [
            self._closure(c, ends, links)
            for c, ends in zip(self.description.closures, self._ends, strict=True)
        ]
        K, scale = self._closure_rows(closures, G, q)
        scaled = (K * self.unit / scale[:, None])[:, self.free]
        factor = self.arithmetic.factor(scaled, self.rank_tolerance, ROW)
        Z = self.arithmetic.array(np.zeros((self.nv, factor.Z.shape[1])))
        Z[self.free] = factor.Z
        return Posture(links, joints, closures, np.concatenate(G), K, scale, factor, Z, q)

    def _closure(
        self, closure: Closure, ends: tuple[tuple[Numbers, Numbers], ...], links: dict[str, Frame]
    ) -> Loop:
        A, B = _attach(links[closure.link_a], *ends[0]), _attach(links[closure.link_b], *ends[1])
        return Loop(A, B, constraint_rows(A, B, closure.translations, closure.rotation))

    def _closure_rows(self, closures: list[Loop], G: list[Numbers], q: Numbers) -> tuple[Numbers, Numbers]:
        """Compute K and the divisor of each of its rows."""
        K = [row.at_a @ G[loop.A.body] + row.at_b @ G[loop.B.body] for loop in closures for row in loop.rows]
        scale = [self.length if row.slides else 1.0 for loop in closures for row in loop.rows]
        for coupling in self.description.couplings:
            row = self.arithmetic.array(np.zeros(self.nv))
            for name, coefficient in coupling.terms:
                row[self.coordinates[name][2].start] += self.arithmetic.array(coefficient)[()]
            if coupling.curve:
                slope = self._power_sum(coupling.curve, q, 1)
                for name, factor in coupling.curve.terms:
                    row[self.coordinates[name][2].start] += slope * self.arithmetic.array(factor)[()]
            K.append(row)
            scale.append(self.arithmetic.sqrt((row * self.unit) @ (row * self.unit)))
        return self.arithmetic.array(K).reshape(-1, self.nv), self.arithmetic.array(scale)

    def _power_sum(self, curve: Curve, q: Numbers, order: int) -> Any:
        """Compute a derivative of a coupling's curve by its argument, power by power."""
        s = -self.arithmetic.array(curve.reference)[()]
        for name, factor in curve.terms:
            s += self.arithmetic.array(factor)[()] * q[self.coordinates[name][1]][0]
        out = 0 * s
        for power, coefficient in enumerate(curve.coefficients, 2):
            if power >= order:
                out += math.perm(power, order) * self.arithmetic.array(coefficient)[()] * s ** (power - order)
        return out

    def _bend(self, coupling: Coupling, q: Numbers, v: Numbers) -> Numbers:
        """Compute the drift of a coupling's row, shape (1,)."""
        if not coupling.curve:
            return self.arithmetic.array(np.zeros(1))
        rate = 0 * v[0]
        for name, factor in coupling.curve.terms:
            rate += self.arithmetic.array(factor)[()] * v[self.coordinates[name][2].start]
        return self.arithmetic.array([self._power_sum(coupling.curve, q, 2) * rate * rate])

    def integrate(self, q: Numbers, step: Numbers) -> Numbers:
        """Integrate a step of tree velocity x time from q (first order in each joint, on its manifold)."""
        q, step = self.arithmetic.array(q), self.arithmetic.array(step)
        for kind, at, at_v in self.coordinates.values():
            q[at] = moved(self.arithmetic, kind, q[at], step[at_v])
        return q

    def drifts(self, posture: Posture, v: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Compute body velocities G v, their drift g, (bodies, 6), and the closures' drift k, (rows,)."""
        V = (posture.G @ v).reshape(-1, 6)
        g = self.arithmetic.array(np.zeros(V.shape))
        for loop in posture.joints:
            missing = loop.drift(V) + loop.at_a @ g[loop.A.body]
            g[loop.B.body] = self.arithmetic.solve(loop.at_b, -missing[:, None])[:, 0]
        k = [self.arithmetic.array(np.zeros(0))]
        k += [
            loop.drift(V) + loop.at_a @ g[loop.A.body] + loop.at_b @ g[loop.B.body]
            for loop in posture.closures
        ]
        k += [self._bend(coupling, posture.q, v) for coupling in self.description.couplings]
        return V, g, np.concatenate(k)

    def least_change(self, posture: Posture, missing: Numbers) -> Numbers:
        """Compute the least-norm tree rates x with `K x = missing`, zero on a prescribed base."""
        x = self.arithmetic.array(np.zeros(self.nv))
        x[self.free] = posture.factor.least_norm(missing / posture.scale)
        return self.unit * x

    def values(self, posture: Posture, q: Numbers) -> Numbers:
        """Compute the residuals of closures and couplings, (rows,), in the order of K; slides in metres."""
        values = [row.value for loop in posture.closures for row in loop.rows]
        for coupling in self.description.couplings:
            value = -self.arithmetic.array(coupling.offset)[()]
            for name, coefficient in coupling.terms:
                value += coefficient * q[self.coordinates[name][1]][0]
            values.append(value + (self._power_sum(coupling.curve, q, 0) if coupling.curve else 0))
        return self.arithmetic.array(values)

    def turned(self, posture: Posture) -> Numbers:
        """Compute the cosines of axes that should agree but differ by more than a right angle."""
        axes = {"parallel": [2], "fixed": [0, 1, 2]}
        cosines = [
            loop.B.E[:, i] @ loop.A.E[:, i]
            for closure, loop in zip(self.description.closures, posture.closures, strict=True)
            for i in axes.get(closure.rotation, [])
        ]
        return self.arithmetic.array([c for c in cosines if c < 0])


def _attach(link: Frame, R: Numbers, t: Numbers) -> Frame:
    """Build a frame fixed to a link from its rotation and origin in the link."""
    offset = link.E @ t
    return Frame(link.x + offset, link.E @ R, link.r + offset, link.body)
