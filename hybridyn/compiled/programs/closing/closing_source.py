"""The programs of a whole robot for one choice of given joints and targets, and their C libraries.

One library closes the rows of a table, the other those of many designs in lanes: one text, `c/closing.h`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ....assembly.follow import FARTHEST, MOST_TURNING, SAME_BRANCH, SMALL_STEP
from ....linkage.newton import LONGEST_STEP
from ....spatial import LARGEST, Index
from ....structure.robot import HybridRobot
from ...code.library_source import Source as Generated
from ...code.library_source import library_source
from ...code.scalars import Scalar, text_of
from ...equations.arguments import ChosenNumbers
from ...program import Program, Source, Target, Worst
from ..writer import Writer
from .choosing import (
    CLOSED_TO_ROUNDING,
    ITERATIONS,
    LAST_ROW_STEP,
    MOST_BOUND,
    PATIENCE,
    QUADRATIC,
    Part,
    motors_given,
    places_of,
)
from .extended import extended
from .kernels import ModuleKernels, Written
from .rows import place_program

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


#: Shortest part of the way between two rows that is tried.
SHORTEST = 2.0**-8
#: Most last steps of a row: each squares the one before.
LAST_STEPS = 3


def closing_source(
    robot: HybridRobot, parts: Sequence[Part], scalar: Scalar, chosen: ChosenNumbers | None = None
) -> Generated:
    """Generate the C source for one choice of given joints and targets.

    Args:
        parts: Its modules but a free base.
        scalar: Number type and lanes, more than one.
        chosen: Numbers in the slots of designs, which are closed in lanes; None for rows of the robot itself.
    """
    programs = closing_programs(robot, parts, chosen)
    names, written = constants_of(programs, 0 if chosen is None else chosen.size), list(programs.values())
    texts = ["closing.h"]
    order = motors_given(robot, parts) if chosen is None else []
    lines = [f"#define {name} {value!r}" for name, value in names.items()]
    if chosen is None:
        texts.insert(0, "one_lane.h")
    if order:
        lines.append(f"#define MOTORS {', '.join(map(str, order))}")
        written.append(place_program(robot, parts))
        texts.append("close_row.h")
    return library_source(written, scalar, "\n".join([*lines, far_source(parts), *map(text_of, texts)]))


def far_source(parts: Sequence[Part]) -> str:
    """Generate the C text that judges how far prescribed positions move."""
    kinds = [str(kind) for part in parts for kind in part.given.all_kinds]
    far = [repr(step) for part in parts for step in _farthest_steps(part)]
    tables = [f"int KINDS[] = {{{', '.join([*kinds, '-1'])}}};", f"S FAR[] = {{{', '.join([*far, '0'])}}};"]
    return "\n".join([*(f"static const {table}" for table in tables), text_of("far.h")])


def _farthest_steps(part: Part) -> list[float]:
    """Return the longest step of each prescribed position: of joints [rad or m], without limit for others."""
    m = part.module.mechanism
    units = [float(m.reduction.col_scale[m.tree.v_slices[joint].start]) for joint in part.given.joints]
    others = len(part.given.all_kinds) - len(units)
    return [*(FARTHEST * unit for unit in units), *(others * [LARGEST])]


def constants_of(programs: Mapping[str, Program], slots: int) -> dict[str, float]:
    """Return the sizes of the programs and the limits of the steps, by their names in C."""
    settle, newton = (dict(programs[name].outputs) for name in ("settle", "newton"))
    given = dict(programs["settle"].inputs)
    return {
        "NQ": settle["q"], "NP": settle["p"], "NV": settle["v"], "NG": given["g"], "NR": given["g_dot"],
        "MODULES": newton["step"], "ITERATIONS": ITERATIONS, "PATIENCE": PATIENCE, "LONGEST": LONGEST_STEP,
        "NEAR": QUADRATIC, "LAST_STEP": LAST_ROW_STEP, "OPEN": CLOSED_TO_ROUNDING,
        "SAME_BRANCH": SAME_BRANCH, "SMALL_STEP": SMALL_STEP, "MOST_TURNING": MOST_TURNING,
        "MOST_BOUND": MOST_BOUND, "SHORTEST": SHORTEST, "LAST_STEPS": LAST_STEPS, "SLOTS": slots,
        "PROGRAMS_WORK": max(program.shared + program.own for program in programs.values()) + 1,
        **{f"{name}_SHARED": program.shared for name, program in programs.items()},
    }  # fmt: skip
