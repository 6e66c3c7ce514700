"""The targets of a chain in expressions: how they see the modules' motion, and their small system."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, reduce
from typing import Any

import casadi as ca
import numpy as np

from ....assembly.chain.bodies import CarriedFrame
from ....assembly.chain.problem import Relative
from ....linkage.pointing import DirectionTarget, DistanceTarget, met_direction_rows
from ....linkage.targets import CoordinateTarget, PoseTarget
from ....spatial import Array, arctan2, hat, length, rotation_from_quaternion, sines
from ....symbols import Expression, dot, is_zero, plus
from ...equations.expressions import filled, numbers, pack, plain, symbols, symmetric, unpack, zeros
from ...equations.factors import Definite, Handed
from ...equations.scales import largest
from .chain_kernels import SAME_MOTION
from .coupled import Coupled
from .given import ANGLE
from .pointing_rows import PointingRows, direction_rows, distance_rows
from .rows import LEAST_COSINE, coordinate_rows

#: Least cosine of the angle from a prescribed orientation: beyond, the shorter way is not clear.
SHORTER_WAY = -0.5
#: Least cosine between the meant yaw and its heading: beyond, the general path finds a new heading.
CLEAR = 0.1
#: Axes and origin of a frame.
Frame = tuple[Expression, Expression]


class ChainTargets:
    """Writes what a chain's targets are to its modules.

    Attributes:
        coupled: The chain.
        bodies: For each part the bodies that carry targets.
        places: Symbols of the placements of these in the base of their part: R row by row, and p.
        rows: Number of rows.
    """

    def __init__(self, coupled: Coupled) -> None:
        """Take the chain."""
        self.coupled, self.bodies = coupled, [coupled.ports(k) for k in range(len(coupled.parts))]
        self.rows = coupled.rows
        self.places = [symbols(f"place_{k}", 12 * len(own)) for k, own in enumerate(self.bodies)]
        self._g, self._g_dot = symbols("g", coupled.given.size), symbols("g_dot", coupled.given.rates)

    def couple(self) -> tuple[ca.Function, list[tuple[Array, ...]]]:
        """Write the kernel of residuals and maps; return which entries of each body's map are not zero.

        From the placements of all parts and what is prescribed to the residual without units, shape (rows,),
        and for each part the entries of T that are not zero; last is a guard.
        """
        residual, guard = self._residual
        maps, packed = [], []
        for T in self._maps():
            mask = np.array([[not is_zero(x) for x in row] for row in T], dtype=bool).reshape(T.shape)
            maps.append(tuple(np.split(mask, T.shape[1] // 6, axis=1)))
            packed.append(pack(T[mask]))
        inputs = [*(column for column, _ in self.places), self._g[0]]
        return ca.Function("couple", inputs, [pack(residual), *packed, guard]), maps

    def _frame(self, part: int, body: int) -> Frame:
        """Return the frame of a part's body in its base."""
        _, entries = self.places[part]
        at = 12 * self.bodies[part].index(body)
        return entries[at : at + 9].reshape(3, 3), entries[at + 9 : at + 12]

    @cached_property
    def _bases(self) -> list[Frame]:
        out: list[Frame] = []
        for base in self.coupled.problem.carried.bases:
            out.append(_then(self._carrier(base, out), _inner(base)))
        return out

    def _carrier(self, place: CarriedFrame, bases: Sequence[Frame]) -> Frame:
        """Return the frame of the body that carries a place."""
        if place.part < 0:
            return numbers(np.eye(3)), zeros(3)
        if place.body == 0 or place.body not in self.bodies[place.part]:
            return bases[place.part] if place.body == 0 else _still()
        return _then(bases[place.part], self._frame(place.part, place.body))

    def _of(self, place: CarriedFrame) -> Frame:
        return _then(self._carrier(place, self._bases), _inner(place))

    def seen(self, one: Relative) -> Frame:
        """Return the frame of a target's link in its other one."""
        (R, p), (R_other, p_other) = self._of(one.link), self._of(one.other)
        return dot(R_other.T, R), dot(R_other.T, p - p_other)

    def _goal(self, number: int) -> Expression:
        """Return what is prescribed of a target."""
        return self._g[1][self.coupled.given.places[number]]

    def _rate(self, number: int) -> Expression:
        """Return the prescribed rates of a target."""
        return self._g_dot[1][self.coupled.given.rate_places[number]]

    def _pointed(self, number: int) -> PointingRows | None:
        """Return the rows of a direction or a distance; None for other targets."""
        one, goal, rate = self.coupled.relatives[number], self._goal(number), self._rate(number)
        target, (R, p) = one.target, self.seen(one)
        if isinstance(target, DirectionTarget):
            return direction_rows(R, target.axis, goal, rate)
        return distance_rows(p, goal, rate) if isinstance(target, DistanceTarget) else None

    def _along(self, number: int, R: Expression) -> Any:
        """Return the cosine of the angle between a link's first axis, seen from above, and its heading."""
        given = self.coupled.given
        at = len(self._g[1]) - len(given.turning) + given.turning.index(number - len(given.bodies))
        heading = self._g[1][at]
        return R[0, 0] * ca.cos(heading) + R[1, 0] * ca.sin(heading)

    def _side(self, number: int, R: Expression) -> Any:
        """Return 1 where the upright triple of angles is meant, -1 where the other is."""
        if number - len(self.coupled.given.bodies) not in self.coupled.given.turning:
            return 1.0
        return ca.if_else(self._along(number, R) < 0.0, -1.0, 1.0)

    @cached_property
    def _residual(self) -> tuple[Expression, ca.SX]:
        out, guard = [zeros(0)], ca.SX(0.0)
        for i, one in enumerate(self.coupled.relatives):
            (R, p), goal = self.seen(one), self._goal(i)
            pointed = self._pointed(i)
            if pointed:
                miss = pointed.residual
                guard = ca.fmax(guard, ca.if_else(pointed.cosine > SHORTER_WAY, 0.0, 2.0))
            elif isinstance(one.target, PoseTarget):
                turn, cosine = _rotation_vector(dot(R, rotation_from_quaternion(goal[-4:]).T))
                miss = np.concatenate([p[: len(goal) - 4] - goal[:-4], turn])
                guard = ca.fmax(guard, ca.if_else(cosine > SHORTER_WAY, 0.0, 2.0))
            else:
                some = self.coupled.given.coordinates[i - len(self.coupled.given.bodies)]
                values, _, cosine = coordinate_rows(R, p, self._side(i, R))
                miss = np.array(
                    [
                        wrapped(values[r] - x) if kind == ANGLE else values[r] - x
                        for r, kind, x in zip(some.rows, some.kinds, goal, strict=True)
                    ]
                )
                if ANGLE in some.kinds:
                    along = ca.fabs(self._along(i, R)) > CLEAR * ca.fabs(cosine)
                    guard = ca.fmax(guard, ca.if_else(ca.fabs(cosine) > LEAST_COSINE, 0.0, 2.0))
                    guard = ca.fmax(guard, ca.if_else(along, 0.0, 2.0))
            out.append(miss / one.target.units)
        return np.concatenate(out), guard

    def _maps(self, *, met: bool = False) -> list[Expression]:
        """Return T of each part, from twists of its ports, own axes, to the rates of all rows.

        Args:
            met: Whether directions are those prescribed.

        Returns:
            Each of shape (rows, 6 ports).
        """
        out, numbers = [], range(len(self.coupled.relatives))
        for part, bodies in enumerate(self.bodies):
            columns = [np.concatenate([self._map(i, part, body, met) for i in numbers]) for body in bodies]
            out.append(np.concatenate([zeros(self.rows, 0), *columns], axis=1))
        return out

    def _map(self, number: int, part: int, body: int, met: bool) -> Expression:
        """Return the map from the twist of a port to the rates of a target's rows; `met` as in `_maps`."""
        one = self.coupled.relatives[number]
        ways = [self.coupled.problem.carried.way(place).get(part) for place in (one.link, one.other)]
        sign = (ways[0] == body) - (ways[1] == body)
        T = zeros(6, 6)
        if sign and ways[0] != ways[1]:
            R, p = _then(self._bases[part], self._frame(part, body))
            point, R_other = self._of(one.link)[1], self._of(one.other)[0]
            turn = dot(R_other.T, R) * sign
            T[:3, :3], T[3:, 3:] = turn, turn
            T[:3, 3:] = -dot(turn, hat(dot(R.T, point - p)))
        pointed = self._pointed(number)
        if isinstance(one.target, DirectionTarget) and pointed:
            T = dot(met_direction_rows(self.seen(one)[0], one.target.axis) if met else pointed.map, T[3:])
        elif isinstance(one.target, PoseTarget):
            T = T[3 - one.target.lengths :]
        elif pointed:
            T = dot(pointed.map, T[:3])
        elif isinstance(one.target, CoordinateTarget):
            some = self.coupled.given.coordinates[number - len(self.coupled.given.bodies)]
            R, p = self.seen(one)
            to_rates = coordinate_rows(R, p, self._side(number, R))[1]
            T = np.concatenate([T[:3], dot(to_rates, T[3:])])[list(some.rows)]
        return T / one.target.units[:, None]

    def meet(self) -> ca.Function:
        """From S, e and the residual to the multipliers of a step; last is a guard."""
        (s_col, s), (e_col, e), (r_col, r) = self._sums()
        factors, guard = Definite.certain(symmetric(s, self.rows), SAME_MOTION)
        return ca.Function("meet", [s_col, e_col, r_col], [pack(factors.solve(-(r + e)[:, None])), guard])

    def _sums(self, k: int = 1) -> list[tuple[ca.SX, Expression]]:
        m = self.rows
        return [symbols("S", m * (m + 1) // 2), symbols("e", k * m), symbols("r", m)]

    @cached_property
    def _asked(self) -> Expression:
        """Prescribed rates of all rows, without units: T V equals them."""
        out = [zeros(0)]
        for i, one in enumerate(self.coupled.relatives):
            pointed = self._pointed(i)
            out.append((pointed.asked if pointed else self._rate(i)) / one.target.units)
        return np.concatenate(out)

    def asked(self) -> ca.Function:
        """From placements, what is prescribed and its rates to the rates of all rows, without units."""
        inputs = [*(column for column, _ in self.places), self._g[0], self._g_dot[0]]
        return ca.Function("asked", inputs, [pack(self._asked)])

    def settle(self) -> tuple[ca.Function, Handed]:
        """Write the kernel of the multipliers of the last step and of the rates.

        From S, e, residual, `asked`, S_0 and F to (multipliers, the largest residual, how far the rows have
        turned, factors); last is a guard.
        """
        m = self.rows
        (s_col, s), (e_col, e), (r_col, r) = self._sums(2)
        a_col, asked = symbols("asked", m)
        (s0_col, s_0), (f_col, F) = (symbols(name, len(s)) for name in ("S_0", "F"))
        factors, guard = Definite.certain(symmetric(s, m), SAME_MOTION)
        before, guard_before = Definite.certain(symmetric(s_0, m), SAME_MOTION)
        turned = ca.sqrt(ca.fmax(before.trace(symmetric(F, m)), 0.0))
        right = np.stack([-r - e[:m], asked - e[m:]], axis=1)
        handed = Handed(lower=factors.lower, inverses=factors.inverses)
        outputs = [
            pack(factors.solve(right).T),
            largest(r),
            turned,
            handed.pack(),
            ca.fmax(guard, guard_before),
        ]
        return ca.Function("meet", [s_col, e_col, r_col, a_col, s0_col, f_col], outputs), handed

    def change(self) -> ca.Function:
        """Write the kernel of what changes while the modules move at their rates.

        From placements, what is prescribed, its rates and accelerations, twists of the ports and l to the
        prescribed accelerations of all rows less T_dot V, without units, and d/dt T^T l.
        """
        twists = [symbols(f"V_{k}", 6 * len(own)) for k, own in enumerate(self.bodies)]
        (l_col, multipliers), g_col = symbols("l", self.rows), ca.SX.sym("g_ddot", self.coupled.given.rates)
        changes = []
        for (_, entries), (_, V), own in zip(self.places, twists, self.bodies, strict=True):
            for i in range(len(own)):
                R, twist = entries[12 * i : 12 * i + 9].reshape(3, 3), V[6 * i : 6 * i + 6]
                changes += [dot(R, hat(twist[3:])), dot(R, twist[:3])]
        given = self.coupled.given
        moved = zeros(given.size)  # only directions and points that move change the rows
        first = len(given.bodies) + len(given.coordinates)
        places = zip(given.pointing, given.places[first:], given.rate_places[first:], strict=True)
        for at, to in ((at, to) for one, at, to in places if one.what != "turn"):
            moved[at] = self._g_dot[1][to]
        state = ca.vertcat(*(column for column, _ in self.places), self._g[0])
        rate = pack(*changes, moved)
        maps, fixed = self._maps(met=True), [ca.SX.sym("V", column.numel()) for column, _ in twists]
        y = pack(reduce(plus, (dot(T, unpack(V)) for T, V in zip(maps, fixed, strict=True))))
        asked = ca.jtimes(pack(self._asked), ca.vertcat(state, self._g_dot[0]), ca.vertcat(rate, g_col))
        drift = ca.substitute(
            ca.jtimes(y, state, rate), ca.vertcat(*fixed), ca.vertcat(*(column for column, _ in twists))
        )
        forces = [ca.jtimes(pack(dot(T.T, multipliers)), state, rate) for T in maps]
        inputs = [*(column for column, _ in (*self.places, self._g, self._g_dot)), g_col]
        inputs += [*(column for column, _ in twists), l_col]
        return ca.Function("change", inputs, [ca.densify(x) for x in (asked - drift, *forces)])

    def meet_again(self, handed: Handed) -> ca.Function:
        """From factors, e and what `change` asks to the multipliers of accelerations."""
        f_col, known = handed.again("factors")
        (e_col, e), (a_col, asked) = (symbols(name, self.rows) for name in ("e", "a"))
        solved = Definite(known["lower"], known["inverses"]).solve((asked - e)[:, None])
        return ca.Function("meet", [f_col, e_col, a_col], [pack(solved)])


def _inner(place: CarriedFrame) -> Frame:
    return plain(place.inner.R[0]), plain(place.inner.p[0])


def _still() -> Frame:
    return plain(np.eye(3)), zeros(3)


def _then(outer: Frame, inner: Frame) -> Frame:
    """Return a frame of another one in the other's base."""
    return dot(outer[0], inner[0]), plus(outer[1], dot(outer[0], inner[1]))


def wrapped(x: Any) -> Any:
    """Return an angle less whole turns, within half a turn."""
    return x - 2 * np.pi * ca.floor(x / (2 * np.pi) + 0.5)


def _rotation_vector(R: Expression) -> tuple[Expression, Any]:
    """Compute the rotation vector of a rotation, shape (3,), and the cosine of its angle."""
    vector, cosine = sines(R), (R[0, 0] + R[1, 1] + R[2, 2] - 1.0) * 0.5
    sine = length(vector)
    return arctan2(sine, filled([cosine], 1)) / sine * vector, cosine
