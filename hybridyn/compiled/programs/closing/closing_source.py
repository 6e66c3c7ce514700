"""The C library that closes rows of a table: the programs, and the loop over the rows in `c/closing.h`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ....assembly.follow import FARTHEST, MOST_TURNING, SAME_BRANCH, SMALL_STEP
from ....linkage.newton import LONGEST_STEP
from ....spatial import LARGEST
from ....structure.robot import HybridRobot
from ...code.library_source import Source, library_source
from ...code.scalars import Scalar, text_of
from ...program import Program
from .closing_programs import closing_programs
from .part import (
    CLOSED_TO_ROUNDING,
    ITERATIONS,
    LAST_ROW_STEP,
    MOST_BOUND,
    PATIENCE,
    QUADRATIC,
    Part,
    motors_given,
)
from .place_program import place_program

#: Shortest part of the way between two rows that is tried.
SHORTEST = 2.0**-8


def closing_source(robot: HybridRobot, parts: Sequence[Part], scalar: Scalar) -> Source:
    """Generate the C source for one choice of given joints and targets.

    Args:
        parts: Its modules but a free base.
        scalar: Number type and lanes, more than one.
    """
    programs = closing_programs(robot, parts)
    names = constants_of(programs) | {"SHORTEST": SHORTEST}
    lines = [f"#define {name} {value!r}" for name, value in names.items()]
    order = motors_given(robot, parts)
    written = list(programs.values())
    if order:
        lines.append(f"#define MOTORS {', '.join(map(str, order))}")
        written.append(place_program(robot, parts))
    return library_source(written, scalar, "\n".join([*lines, far_source(parts), text_of("closing.h")]))


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


def constants_of(programs: Mapping[str, Program]) -> dict[str, float]:
    """Return the sizes of the programs and the limits of the steps, by their names in C."""
    settle, newton = (dict(programs[name].outputs) for name in ("settle", "newton"))
    given = dict(programs["settle"].inputs)
    return {
        "NQ": settle["q"], "NP": settle["p"], "NV": settle["v"], "NG": given["g"], "NR": given["g_dot"],
        "MODULES": newton["step"], "ITERATIONS": ITERATIONS, "PATIENCE": PATIENCE, "LONGEST": LONGEST_STEP,
        "NEAR": QUADRATIC, "LAST_STEP": LAST_ROW_STEP, "OPEN": CLOSED_TO_ROUNDING,
        "SAME_BRANCH": SAME_BRANCH, "SMALL_STEP": SMALL_STEP, "MOST_TURNING": MOST_TURNING,
        "MOST_BOUND": MOST_BOUND,
    }  # fmt: skip
