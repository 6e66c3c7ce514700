"""The C that closes the loops of a robot module by module, each along its own way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..compiled import ModuleLoops, RobotPrograms, sample_code
from ..spatial import Array
from ..structure.robot import HybridRobot
from .functions import HEAD, own_text, sizes_text

#: C function of the numbers of a module.
NUMBERS = "INLINE void numbers_of(int k, const S *parameters, S *numbers) {{\n    {}\n}}\n"
CONSTANT = (
    "static const S table[] = {{{}}};\n"
    "    for (int i = 0; i < NUMBERS; i++) numbers[i] = table[k * NUMBERS + i];"
)
#: C function of a place of each module.
PLACES = (
    "INLINE int {}(int k, int i) {{\n"
    "    static const int table[] = {{{}}};\n"
    "    return table[k * {} + i];\n}}\n"
)


def modules_text(programs: RobotPrograms, side: Sequence[str]) -> str:
    """Return the C of `follow`, which closes all modules of a robot from its motors `side`."""
    robot, shapes, text = programs.robot, programs.modules(side), ""
    sizes = {"ROBOT_NQ": robot.nq, "ROBOT_NV": robot.nv, "MOTORS": len(side)}
    sizes["ROBOT_GIVEN"] = robot.nq + 3 * len(side) + sum(size for _, size in programs.parameter_inputs)
    sizes |= {"MODULES": sum(len(one.modules) for one in shapes), "BASE": 7 * (robot.base == "moving")}
    cases, first = "", 0
    for n, one in enumerate(shapes):
        text += _shape_text(programs, one, side, n)
        cases += f"    if (k < {first + len(one.modules)}) "
        cases += f"return Shape{n}::module_closed(k - {first}, given, result);\n"
        first += len(one.modules)
    of = f"static S module_of(int k, const S *given, S *result) {{\n{cases}    return 0;\n}}\n"
    return sizes_text(**sizes) + text + of + own_text("modules.h")


def _shape_text(programs: RobotPrograms, loops: ModuleLoops, side: Sequence[str], number: int) -> str:
    """Return the structure of the C of modules of one shape."""
    called = {"newton": loops.newton, "close": loops.close, "turning": loops.turning}
    called |= {f"numbers_{k}": program for k, program in enumerate(loops.of_parameters)}
    walk = programs.module_walk(loops)
    names = [line.split()[1] for line in walk.splitlines() if line.startswith("#define ")]
    parts = [
        f"struct Shape{number} {{",
        sample_code(called, programs.dtype, HEAD).functions,
        *(f"#undef {name}" for name in names),
        walk,
        _numbers_text(loops) + _places_text(programs.robot, loops, side),
        own_text("module.h"),
        "};\n",
    ]
    return "\n".join(parts)


def _numbers_text(loops: ModuleLoops) -> str:
    """Return the C function `numbers_of`."""
    if not loops.of_parameters:
        values = ", ".join(f"(S){float(x)!r}" for x in loops.numbers.ravel()) or "0"
        return NUMBERS.format(CONSTANT.format(values))
    cases = (f"if (k == {k}) numbers_{k}_run(parameters, numbers, 0);" for k in range(len(loops.modules)))
    return NUMBERS.format("\n    ".join(cases))


def _places_text(robot: HybridRobot, loops: ModuleLoops, side: Sequence[str]) -> str:
    """Return the C functions of where a module's coordinates, freedoms and motors are in the robot's."""
    modules = [robot.modules[k] for k in loops.modules]
    motor = {robot.v_slices[robot.joint_index[name]].start: i for i, name in enumerate(side)}
    motors = np.array([[motor[m.v_index[c]] for c in loops.side] for m in modules], dtype=int)
    tables: dict[str, Array] = {
        "q_of": np.array([m.q_index for m in modules]),
        "v_of": np.array([m.v_index for m in modules]),
        "motor_of": motors,
    }
    return "".join(
        PLACES.format(name, ", ".join(map(str, table.ravel().tolist())) or "0", table.shape[1])
        for name, table in tables.items()
    )
