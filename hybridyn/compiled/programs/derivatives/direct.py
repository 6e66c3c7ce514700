"""Program of the derivatives of the direct model, from those of the balance of forces that it solves.

At the solution the remaining forces r(q, v, a, tau) vanish, and in each module a = Psi(q) u_dot + a_0(q, v).
So with M = r_a Psi, and the index x for derivatives over q, v, tau or parameters,

    u_dot_x = -M^-1 (r_x + r_a (Psi_x u_dot + a_0,x)),   a_x = Psi u_dot_x + Psi_x u_dot + a_0,x

Along motions that keep the loops closed this is the derivative of the direct model. Single columns, which
open the loops, may differ from those of its program where a base that moves carries a module with closures in
its core: there the program projects the base's forces by the closures, and r by rigid motion.
"""

from __future__ import annotations

import numpy as np

from ....spatial import Index
from ...equations.request import Request
from ...program import Call, Constants, Own, Program, Shared
from ..direct import DirectCalls, direct_inputs, write_direct_sweeps
from ..inverse import write_balance
from ..writer import Writer
from .adjoints import Adjoints
from .columns import Coordinates, collect, coordinates_of, parameters_of
from .dense import Block, Term, add_product, factorise, new_block, solve
from .memory import compacted
from .motion import Motions
from .nodes import Joiner


def direct_derivatives(request: Request) -> Program:
    """Build the program of a and its derivatives "d_q", "d_v", "d_tau", row by row.

    With a moving base "d_base_acceleration" is added, with parameters as inputs "d_parameters".
    """
    robot = request.robot
    inputs = direct_inputs(request)
    widths = {name: robot.nv if name == "q" else size for name, size in inputs}
    outputs = [("a", robot.nv)] + [(f"d_{name}", robot.nv * width) for name, width in widths.items()]
    w = Writer("ddm_jacobian", inputs, outputs, computed=("a",))
    modules = write_direct_sweeps(request, w, motions=True)
    rows = _Rows(request, w, modules, widths)
    for j, at in enumerate(rows.coordinates):
        rows.add_motion(j, at)
    for module in robot.modules:
        if len(module.motor_index):
            rows.add("tau", module.motor_index)
    for index in parameters_of(request):
        rows.add("parameters", index)
    return compacted(w.program())


class _Rows:
    """Add columns to all rows of the derivatives.

    Attributes:
        coordinates: Coordinates of the base, if its motion is given, and of each module.
    """

    def __init__(
        self, request: Request, w: Writer, modules: list[DirectCalls], widths: dict[str, int]
    ) -> None:
        """Add the derivatives of the remaining forces and of the motions, and factorise the mass matrix."""
        self._w, self._widths = w, widths
        self.coordinates = coordinates_of(request.robot)
        start = len(w.steps)
        balance = write_balance(request, w)
        calls = [step for step in w.steps[start:] if isinstance(step, Call)]
        sizes = [place.size for place in balance]
        self._adjoints = Adjoints(w, sum(sizes))
        for left, first in zip(balance, np.cumsum([0, *sizes]).tolist(), strict=False):
            self._adjoints.seed(left, first)
        live = {("given", k) for k in range(sum(size for _, size in w.inputs))}
        self._adjoints.sweep(
            Joiner(w.kernels, w.handed).nodes(calls), live | {("result", k) for k in range(request.robot.nv)}
        )
        self._root = len(self.coordinates) - len(modules)
        motions = Motions(w)
        self._motions = [
            motions.of(*pair) for pair in zip(modules, self.coordinates[self._root :], strict=True)
        ]
        self._over_a = [w.own(self._adjoints.rows, len(at.v)) for at in self.coordinates]
        for at, place in zip(self.coordinates, self._over_a, strict=True):
            self._collect("a", at.v, place)
        self._moving = [k for k, size in enumerate(sizes) if size]
        self._factors = factorise(w, [self._mass(k) for k in self._moving])

    def _mass(self, k: int) -> Block:
        """Add the columns of the mass matrix of module k's motions, M = r_a Psi."""
        motion, rows = self._motions[k], self._adjoints.rows
        block = new_block(self._w, rows, motion.Psi.rows.size)
        over_a = self._over_a[self._root + k]
        term = Term(over_a, motion.Psi.some(0, over_a.size), motion.Psi.pattern)
        read = [block.all] if k == self._moving[0] else []
        add_product(self._w, rows, [term], [], [block.rows, *read])
        return block

    def add_motion(self, j: int, at: Coordinates) -> None:
        """Add the columns of some coordinates: positions, rates, and the acceleration of a moving base."""
        if j < self._root:
            for name in ("q", "v"):
                self.add(name, at.v, at if name == "q" else None)
            self._spread("base_acceleration", np.arange(6), [], self._over_a[j], -1)
            return
        motion = self._motions[j - self._root]
        for name, over in (("q", motion.over_q), ("v", motion.over_v)):
            remaining = self._w.own(self._adjoints.rows, len(at.v))
            self._collect(name, at.q if name == "q" else at.v, remaining, at if name == "q" else None)
            term = Term(self._over_a[j], over.some(0, len(at.v)), over.pattern)
            self._spread(name, at.v, [term], remaining, j - self._root, over.rows)

    def add(self, name: str, index: Index, at: Coordinates | None = None) -> None:
        """Add the columns of some inputs on which no motion depends."""
        remaining = self._w.own(self._adjoints.rows, len(index))
        self._collect(name, index if at is None else at.q, remaining, at)
        self._spread(name, index, [], remaining, -1)

    def _collect(self, name: str, index: Index, place: Own, at: Coordinates | None = None) -> None:
        """Add up the derivatives of the remaining forces over some inputs."""
        if self._adjoints.rows:
            collect(self._adjoints, name, index, [place], at)

    def _spread(
        self,
        name: str,
        index: Index,
        terms: list[Term],
        remaining: Own,
        module: int,
        own: Own | None = None,
    ) -> None:
        """Add columns from the remaining forces' derivatives, r_x = remaining + the terms.

        Args:
            name: The user input.
            index: Indices of the columns.
            terms: Derivatives of the remaining forces over accelerations, and these over the columns.
            remaining: Derivatives of the remaining forces.
            module: The module whose motion depends on the columns, or -1.
            own: Derivatives of its accelerations at fixed u_dot.
        """
        w, n, columns = self._w, self._adjoints.rows, len(index)
        u_dot: dict[int, Shared] = {}
        if n:
            forces = w.each(n, columns)
            add_product(w, n, terms, [remaining], [forces])
            u_dot = dict(zip(self._moving, solve(w, self._factors, forces, columns), strict=True))
        for i, at in enumerate(self.coordinates):
            k = i - self._root
            more: list[Own | Constants] = []
            moved: list[Term] = []
            if k == module and own is not None:
                more.append(own)
            if k < 0:
                more = [Constants(np.eye(6) if name == "base_acceleration" else np.zeros((6, columns)))]
            elif k in self._moving:
                moved.append(Term(self._motions[k].Psi.rows, u_dot[k], by_columns=True))
            elif not more:
                more = [Constants(np.zeros((len(at.v), columns)))]
            place = w.result(f"d_{name}", at.v[:, None] * self._widths[name] + index)
            add_product(w, len(at.v), moved, more, [place])
