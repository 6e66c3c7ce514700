"""Unknowns of the kernels of modules of one shape, and their symbols."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from ....structure.module import Module
from ....symbols import Expression
from ...equations.arguments import ModuleArguments
from ...equations.expressions import pack, symbols, zeros
from .extended import Extended, extended, with_arguments
from .given import ANGLE, WIDTH, Given
from .rows import Places, row_scales


class Unknowns:
    """Freedoms of the extended tree of modules of one shape, and the symbols of its positions.

    Attributes:
        m: Mechanism of the first module.
        e: Its extended tree.
        idle: Freedoms that stand for idle motions that nothing determines.
        free: Freedoms that are neither given nor idle; the first `own` are those of the tree
            after the cuts.
        scale: Factor that makes each row dimensionless; the first `loops` rows are those of that tree.
    """

    def __init__(
        self,
        modules: Sequence[Module],
        given: Given,
        arguments: Sequence[ModuleArguments | None],
        places: tuple[Places, Places],
        idle: Sequence[int] = (),
    ) -> None:
        """Collect the trees; arguments are those of `ModuleKernels`."""
        self.idle = idle
        self.places, self.places_with_arguments = places
        self.modules, self.given = modules, given
        self.m = modules[0].mechanism
        self.trees = [extended(module.mechanism) for module in modules]
        self.e: Extended = self.trees[0]
        self.with_arguments = [
            tree if own is None else with_arguments(module.mechanism, own.spec)
            for tree, module, own in zip(self.trees, modules, arguments or [None] * len(modules), strict=True)
        ]
        self.platforms = self.e.platforms
        held = set(given.columns(self.e.tree).tolist()) | set(idle)
        self.free = np.array([k for k in range(self.e.tree.nv) if k not in held], dtype=int)
        self.own = int((self.free < self.m.tree.nv).sum())  # free freedoms of the tree after the cuts
        self.scale = row_scales(self.e, given)
        self.loops = len(self.scale) - 6 * len(self.e.welds)  # rows of the tree after the cuts

    @cached_property
    def _columns(self) -> dict[str, tuple[ca.SX, Expression]]:
        nq, nv = self.m.spanning.nq, 7 * len(self.platforms)
        sizes = {f"q_{i}": nq for i in range(3)} | {f"p_{i}": nv for i in range(3)}
        sizes |= {
            "g": self.given.size,
            "g_0": self.given.size,
            "g_dot": self.given.rates,
            "g_ddot": self.given.rates,
        }
        return {name: symbols(name, size) for name, size in sizes.items()}

    @cached_property
    def rates(self) -> tuple[ca.SX, Expression]:
        """Symbols of rates of all freedoms: a column, and its entries."""
        return symbols("w", self.e.tree.nv)

    def symbols(self, *names: str) -> list[ca.SX]:
        """Return columns of symbols by name: q_i, p_i (i = 0, 1, 2), g, g_0, g_dot and g_ddot."""
        return [self._columns[name][0] for name in names]

    def of(self, name: str) -> Expression:
        """Return the symbols of one column."""
        return self._columns[name][1]

    @cached_property
    def starts(self) -> list[int]:
        """Start of each prescribed position in g."""
        return [int(x) for x in np.cumsum([0, *(WIDTH[kind] for kind in self.given.all_kinds)])]

    def positions(self, i: int, given: str = "g") -> Expression:
        """Return the positions of all joints: the given ones from g or g_0, the others from (q_i, p_i)."""
        g, out = self.of(given), [zeros(0)]
        for joint, source in enumerate(self.e.source):
            if joint in self.given.joints:
                n = self.given.joints.index(joint)
                own = g[self.starts[n] : self.starts[n + 1]]
                turning = self.given.kinds[n] == ANGLE
                out.append(np.array([ca.cos(own[0]), ca.sin(own[0])], dtype=object) if turning else own)
            elif source is None:
                at = 7 * self.platforms.index(joint)
                out.append(self.of(f"p_{i}")[at : at + 7])
            else:
                out.append(self.of(f"q_{i}")[self.m.spanning.q_slices[source]])
        return np.concatenate(out)

    def targets(self) -> Expression:
        """Return the prescribed poses and coordinates."""
        return self.of("g")[self.starts[len(self.given.joints)] :]

    def outside(self, z: Expression) -> tuple[ca.SX, ca.SX]:
        """Return positions of the spanning tree and of the platforms from those of all joints."""
        at = self.e.tree.q_slices
        return pack(*(z[at[i]] for i in self._spanning)), pack(*(z[at[i]] for i in self.platforms))

    def rates_outside(self, rates: Expression) -> ca.SX:
        """Return rates of the spanning tree from those of the extended tree."""
        return pack(*(rates[self.e.tree.v_slices[i]] for i in self._spanning))

    @cached_property
    def _spanning(self) -> list[int]:
        """Joint of the extended tree for each joint of the spanning tree."""
        place = {source: i for i, source in enumerate(self.e.source) if source is not None}
        return [place[i] for i in range(len(self.m.spanning.joints))]
