"""The programs of a whole robot for one choice of given joints and targets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ....spatial import Index
from ....structure.robot import HybridRobot
from ...equations.arguments.chosen import ChosenNumbers
from ...program import Program, Source, Target, Worst
from ..writer import Writer
from .extended import extended
from .kernels import ModuleKernels, Written
from .part import Part

#: Inputs and outputs of a program: the name and the kind of each.
Form = tuple[list[tuple[str, str]], list[tuple[str, str]]]


def closing_programs(
    robot: HybridRobot, parts: Sequence[Part], chosen: ChosenNumbers | None = None
) -> dict[str, Program]:
    """Write the programs "newton", "settle" and "branch", see `kernels`.

    Inputs and outputs are those of the kernels for the whole robot, "p" the poses of the platforms, module by
    module; "step", "wrist", "open", "turning", "off" and "turned" have an entry for each module.

    Args:
        parts: Its modules but a free base.
        chosen: Numbers that are arguments, the input "parameters" of each program, or None.
    """
    shapes: dict[Any, list[int]] = {}
    fixed = robot.bodies.place
    places = fixed, fixed if chosen is None else chosen.places
    index = [robot.modules.index(part.module) for part in parts]
    own = [None if chosen is None else chosen.of_modules[i] for i in index]
    for k, part in enumerate(parts):
        blocks = tuple(tuple(block.cols.tolist()) for block in part.blocks)
        spins = tuple((spin.cols, tuple(spin.axis.tolist())) for spin in part.spins)
        key = extended(part.module.mechanism).shape, part.given, blocks, part.module.mobility, spins
        shapes.setdefault(key, []).append(k)
    sizes = {
        "q": robot.nq, "p": sum(part.platforms for part in parts), "v": robot.nv, "each": len(parts),
        "g": sum(part.given.size for part in parts), "rates": sum(part.given.rates for part in parts),
        "slots": 0 if chosen is None else chosen.size,
    }  # fmt: skip
    posture = [("q_0", "q"), ("p_0", "p")]
    start, found = [("q_1", "q"), ("p_1", "p")], [("q_2", "q"), ("p_2", "p")]
    rates = [("g_dot", "rates"), ("g_ddot", "rates")]
    forms: dict[str, Form] = {
        "newton": ([*posture, ("g", "g")], [("q", "q"), ("p", "p"), *_each("step", "wrist", "open")]),
        "settle": (
            [*posture, *start, ("g_0", "g"), ("g", "g"), *rates],
            [("q", "q"), ("p", "p"), ("v", "v"), ("a", "v"), *_each("step", "open", "turning")],
        ),
        "branch": ([*posture, ("g_0", "g"), *start, *found, ("g", "g")], _each("off", "turned")),
    }
    if chosen is not None:
        forms = {name: ([*ins, ("parameters", "slots")], outs) for name, (ins, outs) in forms.items()}
    column = None if chosen is None else chosen.column
    writers = {name: _Writer(name, form, sizes, column) for name, form in forms.items()}
    for name in ("newton", "settle"):
        if robot.base != "fixed":
            writers[name].keep_base()
    for shape, numbers in shapes.items():
        same = [parts[k] for k in numbers]
        modules, arguments = [part.module for part in same], [own[k] for k in numbers]
        kernels = ModuleKernels(modules, same[0].given, same[0].blocks, arguments, places, same[0].spins)
        written = kernels.write()
        entries = places_of(parts, numbers)
        for writer in writers.values():
            writer.add(shape, written, entries, len(numbers))
    return {name: writer.writer.program() for name, writer in writers.items()}


def _each(*names: str) -> list[tuple[str, str]]:
    """Return outputs with an entry for each module."""
    return [(name, "each") for name in names]


def places_of(parts: Sequence[Part], numbers: Sequence[int]) -> dict[str, Index]:
    """Return the indices of some modules' numbers of each kind, shape (modules, numbers) each."""

    def after(sizes: list[int]) -> Index:
        """Return the places of the chosen modules' entries, given the sizes of all."""
        starts = np.cumsum([0, *sizes])
        return np.array([np.arange(starts[k], starts[k + 1]) for k in numbers], dtype=int)

    modules = [parts[k].module for k in numbers]
    return {
        "q": np.array([m.q_index for m in modules]),
        "v": np.array([m.v_index for m in modules]),
        "p": after([part.platforms for part in parts]),
        "g": after([part.given.size for part in parts]),
        "rates": after([part.given.rates for part in parts]),
        "each": np.array(numbers)[:, None],
    }


class _Writer:
    """Writes one of the programs."""

    def __init__(self, name: str, form: Form, sizes: dict[str, int], column: ca.SX | None) -> None:
        self.name, self.form, self.column = name, form, column
        inputs, outputs = ([(n, sizes[kind]) for n, kind in side] for side in form)
        self.writer = Writer(name, inputs, outputs)

    def add(self, shape: Any, written: Written, places: dict[str, Index], copies: int) -> None:
        """Add the call of the kernel of some modules."""
        inputs, outputs = self.form
        w = self.writer
        sources: list[Source] = [w.from_given(name, places[kind]) for name, kind in inputs if kind in places]
        targets: list[Target] = [w.result(name, places[kind]) for name, kind in outputs]
        kernel = w.kernel(shape, getattr(written, self.name), "closures")
        numbers = w.numbers(written.table, self.column)
        w.call(kernel, copies, [*sources, numbers], [*targets, Worst()])

    def keep_base(self) -> None:
        """Hand on the pose of the base; its rates are not the program's."""
        column = ca.SX.sym("base", 7)
        w = self.writer
        targets: list[Target] = [w.result("q", np.arange(7))]
        outputs = [column]
        for name in ("v", "a"):
            if name in w.results:
                targets.append(w.result(name, np.arange(6)))
                outputs.append(ca.SX.zeros(6, 1))
        kernel = w.kernel("base", ca.Function("base", [column], outputs), "closures")
        w.call(kernel, 1, [w.from_given("q_0", np.arange(7))], targets)
