"""The C library that closes rows for many designs: the programs, and the loop in `c/design_rows.h`."""

from __future__ import annotations

from collections.abc import Sequence

from ....structure.robot import HybridRobot
from ...code.library_source import Source, library_source
from ...code.scalars import Scalar, text_of
from ...equations.arguments.chosen import ChosenNumbers
from .closing_programs import closing_programs
from .closing_source import constants_of, far_source
from .part import Part

#: Most last steps of a row: each squares the one before.
LAST_STEPS = 3


def design_source(robot: HybridRobot, parts: Sequence[Part], chosen: ChosenNumbers, scalar: Scalar) -> Source:
    """Generate the C source for one choice of given joints and targets."""
    programs = closing_programs(robot, parts, chosen)
    names = constants_of(programs) | {"SLOTS": chosen.size, "LAST_STEPS": LAST_STEPS}
    names["PROGRAMS_WORK"] = max(program.shared + program.own for program in programs.values()) + 1
    names |= {f"{name}_SHARED": program.shared for name, program in programs.items()}
    lines = [f"#define {name} {value!r}" for name, value in names.items()]
    lines += [far_source(parts), text_of("design_rows.h")]
    return library_source(list(programs.values()), scalar, "\n".join(lines))
