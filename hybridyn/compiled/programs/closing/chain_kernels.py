"""Kernels of modules that poses couple: what each does for the targets, and its motion.

With the own rows K of a module, freedoms that these determine follow from others u: x = x_0 + Psi u. The
bodies that carry the targets' links move by J x, and T J x are the targets' rates. Of all x that meet the
targets, the least is taken, measured by W (`assembly.chain.least`):

    M = Psi^T W Psi      A = T J Psi      x = x_0 - Psi M^-1 Psi^T W x_0 + Psi M^-1 A^T l
    sum of A M^-1 A^T over the modules times l = what the targets still lack

Each module adds its A M^-1 A^T, so the targets are one small system, and the cost is linear in the modules.
For accelerations, Psi^T W x_0 gains Psi^T f with f = d/dt (K^T m - J^T T^T l) at constant multipliers m and
l, which hold W x + K^T m = J^T T^T l.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ....joints import displacement
from ....spatial import Array
from ....symbols import Expression, dot, is_zero, times
from ...equations.expressions import pack, symbols, symmetric_product, unpack, upper, zeros
from ...equations.factors import Definite, Handed
from ...equations.guarded_elimination import Triangular
from ...equations.scales import largest, squares
from ..loop_kernels import Kernel
from .kernels import ModuleKernels
from .rows import TreeRows

#: Least pivot of the motions' measures, and of the targets' rows, relative to their diagonal entries: their
#: condition numbers are squares of those of the rows.
SAME_MOTION = 1e-8
#: Largest residual of redundant rows after a step, without units: rounding. Newton steps of the general path
#: share out more.
REDUNDANT = 1e-12
#: Largest residual of loops [module lengths] up to which a rod that idles, and residuals of rotations, have
#: steps that equal those of the general path to rounding.
ALIKE_OPEN = 1e-4


@dataclass(frozen=True, eq=False)
class Ports:
    """The bodies of modules of one shape that carry links of targets.

    Attributes:
        bodies: Their numbers in the tree.
        maps: Which entries of each body's T are not zero, shape (rows, 6).
    """

    bodies: tuple[int, ...]
    maps: tuple[Array, ...]

    @property
    def rows(self) -> int:
        """Number of rows of the targets."""
        return len(self.maps[0])

    @property
    def size(self) -> int:
        """Number of entries of T that are not zero."""
        return int(sum(one.sum() for one in self.maps))

    def symbols(self, name: str) -> tuple[ca.SX, Expression]:
        """Return T as a column of symbols, and as an array, shape (rows, 6 bodies)."""
        column, entries = symbols(name, self.size)
        out = zeros(self.rows, 6 * len(self.bodies))
        out[np.concatenate(self.maps, axis=1)] = entries
        return column, out


class ChainKernels(ModuleKernels):
    """Writes the kernels of modules of one shape in a chain."""

    def join(self, ease: Sequence[Array], ports: Ports) -> ChainKernels:
        """Take what the chain says of the modules.

        Args:
            ease: Motion of each freedom of each module's tree after the cuts that counts as one, in its unit.
            ports: The bodies that carry targets.
        """
        self.ports = ports
        own = self.u.free[: self.u.own]
        weights = [1.0 / (one[own] * self.e.unit[own]) ** 2 for one in ease]
        weight = zeros(self.e.tree.nv)
        weight[own] = self._folding.array(weights)
        self._weight = weight
        return self

    @cached_property
    def _here(self) -> TreeRows:
        """The rows at positions z, and at rates of all freedoms."""
        return self._rows(self._z[1], self.u.rates[1], exact=True)

    @property
    def motions(self) -> int:
        """Number of motions that a module's own rows leave free."""
        return len(self._others)

    @cached_property
    def _others(self) -> list[int]:
        """Freedoms without a pivot, of those that are free."""
        return [c for c in self.u.free.tolist() if c not in self.loops.pivots.cols]

    @property
    def here(self) -> list[ca.SX]:
        """Inputs: a posture, and what is prescribed in the module."""
        return self.u.symbols("q_0", "p_0", "g")

    def place(self) -> Kernel:
        """From a posture to the placements of the ports in the base: R row by row, and p."""
        motion = self._here.writer.motion
        placed = [x[0, body] for body in self.ports.bodies for x in (motion.R, motion.p)]
        return self.kernel("place", self.here, [pack(*placed)])

    def _twists(self, rows: TreeRows) -> Expression:
        """Return the map J from all freedoms to the twists of the ports, own axes, shape (6 ports, nv)."""
        out = zeros(6 * len(self.ports.bodies), self.e.tree.nv)
        for i, body in enumerate(self.ports.bodies):
            for k, column in rows.writer.own_columns(body).items():
                out[6 * i : 6 * i + 6, k] = column
        return out

    def _measured(self, Psi: Expression, x: Expression) -> tuple[Definite, Expression, Any]:
        """Return the factors of M, Psi^T W x, and a guard."""
        weighed = np.array([[times(w, y) for y in row] for w, row in zip(self._weight, Psi, strict=True)])
        factors, guard = Definite.certain(dot(weighed.T, Psi), SAME_MOTION)
        return factors, dot(weighed.T, x), guard

    def _least(self, rows: TreeRows, right: Expression, T: Expression, held: Expression) -> dict[str, Any]:
        """Return what a module adds to the targets, and its least motion without them.

        Args:
            right: Right-hand sides of its own rows, shape (rows, k).
            held: Motions of given freedoms, shape (nv, k).
        """
        factors = Triangular.of(rows.K, self.loops.pivots)
        x, Psi, doubts = self.loops.solved(rows.K, right, self._others, factors)
        M, measured, guard = self._measured(Psi, x)
        J = self._twists(rows)
        A = dot(T, dot(J, Psi))
        x = x - dot(Psi, M.solve(measured))
        missed = [i for i in range(self.u.loops) if i not in self.loops.pivots.rows]
        bent = largest((dot(rows.K[missed], x[:, 0]) - right[missed, 0]) * self.u.scale[missed]) / REDUNDANT
        return {
            "x": x + held, "Psi": Psi, "M": M, "Z": dot(Psi, M.solve(A.T)), "S": M.weighed(A.T), "J": J,
            "e": dot(T, dot(J, x + held)), "factors": factors, "bent": bent,
            "guard": ca.fmax(ca.fmax(squares(doubts), guard), 0.0),
        }  # fmt: skip

    def _still(self, k: int) -> Expression:
        return zeros(self.e.tree.nv, k)

    def project(self) -> tuple[Kernel, Handed]:
        """Write the kernel of a Newton step without the targets.

        From (q, p, g, T) to (S, e, open, kept, motion, guards): S and e are added up, `kept` is for `settle`,
        and the motion is handed to `move`.
        """
        rows, (column, T) = self._here, self.ports.symbols("T")
        found = self._least(rows, -rows.residual[:, None], T, self._still(1))
        own = (rows.residual * self.u.scale)[: self.u.loops]
        far = sum((x * x for x in own if not is_zero(x)), ca.SX(0.0))
        motion = Handed(x=found["x"], Z=found["Z"])
        kept = found["M"].root(found["Psi"][self._path(found["J"])].T)
        guards = [found["guard"], found["bent"], self._too_open(rows)]
        outputs = [pack(upper(found["S"])), pack(found["e"]), far, pack(kept), motion.pack(), *guards]
        return self.kernel("project", [*self.here, column], outputs), motion

    def _too_open(self, rows: TreeRows) -> Any:
        """Return the guard of loops whose residuals differ from those of the general path."""
        turning = [np.arange(c.rows) >= len(c.translations) for c in self.e.closures]
        which = slice(0, self.u.loops) if self.u.idle else np.flatnonzero(np.concatenate([[], *turning]))
        return largest((rows.residual * self.u.scale)[which]) / ALIKE_OPEN

    def _path(self, J: Expression) -> list[int]:
        """Return the freedoms that move a port."""
        return [k for k in range(J.shape[1]) if any(not is_zero(x) for x in J[:, k])]

    @cached_property
    def kept(self) -> int:
        """Number of numbers that tell how the targets turn."""
        return self.motions * len(self._path(self._twists(self._here)))

    def move(self, motion: Handed, rows: int) -> Kernel:
        """From (q, p, g, motion, l) to (q, p, step, wrist) of the next posture."""
        (column, known), (l_column, multipliers) = motion.again("motion"), symbols("l", rows)
        step = known["x"][:, 0] + dot(known["Z"], multipliers)
        moved = self.loops.moved(self._z[1], step)
        return self.kernel(
            "move", [*self.here, column, l_column], [*self.u.outside(moved), *self._sizes(step)]
        )

    def settle(self) -> tuple[Kernel, Handed, Handed]:
        """Write the kernel of the last step and the rates without the targets.

        From (q, p, g, T, q_1, p_1, g_0, T_0, kept, g_dot) to (S, e, S_0, F, turned, open, motion, factors,
        guards). With `kept`, S_0 is S at the start, and F measures the change of the targets' rows since.
        """
        rows = self._rows(self._z[1])
        (t_col, T), (t0_col, T_0) = self.ports.symbols("T"), self.ports.symbols("T_0")
        given = self.u.given.columns(self.e.tree)
        held = self._still(2)
        held[given, 1] = self.u.of("g_dot")
        right = np.stack([-rows.residual, -dot(rows.K, held[:, 1])], axis=1)
        found = self._least(rows, right, T, held)
        before = self._rows(self.u.positions(1, "g_0"))
        path = self._path(found["J"])
        k_col, kept = symbols("kept", self.kept)
        N = kept.reshape(self.motions, len(path)).T
        A = dot(T_0, dot(self._twists(before)[:, path], N))
        B = dot(T, dot(found["J"][:, path], N)) - A
        motion = Handed(x=found["x"], Z=found["Z"])
        f = found["factors"]
        factors = Handed(
            upper=f.upper, lower=f.lower, inverses=f.inverses, Psi=found["Psi"], M=found["M"].lower,
            D=found["M"].inverses,
        )  # fmt: skip
        own, first = self.u.free[: self.u.own].tolist(), f.part(slice(self.rank))
        turned, _ = self._own_loops.turned(rows.K, before.K, own, first)
        outputs = [
            pack(upper(found["S"])), pack(found["e"].T), pack(upper(symmetric_product(A.T, A.T))),
            pack(upper(symmetric_product(B.T, B.T))), ca.sqrt(squares(turned)),
            largest(rows.residual * self.u.scale), motion.pack(), factors.pack(),
            found["guard"], found["bent"], self._guard(zeros(0), rows),
        ]  # fmt: skip
        there = self.u.symbols("q_1", "p_1", "g_0")
        inputs = [*self.here, t_col, *there, t0_col, k_col, *self.u.symbols("g_dot")]
        return self.kernel("settle", inputs, outputs), motion, factors

    def rate(self, motion: Handed) -> Kernel:
        """From (q, p, g, motion, l) to (q, p, rates, twists of the ports, step): l of step and rates."""
        rows = self._here
        (column, known), (l_col, multipliers) = motion.again("motion"), symbols("l", 2 * self.ports.rows)
        step, rate = (known["x"] + dot(known["Z"], multipliers.reshape(2, -1).T)).T
        moved = self.loops.moved(self._z[1], step)
        outputs = [
            *self.u.outside(moved),
            pack(rate),
            pack(dot(self._twists(rows), rate)),
            ca.fmax(*self._sizes(step)),
        ]
        return self.kernel("rate", [*self.here, column, l_col], outputs)

    def turn(self, factors: Handed) -> tuple[Kernel, Handed]:
        """Write the kernel of the accelerations without the targets.

        From (q, p, g, T, rates, factors, l, w_dot, g_ddot) to (e, motion): l of the rates, and w_dot the
        change of T^T l.
        """
        rows, tree, (v_col, v) = self._here, self.e.tree, self.u.rates
        (t_col, T), (f_col, known) = self.ports.symbols("T"), factors.again("factors")
        (l_col, multipliers), (w_col, w_dot) = (
            symbols("l", self.ports.rows),
            symbols("w_dot", 6 * len(self.ports.bodies)),
        )
        given, held = self.u.given.columns(tree), self._still(1)
        held[given, 0] = self.u.of("g_ddot")
        right = -self._drift(v)[:, None] - dot(rows.K, held)
        found = Triangular(known["upper"], known["lower"], known["inverses"])
        x, _, _ = self.loops.solved(rows.K, right, factors=found)
        J, M, Psi = self._twists(rows), Definite(known["M"], known["D"]), known["Psi"]
        f = self._force(rows, J, found, v, dot(T.T, multipliers)) - dot(J.T, w_dot)
        weighed = np.array([times(w, y) for w, y in zip(self._weight, x[:, 0], strict=True)], dtype=object)
        x = x - dot(Psi, M.solve(dot(Psi.T, weighed + f)[:, None])) + held
        bodies = [rows.writer.motion.of_body(body).acceleration()[0] for body in self.ports.bodies]
        e = dot(T, dot(J, x[:, 0]) + np.concatenate(bodies))
        motion = Handed(x=x)
        inputs = [*self.here, t_col, v_col, f_col, l_col, w_col, *self.u.symbols("g_ddot")]
        return self.kernel("turn", inputs, [pack(e), motion.pack()]), motion

    def _force(
        self, rows: TreeRows, J: Expression, factors: Triangular, v: Expression, w: Expression
    ) -> Expression:
        """Compute d/dt (K^T m - J^T w) at constant m and w, over the free freedoms but those of wrists."""
        own, p, tree = self.u.free[: self.u.own], self.loops.pivots, self.e.tree
        weighed = np.array([times(a, b) for a, b in zip(self._weight, v, strict=True)], dtype=object)
        balance = dot(J.T, w) - weighed
        first = self.rank  # pivots of wrists have no part
        leading = factors.part(slice(first))
        m_column, m = symbols("m", first)
        rate = tree.by_joint(displacement.rate, [self._z[1]], [v])
        kept = ca.SX.sym("w", len(w))
        forces = dot(rows.K[list(p.rows[:first])].T, m) - dot(J.T, unpack(kept))
        change = ca.jtimes(pack(forces[own]), self._z[0], pack(rate))
        multipliers = leading.solve_transposed(balance[list(p.cols[:first])][:, None])
        change = ca.substitute(change, ca.vertcat(m_column, kept), pack(multipliers, w))
        out = zeros(tree.nv)
        out[own] = unpack(change)
        return out

    def accelerate(self, motion: Handed, motion_of_rates: Handed) -> Kernel:
        """From (q, p, g, motion of rates, motion, rates, l) to (rates, accelerations, guard)."""
        rows, (v_col, v) = self._here, self.u.rates
        (r_col, by), (column, known) = motion_of_rates.again("by"), motion.again("motion")
        l_col, multipliers = symbols("l", self.ports.rows)
        acceleration = known["x"][:, 0] + dot(by["Z"], multipliers)
        guard = ca.SX(0.0)
        if any(i not in self.loops.pivots.rows for i in range(self.u.loops)):
            changes = self._drift(v) + dot(rows.K, acceleration)
            guard = self._kept((dot(rows.K, v), changes), (v, acceleration))
        outputs = [self.u.rates_outside(v), self.u.rates_outside(acceleration), guard]
        return self.kernel("accelerate", [*self.here, r_col, column, v_col, l_col], outputs)
