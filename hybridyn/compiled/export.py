"""A robot's models as a folder of C99: header, source, a test with reference values, Makefile, README."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..ddm import ddm
from ..effects.choice import Choice, choose
from ..errors import HybridynError, ModelError
from ..idm import idm
from ..robot import HybridRobot
from ..spatial import Array
from .bodies import body_rows
from .exporting import plain_source, prototype, work_type
from .model import write_programs
from .printing import literal
from .program import Program

SAMPLES = 5
"""Reference states in the test."""

AGREE = 1e-9
"""What the test allows, relative to each result's largest entry: another compiler may round otherwise."""

WHAT = {
    "idm": "Inverse dynamic model: motor efforts tau [N, N m] from positions q, rates v and accelerations a.",
    "ddm": "Direct dynamic model: accelerations a from positions q, rates v and motor efforts tau.",
    "kinematics": "Motion of every body in the world, 24 numbers each: axes row by row, origin, velocity, "
    "angular velocity, acceleration (classical), angular acceleration.",
}


def export(
    robot: HybridRobot, directory: str | Path, effects: Choice = None, *, name: str | None = None
) -> list[Path]:
    """Write a robot's models as C for other programs.

    Args:
        robot: The robot.
        directory: Folder that the files go to; made where it is not there.
        effects: As `hybridyn.idm` takes them.
        name: Prefix of files and names in C; the robot's own where left out.

    Returns:
        The files.

    Raises:
        ModelError: An effect is not for written-out models, or the name is no name in C.
        CompileError: casadi is not installed.
    """
    name = c_name(robot.description.name) if name is None else name
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise ModelError(f"'{name}' is no name in C: letters, digits and _ only", element=name)
    on = choose(robot, effects)
    programs = list(write_programs(robot, on).values())
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    contents = {
        f"{name}.h": _header(robot, programs, name),
        f"{name}.c": plain_source(programs, name),
        f"test_{name}.c": _test(robot, on, programs, name),
        "Makefile": _makefile(name),
        "README.md": _readme(robot, on.names, programs, name),
    }
    paths = [folder / file for file in contents]
    for path, text in zip(paths, contents.values(), strict=True):
        path.write_text(text)
    return paths


def c_name(text: str) -> str:
    """Make a name in C of any name."""
    name = re.sub(r"\W", "_", text, flags=re.ASCII).lower() or "robot"
    return name if not name[0].isdigit() else f"robot_{name}"


def _body_names(robot: HybridRobot) -> list[str]:
    """Give each body a name: that of the first link that is part of it and stands in its frame."""
    names = [""] * len(robot.bodies.bodies)
    for link, (body, _, _) in robot.bodies.place.items():
        names[body] = names[body] or link
    return names


def _places(names: Sequence[str], places: Sequence[slice]) -> list[str]:
    """Give lines that say where each name's numbers are."""
    return [f"     {at.start}..{at.stop - 1}  {name}" for name, at in zip(names, places, strict=True)]


def _header(robot: HybridRobot, programs: list[Program], name: str) -> str:
    """Give the header."""
    motors = [f"     {i}  {motor}" for i, motor in enumerate(robot.motors)]
    bodies = [f"     {24 * i}..{24 * i + 23}  {link}" for i, link in enumerate(_body_names(robot))]
    about = [
        f"/* Dynamics of the robot '{robot.description.name}', base {robot.base}, written by hybridyn.",
        "   SI units; positions and rates in the order and the coordinates of Pinocchio:",
        "   q", *_places(robot.joints, robot.q_slices),
        "   v, a", *_places(robot.joints, robot.v_slices),
        "   tau", *motors,
        "   bodies", *bodies,
        "",
        "   Each function gives a guard: at most 1 where its results may be trusted. Above 1 or NaN,",
        "   positions and rates do not close the loops, or the robot is near a posture where the pivots of",
        "   the elimination vanish: do not use the results. `work` is memory of yours;",
        "   nothing in it is kept between calls. */",
    ]  # fmt: skip
    guard = f"{name.upper()}_H"
    lines = ["\n".join(about), f"#ifndef {guard}\n#define {guard}"]
    for program in programs:
        lines += [work_type(program, name), f"/* {WHAT[program.name]} */\n{prototype(program, name)};"]
    return "\n\n".join([*lines, "#endif"]) + "\n"


def _test(robot: HybridRobot, effects: Any, programs: list[Program], name: str) -> str:
    """Give the test: states, and what the general path makes of them."""
    from .states import random_states

    q, v, _, tau = random_states(robot, SAMPLES, seed=1)
    a = ddm(robot, q, v, tau, effects=effects)
    known = {
        "q": q,
        "v": v,
        "tau": tau,
        "a": a,
        "base_acceleration": a[:, :6],
        "bodies": body_rows(robot, q, v, a),
    }
    lines = [
        f'#include <math.h>\n#include <stdio.h>\n\n#include "{name}.h"',
        "/* Largest difference, relative to the largest entry of what was expected. */\n"
        "static double difference(const double *result, const double *expected, int n) {\n"
        "    double worst = 0.0, scale = 0.0;\n    int k;\n    for (k = 0; k < n; k++) {\n"
        "        scale = fmax(scale, fabs(expected[k]));\n"
        "        worst = fmax(worst, fabs(result[k] - expected[k]));\n"
        "        if (result[k] != result[k]) return HUGE_VAL;\n    }\n"
        "    return scale > 0.0 ? worst / scale : worst;\n}",
    ]
    calls: list[str] = []
    for program in programs:
        values = dict(known)
        if program.name == "idm":
            try:
                values["tau"] = idm(robot, q, v, a, effects=effects)
            except HybridynError:  # motors that cannot do it: there is nothing to compare
                continue
        if robot.base == "moving" and program.name == "ddm":
            values["a"] = ddm(robot, q, v, tau, effects=effects, base_acceleration=a[:, :6])
        lines += [_array(f"{program.name}_{n}", values[n]) for n, _ in (*program.inputs, *program.outputs)]
        calls += _check(program, name)
    body = ["int main(void) {", "    double worst = 0.0;", "    int t;", *calls]
    body += [
        '    printf("largest difference from the reference: %.2g (limit ' + f"{AGREE:g})" + '\\n", worst);',
        f"    return worst <= {AGREE!r} ? 0 : 1;", "}",
    ]  # fmt: skip
    return "\n\n".join([*lines, "\n".join(body)]) + "\n"


def _array(name: str, values: Array) -> str:
    """Give samples as an array in C."""
    rows = ",\n    ".join("{" + ", ".join(map(literal, row.tolist())) + "}" for row in values)
    return f"static const double {name}[{values.shape[0]}][{max(values.shape[1], 1)}] = {{\n    {rows}}};"


def _check(program: Program, name: str) -> list[str]:
    """Give the lines that run a program on every state and compare."""
    ((output, size),) = program.outputs
    arguments = ", ".join([f"{program.name}_{n}[t]" for n, _ in program.inputs] + ["result", "&work"])
    return [
        f"    for (t = 0; t < {SAMPLES}; t++) {{",
        f"        static {name}_{program.name}_work work;",
        f"        double result[{size}];",
        f"        const double guard = {name}_{program.name}({arguments});",
        f"        const double off = difference(result, {program.name}_{output}[t], {size});",
        f'        printf("{program.name} %d: guard %.2g, difference %.2g\\n", t, guard, off);',
        "        if (guard <= 1.0) worst = fmax(worst, off);",
        "    }",
    ]


def _makefile(name: str) -> str:
    """Give the Makefile."""
    return "\n".join(
        [
            "CFLAGS ?= -O2 -march=native", "WARN = -std=c99 -Wall -Wextra -pedantic", "",
            f"test: test_{name}", f"\t./test_{name}", "",
            f"test_{name}: test_{name}.c {name}.c {name}.h",
            f"\t$(CC) $(WARN) $(CFLAGS) -o $@ test_{name}.c {name}.c -lm", "",
            "clean:", f"\trm -f test_{name}", "", ".PHONY: test clean", "",
        ]
    )  # fmt: skip


def _readme(robot: HybridRobot, effects: Sequence[str], programs: list[Program], name: str) -> str:
    """Give the README."""
    functions = "\n".join(f"    {prototype(program, name)};" for program in programs)
    return f"""# Dynamics of '{robot.description.name}' in C

Written by hybridyn. C99, no allocation, no library but the C library's mathematics. Base: {robot.base}.
Effects: {", ".join(effects) or "none"}.
What each number of `q`, `v`, `a` and `tau` means stands in `{name}.h`.

{functions}

Each gives a guard: use the results where it is at most 1. `work` is memory of the caller; one per thread.

`make test` compares with {SAMPLES} states computed by hybridyn's general path. `make` passes `CFLAGS` on;
with a processor that has fused multiplication and addition, `-march=native` lets the compiler use it.
"""
