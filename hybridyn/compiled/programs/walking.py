"""The walk of joints along an assembly branch, and the control step with it: one C text for exports and Warp.

From where some joints are, the walk takes them straight to where they are wanted, in parts (`c/walk.h`): in
each, Newton's method closes the loops (`c/newton.h`, as it does for tables, designs and steps in time), and
their rows must not turn by more than `assembly.walk` allows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...assembly.walk import FARTHEST
from ...linkage.newton import LONGEST_STEP
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..code.plain_c import prototype
from ..code.scalars import GUARD_LIMIT, c_text
from ..equations.request import Request
from ..equations.scales import GUARD_CLOSED
from ..program import Program, stored
from .close import turning_program
from .closing.closing_source import SHORTEST
from .module_loops import ModuleLoops

#: Guard of a walk that does not come to its end; no other guard has this value.
OTHER_BRANCH = 1e30
#: Guard of a last step before which rates and accelerations are those after it.
SETTLED_GUARD = 1e-3
#: Length of a Newton step after which a part of a walk ends: the error it leaves is its square, rounding.
ROUGH_END = {"float64": 1e-7, "float32": 3e-4}
#: How many times as short the parts of a module's walk may be as those of a whole robot. With 1, three of a
#: thousand wide ways of the LX4 end before folds that a robot comes to, as other modules shorten its parts.
MORE_PARTS = 4
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
    sizes: dict[str, int | str] = {
        "NQ": robot.nq, "NV": robot.nv, "SIDE": len(side), "POSED": int(posed), "GIVEN": program.sizes[0],
        "NUMBERS": sum(size for _, size in request.parameter_inputs), "STEP": "close_run", "RATED": 1,
        "WRENCHES": sum(size for _, size in request.wrench_inputs),
    }  # fmt: skip
    tables = _units_text(_unit_sizes(robot)) + joints_text(robot, side)
    return _text(sizes, request.dtype, settled) + tables + _walk()


def module_walk_text(request: Request, loops: ModuleLoops) -> str:
    """Return the C of the walk of one module, with the programs of its shape."""
    robot = request.robot
    modules = [robot.modules[k] for k in loops.modules]
    tree = modules[0].mechanism.spanning
    sizes: dict[str, int | str] = {
        "NQ": tree.nq, "NV": tree.nv, "SIDE": len(loops.side), "POSED": 0, "GIVEN": loops.close.sizes[0],
        "NUMBERS": loops.numbers.shape[1], "STEP": "newton_run", "RATED": 0,
    }  # fmt: skip
    starts = [at.start for at in tree.v_slices]
    joints, farthest = [starts.index(column) for column in loops.side], _farthest(robot)
    text = _joints_text(
        [tree.q_slices[i].start for i in joints],
        loops.side,
        [tree.joints[i].kind.endless for i in joints],
        farthest[modules[0].v_index[list(loops.side)]],
    )
    units = _units_text(_unit_sizes(robot)[modules[0].q_index])
    return _text(sizes, request.dtype) + units + text + _walk()


def _text(sizes: dict[str, int | str], dtype: str, settled: float = SETTLED_GUARD) -> str:
    """Return the macros that `side.h` needs."""
    closed = GUARD_CLOSED[dtype]
    rough = max(ROUGH_END[dtype] / closed, settled)
    alone = not sizes["RATED"]
    last = min(rough, GUARD_LIMIT) if alone else settled
    names = sizes | {
        "CLOSED": closed, "LONGEST": LONGEST_STEP, "ROUGH": rough, "LAST": last, "WILD": SHORTEST,
        "SHORTEST": SHORTEST / MORE_PARTS if alone else SHORTEST,
        "AIM": AIM, "OTHER_BRANCH": OTHER_BRANCH,
    }  # fmt: skip
    return "".join(f"#define {name} {value}\n" for name, value in names.items())


def _walk() -> str:
    """Return the C of a walk."""
    return "".join(map(c_text, ("newton.h", "walk.h", "side.h")))


def _units_text(sizes: Array) -> str:
    """Return the C function `unit_size`."""
    return TABLE.format("int", "unit_size", ", ".join(map(str, sizes.tolist())) or "0")


def _unit_sizes(robot: HybridRobot) -> Array:
    """Return how many coordinates of length one begin at each of q, shape (nq,)."""
    out = np.zeros(robot.nq, dtype=int)
    for columns in robot.unit_coordinates:
        out[columns[:, 0]] = columns.shape[1]
    return out


def _farthest(robot: HybridRobot) -> Array:
    """Return how far each freedom may move in one part of a walk, shape (nv,), [rad, m]."""
    out = np.full(robot.nv, UNLIMITED)
    for module in robot.modules:
        if module.mechanism.spanning_closures.rows:
            out[module.v_index] = FARTHEST * module.mechanism.spanning_col_scale
    return out


def joints_text(robot: HybridRobot, side: Sequence[str]) -> str:
    """Return C functions of joints: their place `at` in q, their `column` in v, whether each `turns`.

    The last, `farthest`, is how far each may move in one part of a walk [rad, m].
    """
    numbers = [robot.joint_index[name] for name in side]
    columns = [robot.v_slices[i].start for i in numbers]
    at = [robot.q_slices[i].start for i in numbers]
    return _joints_text(at, columns, [robot.kinds[i].endless for i in numbers], _farthest(robot)[columns])


def _joints_text(at: Sequence[int], columns: Sequence[int], turns: Sequence[bool], farthest: Array) -> str:
    """Return the C of `joints_text`."""
    tables = [
        ("int", "at", at),
        ("int", "column", columns),
        ("int", "turns", map(int, turns)),
        ("S", "farthest", [f"(S){x!r}" for x in farthest.tolist()]),
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
