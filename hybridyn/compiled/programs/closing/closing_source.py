"""The programs of a whole robot for one choice of given joints and targets, and their C libraries.

One library closes the rows of a table, the other those of many designs in lanes: one text, `c/closing.h`.
Exported control steps from poses close their rows by `c/advance.h`, too, and all walk by `c/walk.h`, with
Newton's method of `c/newton.h`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ....assembly.walk import FARTHEST, MOST_TURNING, SAME_BRANCH, SMALL_STEP
from ....linkage.newton import LONGEST_STEP, NEVER_DAMPED
from ....spatial import LARGEST, Index
from ....structure.robot import HybridRobot
from ...code.library_source import Source as Generated
from ...code.library_source import library_source
from ...code.scalars import Scalar, c_text
from ...equations.arguments import ChosenNumbers
from ...program import Program
from ..writer import ModuleWriter, alike
from .chain_program import ChainWriter
from .coupled import Coupled
from .kernels import ModuleKernels
from .module_parts import (
    CLOSED_TO_ROUNDING,
    ITERATIONS,
    LAST_ROW_STEP,
    MOST_BOUND,
    PATIENCE,
    QUADRATIC,
    Part,
    kinds_of,
    motors_given,
)
from .rows import place_program

POSTURE, RATES = [("q_0", "q"), ("p_0", "p")], [("g_dot", "rates"), ("g_ddot", "rates")]
START, FOUND = [("q_1", "q"), ("p_1", "p")], [("q_2", "q"), ("p_2", "p")]
#: Inputs and outputs of the programs: name and kind of each, see `module_parts.kinds_of`.
FORMS = {
    "newton": (
        [*POSTURE, ("g", "g")],
        [("q", "q"), ("p", "p"), ("step", "each"), ("wrist", "each"), ("open", "each"), ("kept", "kept")],
    ),
    "settle": (
        [*POSTURE, *START, ("g_0", "g"), ("g", "g"), *RATES, ("kept", "kept")],
        [
            *(("q", "q"), ("p", "p"), ("v", "v"), ("a", "v")),
            *(("step", "each"), ("open", "each"), ("turning", "each")),
        ],
    ),
    "branch": ([*POSTURE, ("g_0", "g"), *START, *FOUND, ("g", "g")], [("off", "each"), ("turned", "each")]),
}


def closing_programs(
    robot: HybridRobot,
    parts: Sequence[Part],
    chosen: ChosenNumbers | None = None,
    chains: Sequence[Coupled] = (),
) -> dict[str, Program]:
    """Write the programs "newton", "settle" and "branch", see `kernels`.

    Inputs and outputs are those of the kernels for the whole robot, "p" the poses of the platforms, module by
    module; "step", "wrist", "open", "turning", "off" and "turned" have an entry for each module.

    Args:
        parts: Its modules but a free base.
        chosen: Numbers that are arguments, the input "parameters" of each program, or None.
        chains: Parts that poses couple.
    """
    places = robot.bodies.place, robot.bodies.place if chosen is None else chosen.places
    own = [None if chosen is None else chosen.of_modules[robot.modules.index(x.module)] for x in parts]
    coupled = [ChainWriter(robot, parts, one, k, places, own) for k, one in enumerate(chains)]
    kept = {k: count for writer in coupled for k, count in writer.kept.items()}
    kinds = kinds_of(robot, parts, [one.given for one in chains], kept)
    w = _writers(robot, kinds, chosen)

    def key(k: int) -> tuple[object, ...]:
        """Return what parts with the same kernels have in common."""
        part = parts[k]
        blocks = tuple(tuple(block.cols.tolist()) for block in part.blocks)
        return *part.shape, blocks, part.module.mobility

    alone = [k for k in range(len(parts)) if not any(k in one.parts for one in chains)]
    for shape, numbers in alike(alone, key).items():
        modules, first = [parts[k].module for k in numbers], parts[numbers[0]]
        arguments = [own[k] for k in numbers], places
        kernels = ModuleKernels(modules, first.given, first.blocks, *arguments, first.idle_freedoms)
        for name, kernel in kernels.write().items():
            read, written = ([x for x, _ in some if x != "kept"] for some in FORMS[name])
            w[name].add(shape, numbers, kernel, *read, written=written)
    for writer in coupled:
        writer.write(w)
    return {name: writer.program() for name, writer in w.items()}


def _writers(
    robot: HybridRobot, kinds: dict[str, tuple[int, list[Index]]], chosen: ChosenNumbers | None
) -> dict[str, ModuleWriter]:
    """Return the writers of the three programs; `kinds` as from `kinds_of`."""
    column = None if chosen is None else chosen.column
    w = {
        name: ModuleWriter(name, dict(ins), dict(outs), kinds, column) for name, (ins, outs) in FORMS.items()
    }
    if robot.base != "fixed":  # its rates are not those of the program
        pose, rates = ("q_0", np.arange(7)), ("", np.arange(6))
        w["newton"].keep(q=pose)
        w["settle"].keep(q=pose, v=rates, a=rates)
    return w


#: Shortest part of the way between two rows that is tried.
SHORTEST = 2.0**-8
#: Most last steps of a row: each squares the one before.
LAST_STEPS = 3


def closing_source(
    robot: HybridRobot,
    parts: Sequence[Part],
    scalar: Scalar,
    chosen: ChosenNumbers | None = None,
    chains: Sequence[Coupled] = (),
) -> Generated:
    """Generate the C source for one choice of given joints and targets.

    Args:
        parts: Its modules but a free base.
        scalar: Number type and lanes, more than one.
        chosen: Numbers in the slots of designs, which are closed in lanes; None for rows of the robot itself.
        chains: Parts that poses couple.
    """
    programs = closing_programs(robot, parts, chosen, chains)
    names, written = constants_of(programs, 0 if chosen is None else chosen.size), list(programs.values())
    before, after = ["newton.h", "walk.h"], ["row_records.h", "advance.h", "closing.h"]
    order = motors_given(robot, parts) if chosen is None and not chains else []
    lines = [f"#define {name} {value!r}" for name, value in names.items()]
    if chosen is None:
        before.insert(0, "one_lane.h")
    if order:
        lines.append(f"#define MOTORS {', '.join(map(str, order))}")
        written.append(place_program(robot, parts))
        after.append("close_row.h")
    text = [*lines, *map(c_text, before), far_source(parts, chains), *map(c_text, after)]
    return library_source(written, scalar, "\n".join(text))


def far_source(parts: Sequence[Part], chains: Sequence[Coupled] = ()) -> str:
    """Generate the C text that judges how far prescribed positions move."""
    coupled = [kind for one in chains for kind in one.given.all_kinds]
    kinds = [str(kind) for kind in [*(kind for part in parts for kind in part.given.all_kinds), *coupled]]
    far = [repr(step) for part in parts for step in _farthest_steps(part)] + [repr(LARGEST)] * len(coupled)
    tables = [f"int KINDS[] = {{{', '.join([*kinds, '-1'])}}};", f"S FAR[] = {{{', '.join([*far, '0'])}}};"]
    return "\n".join([*(f"static const {table}" for table in tables), c_text("far.h")])


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
        "MODULES": newton["step"], "KEPT": newton["kept"], "ITERATIONS": ITERATIONS, "PATIENCE": PATIENCE,
        "LONGEST": LONGEST_STEP, "NEVER_DAMPED": NEVER_DAMPED,
        "NEAR": QUADRATIC, "LAST_STEP": LAST_ROW_STEP, "OPEN": CLOSED_TO_ROUNDING,
        "SAME_BRANCH": SAME_BRANCH, "SMALL_STEP": SMALL_STEP, "MOST_TURNING": MOST_TURNING,
        "MOST_BOUND": MOST_BOUND, "SHORTEST": SHORTEST, "LAST_STEPS": LAST_STEPS, "SLOTS": slots,
        "PROGRAMS_WORK": max(program.shared + program.own for program in programs.values()) + 1,
        **{f"{name}_SHARED": program.shared for name, program in programs.items()},
    }  # fmt: skip
