"""The motion of all joints from the motors', module by module: each along its own way.

Modules do not depend on each other. The threads of a kernel close each of each sample, one part of its way
after the other, and begin the next module where one has come to its end; a second kernel joins them.
Functions for kernels of users close one module after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..compiled import Program, RobotPrograms, sample_code
from ..spatial import Array
from ..structure.robot import HybridRobot
from .functions import HEAD, ByModules, Native, on_rows, on_tables, own_text, sizes_text, undefined

#: C function of the numbers of a module.
NUMBERS = "INLINE void numbers_of(int k, const Row &parameters, S *numbers) {{\n    {}\n}}\n"
CONSTANT = (
    "static const S table[] = {{{}}};\n"
    "    for (int i = 0; i < NUMBERS; i++) numbers[i] = table[k * NUMBERS + i];"
)
OF_PARAMETERS = "S given[PARAMETERS];\n    for (int i = 0; i < PARAMETERS; i++) given[i] = parameters[i];"
#: C function of a place of each module.
PLACES = (
    "INLINE int {}(int k, int i) {{\n"
    "    static const int table[] = {{{}}};\n"
    "    return table[k * {} + i];\n}}\n"
)


def following(
    programs: RobotPrograms, side: Sequence[str], closing: tuple[str, int], idm: Program | None = None
) -> Native:
    """Return "close", from the motors `side`, or with a program "idm" the function "idm_from_motors".

    Args:
        closing: What `modules_text` returns of the same motors.
    """
    robot, motors, dtype, parameters = programs.robot, len(side), programs.dtype, programs.parameter_inputs
    modules, count = closing
    given = [("near", robot.nq), *((name, motors) for name in ("position", "rate", "acceleration"))]
    motion = [("q", robot.nq), ("v", robot.nv), ("a", robot.nv)]
    sizes = {"ROBOT_NQ": robot.nq, "ROBOT_NV": robot.nv, "MOTORS": motors, "MODULES": count}
    sizes |= {"PARAMETERS": sum(size for _, size in parameters), "BASE": 7 * (robot.base == "moving")}
    head, tail = sizes_text(**sizes) + own_text("rows.h"), own_text("joined.h")
    names = [name for name, _ in (*given, *(parameters or given[:1]), *motion)]
    rows, tables = (", ".join(f"{name}_{kind}" for name in names) for kind in ("row", "table"))
    name, outputs, called = "close", motion, dict[str, Program]()
    alone, after = f"follow({{{rows}}})", f"joined({{{rows}}}, guards_row)"
    if idm is not None:
        name, outputs, called = "idm_from_motors", [*motion, *idm.outputs], {"idm": idm}
        alone, after = (f"efforts({{{rows}}}, tau_row, Code::{of})" for of in (alone, after))
        tail += own_text("efforts.h")
    given, guards = [*given, *parameters], ("guards", count)
    run = f"threads_closed(thread, threads, count, {{{tables}, guards_table}})"
    each = on_tables("modules", (given, [*motion, guards]), run, dtype, head + modules)
    last = on_rows(f"{name}_joined", ([*given, guards], outputs), called, after, dtype, head + tail)
    text = head + modules + tail + own_text("follow.h")
    whole = on_rows(name, (given, outputs), called, alone, dtype, text)
    return replace(whole, by_modules=ByModules(each, last, count))


def modules_text(programs: RobotPrograms, side: Sequence[str]) -> tuple[str, int]:
    """Return the C of `module_of`, for one module, and `threads_closed`, for many; and how many there are."""
    text, cases, turns, first = "", "", "", 0
    for n, one in enumerate(programs.modules(side)):
        own = _numbers_text(one.numbers, changing=bool(one.of_parameters))
        own += _places_text(programs.robot, one.modules, one.side, side)
        text += _shape_text(n, one.called, programs.module_walk(one) + own, programs.dtype)
        more = len(one.modules)
        cases += f"    if (k < {first + more}) return Shape{n}::module_closed(k - {first}, r);\n"
        turns += f"    Shape{n}::modules_closed(thread, threads, count, {more}, {first}, t);\n"
        first += more
    text += f"static S module_of(int k, const Rows &r) {{\n{cases}    return 0;\n}}\n"
    head = "static void threads_closed(int thread, int threads, int count, const Tables &t)"
    return f"{text}{head} {{\n{turns}}}\n", first


def _shape_text(number: int, called: Mapping[str, Program], more: str, dtype: str) -> str:
    """Return the structure of the C of modules of one shape; `more` is their walk, and what it needs."""
    parts = [
        f"struct Shape{number} {{",
        sample_code(called, dtype, HEAD).functions,
        *undefined(more),
        more,
        own_text("module.h"),
        "};\n",
    ]
    return "\n".join(parts)


def _numbers_text(numbers: Array, *, changing: bool) -> str:
    """Return the C function `numbers_of`; they change with parameters, or are those given for each module."""
    if not changing:
        values = ", ".join(f"(S){float(x)!r}" for x in numbers.ravel()) or "0"
        return NUMBERS.format(CONSTANT.format(values))
    cases = (f"if (k == {k}) numbers_{k}_run(given, numbers, 0);" for k in range(len(numbers)))
    return NUMBERS.format("\n    ".join([OF_PARAMETERS, *cases]))


def _places_text(robot: HybridRobot, chosen: Sequence[int], given: Sequence[int], side: Sequence[str]) -> str:
    """Return the C functions of where in the robot coordinates, freedoms and motors of modules are."""
    modules = [robot.modules[k] for k in chosen]
    motor = {robot.v_slices[robot.joint_index[name]].start: i for i, name in enumerate(side)}
    motors = np.array([[motor[m.v_index[c]] for c in given] for m in modules], dtype=int)
    tables: dict[str, Array] = {
        "q_of": np.array([m.q_index for m in modules]),
        "v_of": np.array([m.v_index for m in modules]),
        "motor_of": motors,
    }
    return "".join(
        PLACES.format(name, ", ".join(map(str, table.ravel().tolist())) or "0", table.shape[1])
        for name, table in tables.items()
    )
