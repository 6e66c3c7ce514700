"""Rows of a table: those of a short one by the general path, those of a long one in C."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from ....assembly.assemble import assemble_requests
from ....assembly.redundancy import LEAST
from ....assembly.requests import first_guess, gather_requests
from ....spatial import Array
from ....structure.robot import HybridRobot
from ....threads import one_thread

if TYPE_CHECKING:
    from .assembling import Assembler

#: Rows from which building a program pays: some 3 ms each on the general path for any robot.
LONG_TABLE = 2_000


class TableAssembler:
    """Assembles the rows of one robot's table, in one call or in several.

    Attributes:
        rows: Number of rows so far; from `LONG_TABLE` on they are computed in C.
    """

    def __init__(self, robot: HybridRobot) -> None:
        """Start on the general path."""
        self._robot, self.rows = robot, 0
        self._assembler: Assembler | None = None

    @one_thread()
    def __call__(
        self,
        *,
        motors: Mapping[str, object] | ArrayLike | None = None,
        platforms: Mapping[str, object] | None = None,
        guess: Array | None = None,
        nearest: bool = False,
        redundancy: str = LEAST,
    ) -> tuple[Array, Array, Array]:
        """Compute postures; arguments, results and errors are those of `hybridyn.assemble`."""
        requests = gather_requests(self._robot, motors, platforms, nearest, redundancy)
        requests = requests._replace(strict=guess is not None)
        start = first_guess(self._robot, guess)
        self.rows += requests.samples
        if self.rows < LONG_TABLE:
            q, v, a = assemble_requests(self._robot, requests, start)
        else:
            from .assembling import Assembler  # short tables need none of the compiled models

            self._assembler = self._assembler or Assembler(self._robot)
            q, v, a = self._assembler.assemble(requests, start)
        return (q[0], v[0], a[0]) if requests.single else (q, v, a)
