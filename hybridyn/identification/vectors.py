"""The vectors of all bodies, and the relations between them that joints and closures state."""

import numpy as np
import scipy.linalg

from ..dynamics.link_motion import body_motions
from ..joints.kinds import JointKind, Turn
from ..spatial import Array
from ..structure.bodies import BodyJoint
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .base_parameters import triangular
from .standard import StandardParameters

#: Relations smaller than this part are rounding of the file.
RELATED = 1e-7
#: Bodies are parallel if the axes of one differ by less than this in the other, at all generic postures.
STAYS_PARALLEL = 1e-6
#: Random values beyond the number of columns.
MORE = 20
#: Directions that both sides of a joint and of a closure share.
OF_TURN = {Turn.NONE: "all", Turn.ANGLE: "axis", Turn.CIRCLE: "axis", Turn.BALL: "none"}
OF_CLOSURE = {"fixed": "all", "parallel": "axis", "perpendicular": "none", "free": "none"}


class Vectors:
    """The vectors of all bodies, and the relations between them.

    Each body has four: three directions, of the length of the robot's size, and its origin.

    Attributes:
        robot: The robot.
        size: Its size [m].
        count: Number of bodies.
        relations: Combinations that rest in the world, each of shape (4 bodies,).
        rules: One sentence for each joint and closure.
        down: The direction of gravity; zero without gravity.
        home: Poses of the bodies at home.
    """

    def __init__(self, robot: HybridRobot) -> None:
        self.robot, self.size, self.count = robot, robot.bodies.size, len(robot.bodies.bodies)
        self.relations = [*np.eye(4 * self.count)[:4]] if robot.base == "fixed" else []
        self.rules: list[str] = []
        self.down = robot.gravity / max(float(np.linalg.norm(robot.gravity)), 1e-300)
        rest = np.zeros((1, robot.nv))
        self.home = body_motions(robot, robot.home[None], rest, rest)
        for j in robot.bodies.joints:
            kind = j.joint.kind
            axes, origin = OF_TURN[kind.turn], not kind.shift and kind is not JointKind.SCREW
            directions = {"all": np.eye(3), "axis": j.joint.axis[None], "none": np.zeros((0, 3))}[axes]
            ends = (j.parent, j.R, j.p), (j.child, np.eye(3), np.zeros(3))
            self._share(f"joint '{j.joint.name}'", ends, directions, origin)
        for c in robot.description.closures:
            frames = []
            for link, frame in ((c.link_a, c.frame_a), (c.link_b, c.frame_b)):
                body, R, p = robot.bodies.place[link]
                frames.append((body, R @ frame[:3, :3], R @ frame[:3, 3] + p))
            axes = OF_CLOSURE[c.rotation]
            directions = {"all": np.eye(3), "axis": np.eye(3)[2:], "none": np.zeros((0, 3))}[axes]
            self._share(f"closure '{c.name}'", tuple(frames), directions, len(c.translations) == 3)

        for module in robot.modules if robot.description.closures else ():
            self._keep_parallel(module)

    def _keep_parallel(self, module: Module) -> None:
        """Note that bodies which loops keep parallel, as parallelograms do, share all directions."""
        m = module.mechanism
        if not m.closures.rows:
            return
        of_tree = [self.robot.body_of_joint[module.joints[i - 1]] for i in m.spec.tree_body[1:]]
        bodies, R = [self.robot.bodies.place[module.base][0], *of_tree], m.tree.sweep(m.postures).R
        first: list[int] = []
        for i in range(len(bodies)):
            turned = [np.matmul(np.swapaxes(R[:, k], 1, 2), R[:, i]) for k in first]
            like = [k for k, C in zip(first, turned, strict=True) if np.ptp(C, axis=0).max() < STAYS_PARALLEL]
            if not like:
                first.append(i)
                continue
            C = np.matmul(R[0, like[0]].T, R[0, i])
            ends = (bodies[like[0]], C, np.zeros(3)), (bodies[i], np.eye(3), np.zeros(3))
            self._share(f"loops of module '{module.name}', parallel bodies", ends, np.eye(3), False)

    def _share(
        self, cause: str, ends: tuple[tuple[int, Array, Array], ...], directions: Array, origin: bool
    ) -> None:
        """Note that two bodies share directions, and perhaps the origin, of frames (body, R, p) on them."""
        (a, R_a, p_a), (b, R_b, p_b) = ends
        pairs = [((R_a @ x, 0.0), (R_b @ x, 0.0)) for x in directions]
        pairs += [((p_a, 1.0), (p_b, 1.0))] if origin else []
        self.relations += [self.vector(a, *one) - self.vector(b, *other) for one, other in pairs]
        if pairs:
            names = self.robot.bodies.bodies[a].name, self.robot.bodies.bodies[b].name
            moved = len(pairs) * (len(pairs) + 1) // 2
            self.rules.append(
                f"{cause}: {moved} of the ten numbers of '{names[1]}' may belong to '{names[0]}'"
            )

    def vector(self, body: int, x: Array, w: float) -> Array:
        """Return the vector (x, w) of a body as a combination of the vectors of all, shape (4 bodies,)."""
        out = np.zeros(4 * self.count)
        out[4 * body : 4 * body + 4] = *(np.asarray(x, dtype=float) / self.size), w
        return out

    def drawn(self, samples: int, width: int, relations: list[Array]) -> Array:
        """Draw values of the vectors that obey relations, shape (samples, 4 bodies, width)."""
        A = np.array(relations).reshape(-1, 4 * self.count)
        A = A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), RELATED)
        free = scipy.linalg.null_space(A, rcond=RELATED) if len(A) else np.eye(4 * self.count)
        values = np.random.default_rng(0).normal(size=(free.shape[1], samples * width))
        return (free @ values).reshape(-1, samples, width).swapaxes(0, 1)

    def rows(self, parameters: StandardParameters) -> Array:
        """Compute rows, over scaled parameters, whose rank is the count of the rules, shape (k, p)."""
        samples, on = len(parameters.names) + 3 * self.count + MORE, parameters.effects
        x = self.drawn(samples, 3, self.relations)
        still = [_still(x[:, 4 * body : 4 * body + 3]) for body in range(self.count)]
        h = self.drawn(samples, 1, self.relations + self._level(still, self.down))[..., 0]
        energy, weight = np.zeros((2, samples, len(parameters.names)))
        for body, at in (*parameters.bodies.items(), *parameters.payloads):
            own = slice(4 * body, 4 * body + 4)
            energy[:, at] += _of_body(x[:, own])
            weight[:, at[:4]] += h[:, own][:, [3, 0, 1, 2]]
        draw = np.random.default_rng(1)
        for term in parameters.terms:
            for joint, column in zip(term.joints, term.columns, strict=True):
                motion, lift = self._of_joint(term.symbol, joint, x, h, still)
                energy[:, column] += draw.normal(size=samples) if motion is None else motion
                weight[:, column] += lift
        idle = self._idle(x, still)
        energy -= idle @ np.linalg.lstsq(idle, energy)[0]
        parts = [energy * (on.inertia is not None), weight * (on.gravity is not None)]
        return triangular(np.concatenate(parts))

    def _of_joint(
        self, symbol: str, joint: str, x: Array, h: Array, still: list[Array]
    ) -> tuple[Array | None, Array | float]:
        """Return the energy and the height of a number of a law: those of bodies where these are the same.

        A rotor's energy is that of the moment of inertia about the joint's axis, if its base does not turn or
        turns about a direction at rest across the axis; at a slide, of the relative velocity, if its axis
        rests. A constant force is a weight at such a slide, if it rises.
        """
        j = next(j for j in self.robot.bodies.joints if j.joint.name == joint)
        child, axis = 4 * j.child, j.R @ j.joint.axis
        turns = 3 - still[j.parent].shape[1]
        if j.joint.kind.slides and _rests(axis, still[j.parent]):
            away, slope = self._slide(j), self._along(j.parent, axis) @ self.down
            if symbol == "Ia":
                return np.vecdot(*[_combined(away, x)] * 2), 0.0
            if symbol == "offset" and abs(slope) > RELATED:
                return np.zeros(len(x)), h @ away / slope
        across = turns == 2 and abs(still[j.parent][:, 0] @ axis) < RELATED
        if symbol == "Ia" and j.joint.kind.hinge and (not turns or across):
            one, other, along = (
                np.einsum("i,tij->tj", e, x[:, child : child + 3])
                for e in (*np.linalg.svd(j.joint.axis[None])[2][1:], j.joint.axis)
            )
            return (np.vecdot(one, one) + np.vecdot(other, other) - np.vecdot(along, along)) / 2, 0.0
        return None, 0.0

    def _idle(self, x: Array, still: list[Array]) -> Array:
        """Return energies that are zero, or that no motor feels, shape (samples, k).

        Those of a moving base; what a body with one axis has besides its moment of inertia; and products of
        the velocity of a slide whose axis rests with velocities across this axis.
        """
        out = [np.zeros((len(x), 0))] if self.robot.base == "fixed" else [_of_body(x[:, :4])]
        for body, fixed in enumerate(still):
            if fixed.shape[1] == 1:
                across = np.linalg.svd(fixed.T)[2][1:]
                one, other = (_combined(self.vector(body, e * self.size, 0.0), x) for e in across)
                out.append(
                    np.stack([np.vecdot(one, one) - np.vecdot(other, other), np.vecdot(one, other)], axis=1)
                )
        for j in self._slides(still):
            velocity = _combined(self._slide(j), x)
            level = self._level(still, self._along(j.parent, j.R @ j.joint.axis))
            out += [np.vecdot(velocity, _combined(vector, x))[:, None] for vector in level]
        return np.concatenate(out, axis=1)

    def _slides(self, still: list[Array]) -> list[BodyJoint]:
        """Return the slides whose axes rest in the world."""
        joints = (j for j in self.robot.bodies.joints if j.joint.kind.slides)
        return [j for j in joints if _rests(j.R @ j.joint.axis, still[j.parent])]

    def _slide(self, j: BodyJoint) -> Array:
        """Return the vector from a joint's place on its parent to its child."""
        return self.vector(j.child, np.zeros(3), 1.0) - self.vector(j.parent, j.p, 1.0)

    def _level(self, still: list[Array], up: Array) -> list[Array]:
        """Return combinations of vectors that do not move along a direction of the world."""
        out = [*np.eye(4 * self.count)[:4]] if self.robot.base != "fixed" else []
        for body, fixed in enumerate(still):
            if fixed.shape[1] == 1 and abs(abs(self._along(body, fixed[:, 0]) @ up) - 1.0) < RELATED:
                out += [self.vector(body, x * self.size, 0.0) for x in np.eye(3)]
        return out + [
            self._slide(j)
            for j in self._slides(still)
            if abs(self._along(j.parent, j.R @ j.joint.axis) @ up) < RELATED
        ]

    def _along(self, body: int, direction: Array) -> Array:
        """Return a direction of a body that rests in the world, in world axes."""
        return np.asarray(self.home[body].R[0] @ direction)


def _rests(direction: Array, still: Array) -> bool:
    """Return whether a direction is among those of its body that rest."""
    return bool(np.linalg.norm(direction - still @ still.T @ direction) < RELATED)


def _combined(vector: Array, x: Array) -> Array:
    """Compute the velocity of a combination of vectors, shape (samples, 3)."""
    used = np.flatnonzero(vector)
    return np.asarray(np.einsum("b,tbi->ti", vector[used], x[:, used]))


def _still(x: Array) -> Array:
    """Return the combinations of directions, values (samples, 3, 3), that rest, orthonormal, shape (3, k)."""
    U, sizes, _ = np.linalg.svd(x.swapaxes(0, 1).reshape(3, -1), full_matrices=False)
    return np.asarray(U[:, sizes <= RELATED * max(sizes[0], 1.0)])


def _of_body(x: Array) -> Array:
    """Compute twice the energy for each of a body's ten scaled numbers, shape (samples, 10).

    Args:
        x: Velocities of its vectors, shape (samples, 4, 3).
    """
    G = np.matmul(x, np.swapaxes(x, 1, 2))
    xx, yy, zz = (G[:, i, i] for i in range(3))
    moments = [yy + zz - xx, -4 * G[:, 0, 1], xx + zz - yy, -4 * G[:, 0, 2], -4 * G[:, 1, 2], xx + yy - zz]
    return np.stack([G[:, 3, 3], *(2 * G[:, i, 3] for i in range(3)), *(m / 2 for m in moments)], axis=1)
