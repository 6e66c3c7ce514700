"""The arguments of one module's code."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ....spatial import Index
from ....structure.module_spec import ModuleSpec
from ..expressions import Expression


@dataclass(frozen=True, eq=False)
class ModuleArguments:
    """The arguments of one module's code.

    Attributes:
        column: Their symbols.
        index: Their places in the input "parameters" of a program.
        spec: The module's numbers, which may be expressions.
        own: Ten inertial numbers of each body of the tree after the cuts, as expressions.
        free: Whether legs and base inertial parameters are those of the constants too. If not, no legs are
            grouped and nothing is regrouped.
    """

    column: ca.SX
    index: Index
    spec: ModuleSpec
    own: tuple[Expression, ...]
    free: bool
