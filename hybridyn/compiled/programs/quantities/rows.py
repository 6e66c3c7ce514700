"""Rows of compiled models that make up the closed-loop quantities.

    M e_j = (idm(q, 0, s E e_j) - idm(q, 0, 0)) / s                        a row for each coordinate
    c + g = idm(q, v, E_dot u)                                              one row
    c     = (idm(q, s v, s^2 E_dot u) + idm(q, -s v, s^2 E_dot u) - 2 idm(q, 0, 0)) / (2 s^2)
    J     = J_tree E, with J_tree from the poses of kinematics(q)           one row
    D     = J (ddm(q, 0, s J^T e_j) - ddm(q, 0, 0)) / s over u              a row for each wrench

The powers of two s are so large that weights and springs take no digit from inertial terms; what is odd in
the rates (friction) cancels. Efforts along other joints than the motors are H^T tau, H = d(motors)/du.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ....dynamics.energy import add_energy_of_laws, leg_bodies
from ....dynamics.quantities.engine import polar_form
from ....dynamics.quantities.model import of_brackets
from ....effects.choice import Effects
from ....spatial import Array, Index, Mask
from ....structure.robot import HybridRobot
from ...library.calls import Numbers
from ..body_rows import WIDTH
from .following import Following

#: Exponent of the factor on accelerations, and of rates after their factor.
FASTER = 30

Computed = tuple[Numbers, Mask]
#: Computes a model by its name at states q, v, a: its result, and which samples can be trusted.
Run = Callable[[str, Array, Array, Array], Computed]


@dataclass(frozen=True, eq=False)
class QuantityRows:
    """Quantities at samples that compiled models compute, each with which of them can be trusted.

    Attributes:
        robot: The robot.
        efforts: Computes forces on some entries of v, those of the motors and of a floating base, at states
            q, v, a.
        driven: These entries, shape (k,).
        moves: Motions of its joints over the independent coordinates.
    """

    robot: HybridRobot
    efforts: Callable[[Array, Array, Array], Computed]
    driven: Index
    moves: Following

    @property
    def by_motors(self) -> bool:
        """Whether the independent coordinates are the driven ones, in their order."""
        return np.array_equal(self.driven, self.moves.u.columns)

    def mass(self, q: Array) -> Computed:
        """Compute the mass matrix, shape (T, N, N)."""
        E, good = self.moves.map(q)
        T, lanes = len(q), self.moves.u.size
        a = np.swapaxes(E, 1, 2).reshape(T * lanes, -1) * 2.0**FASTER
        tau, trusted = self.efforts(np.repeat(q, lanes, axis=0), np.zeros_like(a), a)
        rest, still = self._at_rest(q)
        tau = (tau.reshape(T, lanes, -1) - rest[:, None]) * 2.0**-FASTER
        good &= trusted.reshape(T, lanes).all(axis=1) & still
        M = self._along(E, np.swapaxes(tau, 1, 2))
        return (M + np.swapaxes(M, 1, 2)) / 2, good

    def bias(self, q: Array, v: Array, base: Array) -> Computed:
        """Compute c + g, shape (T, N), with the acceleration of a prescribed base, shape (T, 6)."""
        a, good = self.moves.drift(q, v)
        if self.robot.base == "moving":
            a[:, :6] = base
        tau, trusted = self.efforts(q, v, a)
        force, mapped = self._mapped(q, tau)
        return force, good & trusted & mapped

    def coriolis(self, q: Array, v: Array) -> Computed:
        """Compute c, shape (T, N)."""
        d, good = self.moves.drift(q, v)
        s = FASTER - np.frexp(np.abs(v).max(axis=1, initial=0.0))[1][:, None]
        fast, a = np.ldexp(v, s), np.ldexp(d, 2 * s)
        (there, one), (back, other), (rest, still) = (
            self.efforts(q, fast, a), self.efforts(q, -fast, a), self._at_rest(q),
        )  # fmt: skip
        force, mapped = self._mapped(q, np.ldexp((there + back) / 2 - rest, -2 * s))
        return force, good & one & other & still & mapped

    def coriolis_matrix(self, q: Array, v: Array) -> Computed:
        """Compute C with c = C u, shape (T, N, N): the polar form of c between v and the columns of dq/du."""
        E, good = self.moves.map(q)
        parts = [good]

        def force(x: Array, rates: Array) -> Array:
            """Compute c in C, and note where it can be trusted."""
            out, trusted = self.coriolis(x, rates)
            parts.append(np.asarray(trusted.reshape(len(q), -1).all(axis=1)))
            return out

        C = polar_form(self.robot, force, q, v, E)
        if self.robot.base == "floating":
            M, known = self.mass(q)
            parts.append(known)
            C[:, :, :6] += of_brackets(M, v)
        return C, np.logical_and.reduce(parts)

    def gravity(self, q: Array) -> Computed:
        """Compute g, shape (T, N)."""
        rest, good = self._at_rest(q)
        force, mapped = self._mapped(q, rest)
        return force, good & mapped

    def _at_rest(self, q: Array) -> Computed:
        """Return the forces that hold the robot at rest, shape (T, k)."""
        still = np.zeros((len(q), self.robot.nv))
        return self.efforts(q, still, still)

    def _mapped(self, q: Array, tau: Numbers) -> Computed:
        """Return efforts along u, shape (T, N), from those on the driven entries."""
        if self.by_motors:
            return tau, np.ones(len(q), dtype=bool)
        E, good = self.moves.map(q)
        return self._along(E, tau[:, :, None])[:, :, 0], good

    def _along(self, E: Numbers, tau: Numbers) -> Numbers:
        """Return efforts along u, shape (T, N, c), from columns of those on driven entries, (T, k, c)."""
        if self.by_motors:
            return tau
        out: Array = np.matmul(np.swapaxes(E[:, self.driven], 1, 2), tau)
        return out


def link_rows(run: Run, moves: Following, q: Array, links: Sequence[str], axes: str) -> Computed:
    """Compute the Jacobians of k links, shape (T, 6 k, N), and which samples can be trusted.

    The Jacobian of the spanning tree, whose columns come from the poses on the way to the root, times dq/du.
    """
    still = np.zeros((len(q), moves.robot.nv))
    rows, trusted = run("kinematics", q, still, still)
    E, good = moves.map(q)
    x = rows.reshape(len(q), -1, WIDTH)
    return np.concatenate([_link_jacobian(moves.robot, x, E, link, axes) for link in links], axis=1), (
        good & trusted
    )


def _link_jacobian(robot: HybridRobot, x: Numbers, E: Numbers, link: str, axes: str) -> Numbers:
    """Compute the Jacobian of a link, shape (T, 6, N), from the motions of bodies, (T, bodies, WIDTH)."""
    columns, bodies, linear, angular = _way_to_root(robot, link)
    body, R, p = robot.bodies.place[link]
    turned = x[:, [*bodies, body], :9].reshape(len(x), -1, 3, 3)
    arm = x[:, None, body, 9:12] + (turned[:, -1] @ p)[:, None] - x[:, bodies, 9:12]
    w = np.matmul(turned[:, :-1], angular[..., None])[..., 0]
    twists = [np.matmul(turned[:, :-1], linear[..., None])[..., 0] + np.cross(w, arm), w]
    if axes == "link":
        twists = [np.matmul(part, turned[:, -1] @ R) for part in twists]
    out: Array = np.matmul(np.swapaxes(np.concatenate(twists, axis=2), 1, 2), E[:, columns])
    return out


def delassus_rows(run: Run, moves: Following, q: Array, links: Sequence[str], axes: str) -> Computed:
    """Compute J M^-1 J^T of k links, shape (T, 6 k, 6 k), and which samples can be trusted.

    The direct model at rest, under motor efforts that do the work of unit wrenches on the links.

    Args:
        run: Computes a model of the robot, whose base does not float.
        moves: Motions of its joints over its motors, as many as its freedoms.
        q: Positions, shape (T, nq).
        axes: As in `hybridyn.delassus`.
    """
    J, good = link_rows(run, moves, q, links, axes)
    T, rows, motors = J.shape
    tau = J.reshape(T * rows, motors) * 2.0**FASTER
    still = np.zeros((T * rows, moves.robot.nv))
    pushed, trusted = run("ddm", np.repeat(q, rows, axis=0), still, tau)
    weighed, at_rest = run("ddm", q, still[:T], np.zeros((T, motors)))
    u_dot = (pushed.reshape(T, rows, -1) - weighed[:, None])[:, :, moves.u.columns] * 2.0**-FASTER
    D = np.matmul(u_dot, np.swapaxes(J, 1, 2))
    good = good & trusted.reshape(T, rows).all(axis=1) & at_rest
    return (D + np.swapaxes(D, 1, 2)) / 2, good


def _way_to_root(robot: HybridRobot, link: str) -> tuple[Index, list[int], Array, Array]:
    """Return the freedoms that move a link in the spanning tree.

    Returns:
        Their entries of v, shape (k,), the bodies that they move, and linear and angular part of the motion
        subspace in these bodies' frames, shape (k, 3) each.
    """
    columns, bodies, S = [np.zeros(0, dtype=int)], list[int](), [np.zeros((0, 6))]
    k, number = robot.body_owner[robot.bodies.place[link][0]]
    while k >= 0:
        module = robot.modules[k]
        if k == 0 and robot.base == "floating":
            break
        tree = module.mechanism.spanning
        moved = np.flatnonzero(tree.support[number])
        columns.append(module.v_index[moved])
        bodies += [robot.body_of_joint[module.joints[i]] for i in tree.dof_body[moved] - 1]
        S.append(np.concatenate([tree.S_linear, tree.S_angular], axis=1)[moved])
        k, number = robot.body_owner[robot.bodies.place[module.base][0]]
    if robot.base == "floating":
        columns, bodies, S = [*columns, np.arange(6)], [*bodies, *[0] * 6], [*S, np.eye(6)]
    subspace = np.concatenate(S)
    return np.concatenate(columns), bodies, subspace[:, :3], subspace[:, 3:]


def inertial_bodies(robot: HybridRobot, on: Effects) -> tuple[list[int], Array, Array, Array]:
    """Return the bodies whose inertia counts: numbers, mass (k,), centre (k, 3), inertia there (k, 3, 3)."""
    legs = leg_bodies(robot) if on.leg_inertia is None else set()
    numbers = [
        i
        for i, body in enumerate(robot.bodies.bodies)
        if (i or robot.base != "fixed") and i not in legs and not body.massless
    ]
    bodies = [robot.bodies.bodies[i] for i in numbers]
    mass = np.array([body.mass for body in bodies])
    com = np.array([body.com for body in bodies]).reshape(-1, 3)
    return numbers, mass, com, np.array([body.inertia for body in bodies]).reshape(-1, 3, 3)


def energy_rows(run: Run, robot: HybridRobot, on: Effects, q: Array, v: Array) -> Computed:
    """Compute kinetic and potential energy, shape (T, 2), and which samples can be trusted."""
    rows, trusted = run("kinematics", q, v, np.zeros_like(v))
    counted, mass, com, inertia = inertial_bodies(robot, on)
    x = rows.reshape(len(q), -1, WIDTH)[:, counted]
    R, w = x[:, :, :9].reshape(*x.shape[:2], 3, 3), x[:, :, 15:18]
    arm = np.matmul(R, com[:, :, None])[..., 0]
    own = np.matmul(np.swapaxes(R, 2, 3), w[..., None])
    spin = np.matmul(inertia, own)
    speed = x[:, :, 12:15] + np.cross(w, arm)
    kinetic = ((speed**2).sum(axis=2) @ mass + (own * spin).sum(axis=(1, 2, 3))) / 2
    weight = robot.gravity if on.gravity is not None else np.zeros(3)
    potential = -((x[:, :, 9:12] + arm) @ weight) @ mass
    add_energy_of_laws(robot, q, v, on, kinetic, potential)
    return np.stack([kinetic, potential], axis=1), trusted
