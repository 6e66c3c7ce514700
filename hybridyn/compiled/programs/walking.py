"""The walk of joints along an assembly branch, and the control step with it: one C text for exports and Warp.

From where some joints are, the walk takes them straight to where they are wanted, in parts (`c/walk.h`): in
each, Newton's method closes the loops (`c/newton.h`, as it does for tables, designs and steps in time), and
their rows must not turn by more than `assembly.follow` allows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...assembly.follow import FARTHEST
from ...linkage.newton import LONGEST_STEP
from ...structure.robot import HybridRobot
from ..code.plain_c import prototype
from ..code.scalars import GUARD_LIMIT, c_text
from ..equations.request import Request
from ..equations.scales import GUARD_CLOSED
from ..program import Program, stored
from .close import turning_program
from .closing.closing_source import SHORTEST

#: Guard of a walk that does not come to its end; no other guard has this value.
OTHER_BRANCH = 1e30
#: Guard of a last step before which rates and accelerations are those after it.
SETTLED_GUARD = 1e-3
#: Length of a Newton step after which a part of a walk ends: the error it leaves is its square, rounding.
ROUGH_END = {"float64": 1e-7, "float32": 3e-4}
#: How far the next part of a walk shall turn the rows, of what is allowed. At 0.7 and 0.9 walks of shipped
#: robots take as many steps or more.
AIM = 0.8
#: How far a joint without loops may move in one part of the way.
UNLIMITED = 1e30
#: C function of the joints of one side.
TABLE = "INLINE {0} {1}(int m) {{\n    static const {0} table[] = {{{2}}};\n    return table[m];\n}}\n"


def walk_text(
    request: Request,
    program: Program,
    side: Sequence[str],
    *,
    posed: bool = False,
    settled: float = SETTLED_GUARD,
) -> str:
    """Return the C of the walk with a program that closes the loops from the positions of some joints.

    Args:
        request: What the program is asked for.
        program: The program.
        side: The joints.
        posed: Whether their positions are an input of the program, beside "near".
        settled: Guard at which the rates are taken; 1 if a guard of the rates follows.
    """
    robot = request.robot
    closed = GUARD_CLOSED[request.dtype]
    names = {
        "NQ": robot.nq, "NV": robot.nv, "SIDE": len(side), "POSED": int(posed), "GIVEN": program.sizes[0],
        "NUMBERS": sum(size for _, size in request.parameter_inputs), "CLOSED": closed,
        "LONGEST": LONGEST_STEP, "ROUGH": max(ROUGH_END[request.dtype] / closed, settled), "SETTLED": settled,
        "SHORTEST": SHORTEST, "AIM": AIM, "OTHER_BRANCH": OTHER_BRANCH,
        "WRENCHES": sum(size for _, size in request.wrench_inputs),
    }  # fmt: skip
    lines, units = [f"#define {name} {value!r}" for name, value in names.items()], ["0"] * robot.nq
    for columns in robot.unit_coordinates:
        for column in columns[:, 0].tolist():
            units[column] = str(columns.shape[1])
    table = TABLE.format("int", "unit_size", ", ".join(units) or "0")
    text = "".join(map(c_text, ("newton.h", "walk.h", "side.h")))
    return "\n".join([*lines, joints_text(robot, side) + table + text])


def joints_text(robot: HybridRobot, side: Sequence[str]) -> str:
    """Return C functions of joints: their place `at` in q, their `column` in v, whether each `turns`.

    The last, `farthest`, is how far each may move in one part of a walk [rad, m].
    """
    numbers, farthest = [robot.joint_index[name] for name in side], np.full(robot.nv, UNLIMITED)
    for module in robot.modules:
        if module.mechanism.spanning_closures.rows:
            farthest[module.v_index] = FARTHEST * module.mechanism.spanning_col_scale
    columns = [robot.v_slices[i].start for i in numbers]
    tables = [
        ("int", "at", [robot.q_slices[i].start for i in numbers]),
        ("int", "column", columns),
        ("int", "turns", [int(robot.kinds[i].endless) for i in numbers]),
        ("S", "farthest", [f"(S){x!r}" for x in farthest[columns].tolist()]),
    ]
    return "".join(TABLE.format(kind, name, ", ".join(map(str, of)) or "0") for kind, name, of in tables)


def control_step(
    request: Request, close: Program, inverse: Program, name: str
) -> tuple[Program, Program, str]:
    """Return the exported control step: its arguments and workspace, the program "turning", and its C.

    Inputs are "last", a posture that closes the loops, the motors' "position", and "v" and "a" as of "close".
    Outputs are those of "close" and of "idm".
    """
    motors = request.robot.motors
    read = [("last", close.inputs[0][1]), *close.inputs[1:], *request.wrench_inputs]
    inputs = read[0], ("position", len(motors)), *read[1:]
    outputs = *close.outputs, *inverse.outputs
    called = close, turning_program(request, motors), inverse
    room = max(sum(program.sizes) for program in called)
    step = Program("idm_from_motors", inputs, outputs, (), (), 0, room)
    each = "    for (k = 0; k < {}; k++) {};"
    text = [
        *(run_text(program, name) for program in called),
        c_text("one_lane.h"),
        walk_text(request, close, motors, settled=GUARD_LIMIT) + c_text("control.h"),
        f"{prototype(step, name, request.dtype)} {{",
        f"    S guard, *start = work->numbers, *result = start + {sum(size for _, size in read)};",
        "    int k;",
        *(each.format(n, f"start[{at} + k] = {word}[k]") for word, n, at in stored(read)),
        f"    guard = control(start, position, result, result + {step.sizes[1]});",
        *(each.format(n, f"{word}[k] = result[{at} + k]") for word, n, at in stored(outputs)),
        "    return guard;\n}",
    ]
    return step, called[1], "\n".join(text)


def run_text(program: Program, name: str) -> str:
    """Return the C function by which a walk calls an exported one: numbers one after the other."""
    ends = ("x", program.inputs), ("y", program.outputs)
    places = [f"{memory} + {at}" for memory, parts in ends for _, _, at in stored(parts)]
    called = f"{name}_{program.name}"
    return (
        f"static S {program.name}_run(const S *x, S *y, S *room) {{\n    (void)y;\n"
        f"    return {called}({', '.join(places)}, ({called}_work *)room);\n}}"
    )
