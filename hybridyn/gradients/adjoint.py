"""Back through closed loops: from what a number changes with the motion to what it changes with parameters.

The motion (q, v, a) keeps rows c(q, p) at their values, and so their rates and accelerations. Let K be the
rows over the freedoms that do not stay. Of a number with the derivatives q_bar, v_bar, a_bar over the motion:

    K^T x_a = a_bar
    K^T x_v = v_bar - x_a d c_ddot / dv
    K^T x_q = q_bar - x_a d c_ddot / dq - x_v d c_dot / dq

and its derivative over p is -(x_a d c_ddot / dp + x_v d c_dot / dp + x_q d c / dp): three sweeps back,
whatever the number of parameters. K^T is factored once a sample, by orthogonal reflections with pivots.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..compiled import RobotPrograms
from ..errors import AT_SAMPLE, AssemblyError, SingularityError
from ..spatial import Array
from .blocks import Factored, RowBlock, Singular, blocks_of, reflections
from .kept import Kept

if TYPE_CHECKING:
    import casadi as ca

#: Pivots of the rows below this part of the largest are zero: the rows depend on each other. Files whose
#: loops close to rounding only raise it.
DEPENDENT, TIMES_ROUNDING = 1e-10, 100.0
#: Largest part of a derivative that belongs to motions which nothing determines: rounding is far below.
LEFT_FREE = 1e-8
#: Largest scaled residual of closed loops: linear terms in it are the error of a gradient.
OPEN_BY = 1e-8


class Bars(NamedTuple):
    """Derivatives of a number over the motion, one sample a row.

    Attributes:
        q: Over the freedoms of positions, shape (T, nv).
        v, a: Over rates and accelerations, shape (T, nv) each.
    """

    q: Array
    v: Array
    a: Array


class ClosedAdjoint:
    """The sweeps back through the closed loops of a robot.

    Attributes:
        operations: Number of operations of one sample: the rows, their factors, the sweeps, and whether
            parameters open dependent rows.
    """

    def __init__(self, programs: RobotPrograms, kept: Kept) -> None:
        """Write the rows and their derivatives."""
        import casadi as ca

        self._robot = robot = programs.robot
        rows = programs.closed_motion(kept.links)
        q, v, a, p, fixed = rows.q, rows.v, rows.a, rows.p, rows.fixed
        x, state = ca.SX.sym("x", rows.c.numel()), [q, v, a, p, fixed]
        K = ca.jacobian(rows.c_dot, v)
        moving = np.zeros(robot.nv, dtype=bool)
        moving[list(set(K.sparsity().get_triplet()[1]))] = True
        moving[kept.freedoms] = False
        self._free = np.flatnonzero(moving)
        self._rows = ca.Function("rows", state, [ca.densify(K[:, self._free.tolist()])])
        self._rates = ca.Function("rates", state, [rows.c_dot])
        self._fixed = ca.Function("fixed", [q, p], [rows.now])
        self._open = ca.Function("open", [q, p], [rows.c[: rows.closing]])
        q_bar = ca.SX.sym("q_bar", robot.nq)
        self._tangent = ca.Function("tangent", [q, q_bar], [ca.jtimes(rows.q_dot, v, q_bar, True)])
        self._back = [
            ca.Function("back", [*state, x], [ca.gradient(ca.dot(x, level), ca.vertcat(*over))])
            for level, over in ((rows.c, [p]), (rows.c_dot, [q, p]), (rows.c_ddot, [q, v, p]))
        ]
        self._row_scale = np.ones(rows.c.numel())
        scales = [m.mechanism.spanning_row_scale for m in robot.modules if m.mechanism.spanning_closures.rows]
        self._row_scale[: rows.closing] = np.concatenate([np.zeros(0), *scales])
        self._unit = robot.unit[self._free]
        worst = max((m.mechanism.rounding for m in robot.modules), default=0.0)
        self._zero = max(DEPENDENT, TIMES_ROUNDING * worst)
        functions = [self._rows, self._tangent, *self._back]
        functions += [self._tangent, self._back[0], *self._back[:2]]  # of rows that parameters may open
        self._blocks = blocks_of(K, self._free)
        factors = sum(reflections(len(cols), len(rows)) for rows, cols in self._blocks)
        self.operations = sum(function.n_instructions() for function in functions) + factors

    def factored(self, q: Array, p: Array) -> list[Factored]:
        """Factor the rows at samples.

        Args:
            q: Closed postures, shape (T, nq).
            p: Numbers in slots, shape (T, slots).

        Raises:
            AssemblyError: A posture does not close the loops.
        """
        open_by = np.abs(called(self._open, q, p)) * self._row_scale[: self._open.size1_out(0)]
        if (open_by > OPEN_BY).any():
            t = int(open_by.max(axis=1).argmax())
            raise AssemblyError(
                f"the loops are open by {open_by[t].max():.1e} module lengths{AT_SAMPLE} "
                f"(limit {OPEN_BY:g}), and a gradient is that of closed loops: assemble the "
                "posture with the same parameters",
                sample=t,
            )
        state, n = self._state(q, p), len(self._free)
        if not len(self._row_scale):
            return []
        K = np.zeros((len(q), 0, len(self._row_scale)))
        if n:  # column by column, as CasADi has matrices
            K = called(self._rows, *state).reshape(len(q), n, -1) * self._unit[:, None] * self._row_scale
        return [
            [RowBlock.of(rows, cols, one[np.ix_(cols, rows)], self._zero) for rows, cols in self._blocks]
            for one in K
        ]

    def _state(self, q: Array, p: Array, v: Array | None = None, a: Array | None = None) -> tuple[Array, ...]:
        """Return the arguments of rows, with rotations that are those at the posture."""
        still = np.zeros((len(q), self._robot.nv))
        given = [still if x is None else x for x in (v, a)]
        return q, *given, p, called(self._fixed, q, p)

    def back(
        self, factors: Sequence[Factored], state: tuple[Array, Array, Array, Array], bars: Bars
    ) -> Array:
        """Return the derivative over the numbers in slots that comes of the motion, shape (T, slots).

        Args:
            factors: The rows, as `factored` returns them.
            state: q, v, a and the numbers in slots, each of T samples.
            bars: Derivatives of the number over the motion.

        Raises:
            SingularityError: The number depends on motions that nothing determines.
        """
        q, v, a, p = state
        if not factors:  # no loops
            return np.zeros(p.shape)
        given = self._state(q, p, v, a)
        nq, nv = self._robot.nq, self._robot.nv
        first = called(self._back[2], *given, self._solved(factors, bars.a))
        second = called(self._back[1], *given, self._solved(factors, bars.v - first[:, nq : nq + nv]))
        q_bar = bars.q - self.freedoms(q, first[:, :nq] + second[:, :nq])
        third = called(self._back[0], *given, self._solved(factors, q_bar))
        out: Array = -(first[:, nq + nv :] + second[:, nq:] + third)
        return out

    def closing(
        self, factors: Sequence[Factored], state: tuple[Array, Array, Array, Array]
    ) -> tuple[tuple[float, Array], tuple[float, Array]]:
        """Return two numbers that are zero where the loops cease to close, and their derivatives over slots.

        They are the smallest singular value of the scaled rows, and the least part that the smallest is of
        the largest; infinite without loops. Derivatives have shape (slots,).
        """
        blocks = [(block, t, *block.ends) for t, one in enumerate(factors) for block in one if block.rank]
        if not blocks:
            return (np.inf, np.zeros(state[3].shape[1])), (np.inf, np.zeros(state[3].shape[1]))
        block, t, least, _ = min(blocks, key=lambda found: found[2].value)
        other, u, small, most = min(blocks, key=lambda found: found[2].value / found[3].value)
        places = [(t, block, least), (u, other, small), (u, other, most)]
        of_least, of_small, of_most = self._moved(factors, state, places)
        part = small.value / most.value
        return (least.value, of_least), (part, (of_small - part * of_most) / most.value)

    def _moved(
        self,
        factors: Sequence[Factored],
        state: tuple[Array, Array, Array, Array],
        places: Sequence[tuple[int, RowBlock, Singular]],
    ) -> Array:
        """Return the derivatives of singular values of rows over the slots, shape (places, slots).

        d sigma = x^T dK y, with the vectors of this value: K y is the rates of the rows at rates y.

        Args:
            factors: The rows of all samples.
            state: As in `back`.
            places: Samples, each with a block of its rows and a singular value of this block.
        """
        at = [t for t, _, _ in places]
        q, p = state[0][at], state[3][at]
        v, x = np.zeros((len(at), self._robot.nv)), np.zeros((len(at), len(self._row_scale)))
        for k, (_, block, singular) in enumerate(places):
            v[k, self._free[block.freedoms]] = singular.freedoms * self._unit[block.freedoms]
            x[k, block.rows] = singular.rows
        nq, still = self._robot.nq, np.zeros(v.shape)
        rates = called(self._back[1], *self._state(q, p, v), x * self._row_scale)
        bars = Bars(self.freedoms(q, rates[:, :nq]), still, still)
        out: Array = rates[:, nq:] + self.back([factors[t] for t in at], (q, still, still, p), bars)
        return out

    def undetermined(self, factors: Sequence[Factored]) -> Array:
        """Return which freedoms nothing determines at some sample, shape (nv,)."""
        out = np.zeros(self._robot.nv, dtype=bool)
        for one in factors:
            for block in one:
                own = np.abs(block.Q[:, block.rank :]).max(axis=1, initial=0.0)
                out[self._free[block.freedoms]] |= own > LEFT_FREE
        return out

    def freedoms(self, q: Array, q_bar: Array) -> Array:
        """Return derivatives over the freedoms, shape (T, nv), of those over coordinates, shape (T, nq)."""
        return called(self._tangent, q, q_bar)

    def followed(self, factors: Sequence[Factored], q: Array, p: Array, held: Array) -> Array:
        """Return the rates of all freedoms that those which stay cause, shape (T, nv).

        Args:
            held: Rates, shape (T, nv), zero for those that are not given.
        """
        state, out = self._state(q, p, held), held.copy()
        right = -called(self._rates, *state) * self._row_scale
        for t, one in enumerate(factors):
            for block in one:
                at = block.freedoms
                out[t, self._free[at]] = block.followed(right[t, block.rows]) * self._unit[at]
        return out

    def _solved(self, factors: Sequence[Factored], y: Array) -> Array:
        """Solve K^T x = y at samples, y of shape (T, nv); those of freedoms that stay do not matter."""
        out = np.zeros((len(y), len(self._row_scale)))
        for t, (one, own) in enumerate(zip(factors, y[:, self._free] * self._unit, strict=True)):
            size = LEFT_FREE * np.abs(own).max(initial=0.0)
            for block in one:
                out[t, block.rows], lost = block.solved(own[block.freedoms])
                if np.abs(lost).max(initial=0.0) > size * block.condition:
                    raise SingularityError(
                        f"what stays leaves {len(lost)} motions{AT_SAMPLE} that change the result: name "
                        "more joints or coordinates in keep, or leave out redundant motors",
                        what="the rows of what stays",
                        sample=t,
                    )
        return out * self._row_scale

    def opening(
        self, factors: Sequence[Factored], state: tuple[Array, Array, Array, Array], slots: Array
    ) -> Array:
        """Return by how much parameters open rows that depend on the others, and their rates, (2 T, k).

        A combination of these rows stands for all of them at a sample: what opens one opens it, too, since
        each row has a weight of its own.

        Args:
            factors: The rows at samples.
            state: q, v, a and numbers in slots.
            slots: Derivative of the numbers over the parameters, shape (slots, k).
        """
        combination = np.zeros((len(factors), len(self._row_scale)))
        for t, one in enumerate(factors):
            for block in one:
                rest = block.rows[block.order[block.rank :]]
                combination[t, block.rows] = block.dependent @ (1.5 + np.cos(rest))
        if not combination.any():
            return np.zeros((0, slots.shape[1]))
        combination *= self._row_scale
        q, v, a, p = state
        given, nq = self._state(q, p, v, a), self._robot.nq
        opened = called(self._back[0], *given, combination)
        rates = called(self._back[1], *given, combination)
        moved = self.freedoms(q, rates[:, :nq])[:, self._free] * self._unit
        followed = np.zeros(combination.shape)
        for t, one in enumerate(factors):
            for block in one:
                followed[t, block.rows] = block.solved(moved[t, block.freedoms])[0]
        rates = rates[:, nq:] - called(self._back[0], *given, followed * self._row_scale)
        out: Array = np.concatenate([opened, rates]) @ slots
        return out


def called(function: ca.Function, *arguments: Array) -> Array:
    """Call a function of columns at samples; arguments and result have shape (T, n), matrices by columns."""
    samples = len(arguments[0])
    found = function(*(np.ascontiguousarray(x.T) for x in arguments))
    width = function.size1_out(0) * function.size2_out(0)
    out: Array = found.full().T.reshape(samples, width)
    return out
