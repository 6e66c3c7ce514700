"""Which numbers of a program depend on some of its inputs, and which of them some outputs need."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Index
from ..program import Call, Program, Source, Start, Target, stored

#: The entries of each source or target of a call that matter, in its copies alike.
Entries = tuple[tuple[int, ...], ...]
Number = tuple[str, int]


@dataclass(frozen=True)
class ActiveCall:
    """A call and its entries that matter.

    Attributes:
        call: The call.
        over: Entries of each source that depend on the inputs, and on which needed entries depend.
        needed: Entries of each target that depend on the inputs, and that the outputs need.
    """

    call: Call
    over: Entries
    needed: Entries

    @property
    def matters(self) -> bool:
        """Whether anything of it does."""
        return any(self.over) and any(self.needed)


def active_steps(
    program: Program, inputs: Collection[str], outputs: Collection[str]
) -> list[Start | ActiveCall]:
    """Return the steps of a program with what matters between some inputs and outputs."""
    live = {
        ("given", at + k) for name, size, at in stored(program.inputs) if name in inputs for k in range(size)
    }
    found = [_Dependence(program, step, live) if isinstance(step, Call) else step for step in program.steps]
    needed = {
        ("result", at + k)
        for name, size, at in stored(program.outputs)
        if name in outputs
        for k in range(size)
    }
    return [step.active(needed) if isinstance(step, _Dependence) else step for step in reversed(found)][::-1]


class _Dependence:
    """Which entries of a call's targets depend on which of its sources."""

    def __init__(self, program: Program, call: Call, live: set[Number]) -> None:
        """Find them, and add the numbers of targets that depend on live ones to these."""
        self._call, f = call, program.kernels[call.kernel].function
        self._reads = [_numbers(x, call.copies) for x in call.sources]
        self._writes = [_numbers(x, call.copies) for x in call.targets]
        columns = [
            np.array([any(x in live for x in entry) for entry in entries], dtype=bool)
            for entries in self._reads
        ]
        self._rows = [[pattern(f, n, s) & columns[s] for s in range(f.n_in())] for n in range(f.n_out())]
        for n, entries in enumerate(self._writes):
            for k, entry in enumerate(entries):
                if any(block[k].any() for block in self._rows[n]):
                    live.update(entry)

    def active(self, needed: set[Number]) -> ActiveCall:
        """Return the call; add the numbers of sources that needed ones depend on to these."""
        kept, used = list[tuple[int, ...]](), [np.zeros(len(entries), dtype=bool) for entries in self._reads]
        for entries, blocks in zip(self._writes, self._rows, strict=True):
            wanted = [k for k, entry in enumerate(entries) if any(x in needed for x in entry)]
            rows = [k for k in wanted if any(block[k].any() for block in blocks)]
            kept.append(tuple(rows))
            for s, block in enumerate(blocks):
                used[s] |= block[rows].any(axis=0)
        over = tuple(tuple(np.flatnonzero(mask).tolist()) for mask in used)
        for entries, own in zip(self._reads, over, strict=True):
            for k in own:
                needed.update(entries[k])
        return ActiveCall(self._call, over, tuple(kept))


def pattern(f: ca.Function, n: int, s: int) -> Any:
    """Return which entries of output n depend on which of input s, shape (outputs, inputs)."""
    out = np.zeros((f.nnz_out(n), f.nnz_in(s)), dtype=bool)
    if out.size:
        rows, columns = f.jac_sparsity(n, s, True).get_triplet()
        out[rows, columns] = True
    return out


def _numbers(end: Source | Target, copies: int) -> list[list[Number]]:
    """Return for each entry of a source or target its copies; none for constants and the guard."""
    at: Index = end.at(copies)
    if not end.memory:
        return [[] for _ in range(at.shape[1])]
    return [[(end.memory, k) for k in column] for column in at.T.tolist()]
