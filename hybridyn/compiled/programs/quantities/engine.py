"""The engine of `dynamics.quantities` by rows of compiled models.

    M e_j = (idm(q, 0, s E e_j) - idm(q, 0, 0)) / s                        a row for each coordinate
    c + g = idm(q, v, E_dot u)                                              one row
    c     = (idm(q, s v, s^2 E_dot u) + idm(q, -s v, s^2 E_dot u) - 2 idm(q, 0, 0)) / (2 s^2)
    J     = J_tree E, with J_tree from the poses of kinematics(q)           one row
    D     = J (ddm(q, 0, s J^T e_j) - ddm(q, 0, 0)) / s over u              a row for each wrench

The powers of two s are so large that weights and springs take no digit from inertial terms; what is odd in
the rates (friction) cancels. Efforts along other joints than the motors are H^T tau, H = d(motors)/du.

Rates and accelerations of all joints from independent coordinates, dq/du and its drift, are the program
"close" for the chosen joints. Modules do not depend on each other, so the columns of equal number of all
modules are computed in one lane. Models of a floating robot under a wrench on its base give and take forces
on all its coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ....dynamics.energy import add_energy_of_laws, leg_bodies
from ....dynamics.guards import IMMOVABLE
from ....dynamics.quantities.independent import IndependentCoordinates
from ....dynamics.quantities.links import inverse_of, link_jacobians
from ....effects.choice import Effects
from ....effects.joint_laws import (
    CoulombFriction,
    Damper,
    DirectedFriction,
    StribeckFriction,
    ViscousFriction,
)
from ....effects.springs import PolynomialDamper, PolynomialSpring, Spring
from ....linkage.motion import Motion
from ....spatial import Array, Index, Mask
from ....structure.robot import HybridRobot
from ...library.calls import Numbers
from ..general import WIDTH, motion_of
from .following import Following

#: Exponent of the factor on accelerations, and of rates after their factor.
FASTER = 30
_FRICTION = (ViscousFriction, Damper, CoulombFriction, StribeckFriction, DirectedFriction)
#: Laws without efforts at rest, which `gravity` may have. With others the general path computes it.
ZERO_AT_REST = {*_FRICTION, PolynomialDamper}
#: Laws that `coriolis` may have: at rates of 2**FASTER they are odd, bounded, or as at rest, and no larger
#: than inertial forces.
GONE_AT_SPEED = {*_FRICTION, Spring, PolynomialSpring}
#: Largest difference, of the largest rate in the robot's units, between given rates and those that follow
#: from the independent coordinates: a hundred times how far `idm` lets loops be open.
FOLLOWS = {"float64": 1e-9, "float32": 3e-1}

#: Reciprocal condition number of a compiled Delassus matrix below which the general path inverts it. In seven
#: digits, rounding hides directions in which links cannot move.
IMMOVABLE_AS_COMPUTED = {"float64": IMMOVABLE, "float32": 1e-4}

#: Computes a model by its name from its arguments: its result, and which rows can be trusted.
Run = Callable[..., tuple[Numbers, Mask]]


class CompiledEngine:
    """Motions and forces of a robot at some samples, by compiled models.

    A quantity may need several rows for each sample, those of a sample one after the other.

    Attributes:
        robot: The robot.
        good: Samples at which all models that were run can be trusted, shape (T,).
    """

    def __init__(self, robot: HybridRobot, run: Run, moves: Following | None, samples: int) -> None:
        """Start with trust in all samples.

        Args:
            run: Computes "idm", "ddm", "kinematics", or "idm_pushed" and "ddm_pushed" of a floating robot.
            moves: Motions over the independent coordinates; None for quantities that need none.
        """
        self.robot, self._run, self._moves = robot, run, moves
        self.good = np.ones(samples, dtype=bool)

    def run(self, name: str, q: Array, *given: Array) -> Numbers:
        """Compute a model at rows of samples."""
        return self._trusted(*self._run(name, q, *given))

    def _trusted(self, out: Numbers, trusted: Mask) -> Numbers:
        """Return rows, and note the samples that cannot be trusted."""
        self.good &= trusted.reshape(len(self.good), -1).all(axis=1)
        return out

    @property
    def moves(self) -> Following:
        """The motions over the independent coordinates."""
        assert self._moves is not None
        return self._moves

    @property
    def u(self) -> IndependentCoordinates:
        """The independent coordinates."""
        return self.moves.u

    @property
    def driven(self) -> Index:
        """Entries of v on which forces act: the twist of a floating base, then the motors."""
        base = np.arange(6 if self.robot.base == "floating" else 0)
        return np.concatenate([base, self.robot.motor_v])

    @property
    def _pushed(self) -> str:
        """What is appended to the names of models whose base is pushed."""
        return "_pushed" if self.robot.base == "floating" else ""

    def basis(self, q: Array, v: Array | None = None) -> Numbers:
        """Compute dq/du, shape (T, nv, N); rates that do not follow from those of u cannot be trusted."""
        E = self._trusted(*self.moves.map(q))
        if v is not None:
            robot = self.robot
            base = v * (np.arange(robot.nv) < 6) if robot.base == "moving" else 0.0
            off, size = np.einsum("tij,tj->ti", E, v[:, self.u.columns]) + base - v, v / robot.unit
            limit = FOLLOWS[str(self.moves.dtype)] * np.abs(size).max(axis=1, initial=0.0)
            self.good &= np.abs(off / robot.unit).max(axis=1, initial=0.0) <= limit
        return E

    def drift(self, q: Array, v: Array) -> Numbers:
        """Compute the accelerations at u_dot = 0, shape (T, nv), of rates that keep the loops closed."""
        return self._trusted(*self.moves.drift(q, v))

    def forces(self, q: Array, v: Array, a: Array) -> Numbers:
        """Compute the forces on the driven entries, shape (T, k)."""
        return self.run("idm" + self._pushed, q, v, a)

    def mass(self, q: Array) -> Numbers:
        """Compute the mass matrix, shape (T, N, N)."""
        E, T = self.basis(q), len(q)
        lanes = E.shape[2]
        a = np.swapaxes(E, 1, 2).reshape(T * lanes, -1) * 2.0**FASTER
        tau = self.forces(np.repeat(q, lanes, axis=0), np.zeros_like(a), a).reshape(T, lanes, -1)
        M = self._along(E, np.swapaxes(tau - self._at_rest(q)[:, None], 1, 2)) * 2.0**-FASTER
        return (M + np.swapaxes(M, 1, 2)) / 2

    def bias(self, q: Array, v: Array, base_acceleration: Array | None = None) -> Numbers:
        """Compute c + g, shape (T, N), with the acceleration of a prescribed base, shape (T, 6)."""
        a = self.drift(q, v)
        if self.robot.base == "moving":
            a[:, :6] = 0.0 if base_acceleration is None else base_acceleration
        return self._over_u(q, self.forces(q, v, a))

    def coriolis(self, q: Array, v: Array) -> Numbers:
        """Compute c, shape (T, N)."""
        d = self.drift(q, v)
        s = FASTER - np.frexp(np.abs(v).max(axis=1, initial=0.0))[1][:, None]
        fast, a = np.ldexp(v, s), np.ldexp(d, 2 * s)
        both = self.forces(q, fast, a) + self.forces(q, -fast, a)
        return self._over_u(q, np.ldexp(both / 2 - self._at_rest(q), -2 * s))

    def gravity(self, q: Array) -> Numbers:
        """Compute g, shape (T, N)."""
        return self._over_u(q, self._at_rest(q))

    def _at_rest(self, q: Array) -> Numbers:
        """Return the forces that hold the robot at rest, shape (T, k)."""
        still = np.zeros((len(q), self.robot.nv))
        return self.forces(q, still, still)

    def _over_u(self, q: Array, tau: Numbers) -> Numbers:
        """Return efforts along u, shape (T, N), from those on the driven entries."""
        same = np.array_equal(self.driven, self.u.columns)
        return tau if same else self._along(self.basis(q), tau[:, :, None])[:, :, 0]

    def _along(self, E: Numbers, tau: Numbers) -> Numbers:
        """Return efforts along u, shape (T, N, c), from columns of those on driven entries, (T, k, c)."""
        if np.array_equal(self.driven, self.u.columns):
            return tau
        out: Array = np.matmul(np.swapaxes(E[:, self.driven], 1, 2), tau)
        return out

    def bodies(self, q: Array, v: Array) -> Motion:
        """Compute the motion of all bodies in the world, shapes (T, bodies, ...), at zero accelerations."""
        return motion_of(self.run("kinematics", q, v, np.zeros_like(v)).reshape(len(q), -1, WIDTH))

    def delassus(self, q: Array, links: Sequence[str], axes: str) -> Numbers:
        """Compute J M^-1 J^T of k links, shape (T, 6 k, 6 k), of a robot with a motor for each freedom.

        The direct model at rest, under forces on its coordinates that do the work of unit wrenches on the
        links.
        """
        J, name = link_jacobians(self, q, links, axes), "ddm" + self._pushed
        T, rows, N = J.shape
        still = np.zeros((T * rows, self.robot.nv))
        pushed = self.run(name, np.repeat(q, rows, axis=0), still, J.reshape(T * rows, N) * 2.0**FASTER)
        free = pushed.reshape(T, rows, -1) - self.run(name, q, still[:T], np.zeros((T, N)))[:, None]
        D = np.matmul(free[:, :, self.u.columns] * 2.0**-FASTER, np.swapaxes(J, 1, 2))
        out: Array = (D + np.swapaxes(D, 1, 2)) / 2
        return out

    def operational_inertia(self, q: Array, links: Sequence[str], axes: str) -> Numbers:
        """Compute the inverse of `delassus`; a sample at which it may not exist cannot be trusted."""
        D = self.delassus(q, links, axes)
        D[~self.good] = 0.0
        out, size = inverse_of(self.robot, D.astype(float))
        self.good &= size[:, 0] > IMMOVABLE_AS_COMPUTED[str(D.dtype)] * size[:, -1]
        return out

    def energy(self, q: Array, v: Array, on: Effects) -> Numbers:
        """Compute kinetic and potential energy, shape (T, 2)."""
        robot, bodies = self.robot, self.bodies(q, v)
        counted, mass, com, inertia = _inertial_bodies(robot, on)
        R, p, w, p_dot = (np.take(x, counted, axis=1) for x in bodies.arrays[:4])
        arm = np.matmul(R, com[:, :, None])[..., 0]
        own = np.matmul(np.swapaxes(R, 2, 3), w[..., None])
        turning = np.matmul(inertia, own)
        speed = p_dot + np.cross(w, arm)
        kinetic = ((mass * (speed**2).sum(axis=2)).sum(axis=1) + (own * turning).sum(axis=(1, 2, 3))) / 2
        weight = robot.gravity if on.gravity is not None else np.zeros(3)
        potential = -(mass * ((p + arm) @ weight)).sum(axis=1)  # `@ mass` rounds by the batch
        add_energy_of_laws(robot, q, v, on, kinetic, potential)
        return np.stack([kinetic, potential], axis=1)


def _inertial_bodies(robot: HybridRobot, on: Effects) -> tuple[list[int], Array, Array, Array]:
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
