"""Export a robot's models as a folder of C99: header, source, test, Makefile and README."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..description.writing import write_text
from ..effects.choice import Choice, choose
from ..errors import CompileError, ModelError
from ..structure.robot import HybridRobot
from .failures import as_compile_error
from .needs import WITHOUT_CASADI
from .verifying import check_trusted

try:
    from .code.plain_c import REAL, WRITTEN, plain_source, prototype, work_type
    from .equations.request import request
    from .export_reference import SAMPLES, guards_of, test_text
    from .program import Program
    from .programs.close import largest_turn
    from .programs.closing.platform_program import close_platforms_program, posed_modules
    from .programs.whole_robot import programs
except ModuleNotFoundError as error:
    raise CompileError(WITHOUT_CASADI) from error

WHAT = {
    "idm": "Inverse dynamic model: motor efforts tau [N, N m] from positions q, rates v and accelerations a.",
    "ddm": "Direct dynamic model: accelerations a from positions q, rates v and motor efforts tau.",
    "kinematics": "Motion of every body in the world, 24 numbers each: axes row by row, origin, velocity, "
    "angular velocity, acceleration (classical), angular acceleration.",
    "close": "Loops closed from what the motors do: one Newton step from a posture `near`, in which the "
    "motors are where they are and the others where they were, and all joints' rates and accelerations; of v "
    "and a the motors' entries are read, a free base's, and those of joints that no motor moves. Call it "
    "again with its q until the guard is at most 1: three or four times from the last tick's posture.",
    "close_platforms": "Loops closed from where the platforms are: `pose` (x, y, z, qx, qy, qz, qw) of each "
    "platform in the base of its module, `twist` (velocity of its origin, angular velocity) and `twist_dot` "
    "(their time derivatives, classical) in the axes of that base. Other modules follow their motors as in "
    "`close`. Call it again with its q until the guard is at most 1.",
}


def export(
    robot: HybridRobot,
    directory: str | Path,
    effects: Choice = None,
    *,
    name: str | None = None,
    dtype: str = "float64",
) -> list[Path]:
    """Write a robot's models as C source for other programs.

    Args:
        robot: The robot.
        directory: Folder for the files; it is created if it does not exist.
        effects: Effects to include, as for `hybridyn.idm`.
        name: Prefix of the files and of all C identifiers; default the robot's name.
        dtype: "float64", or "float32" for processors with single precision only.

    Returns:
        Paths of the written files.

    Raises:
        ModelError: An effect is not available in compiled models, `dtype` is invalid, `name` is not a C
            identifier, or a file of the same name exists that hybridyn did not write.
        CompileError: casadi is not installed, the models cannot be generated, or their guards are above 1 at
            every random state.
    """
    name = c_name(robot.description.name) if name is None else name
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise ModelError(
            f"'{name}' is not a C identifier: use letters, digits and _, no digit first", element=name
        )
    if dtype not in REAL:
        raise ModelError(f"dtype must be 'float64' or 'float32', not {dtype!r}")
    on = choose(robot, effects)
    if on.limits is not None:
        raise ModelError(
            "the effect 'limits' is not exported: clip the efforts before the call", element="limits"
        )
    with as_compile_error(robot):
        names = tuple(name for name in WHAT if name != "close_platforms")
        models = list(programs(robot, on, models=names, dtype=dtype).values())
        posed = close_platforms_program(request(robot, on, dtype=dtype))
        models += [] if posed is None else [posed]
        check_trusted(guards_of(models), robot, on)
        contents = {
            f"{name}.h": _header(robot, models, name, dtype),
            f"{name}.c": plain_source(models, name, dtype),
            f"test_{name}.c": test_text(robot, on, models, name, dtype),
            "Makefile": _makefile(name),
            "README.md": _readme(robot, on.names, models, name, dtype),
        }
    folder = Path(directory)
    paths = [folder / file for file in contents]
    for path in paths:
        _check_replaceable(path)
    folder.mkdir(parents=True, exist_ok=True)
    for path, text in zip(paths, contents.values(), strict=True):
        write_text(path, text)
    return paths


def _check_replaceable(path: Path) -> None:
    """Check that a path is free or has a file that hybridyn wrote.

    Raises:
        ModelError: Another file is at this path.
    """
    if path.exists() and WRITTEN not in path.read_text(encoding="utf-8", errors="replace"):
        raise ModelError(f"'{path}' exists and was not written by hybridyn: name another folder")


def c_name(text: str) -> str:
    """Convert any name to a C identifier."""
    name = re.sub(r"\W", "_", text, flags=re.ASCII).lower() or "robot"
    return name if not name[0].isdigit() else f"robot_{name}"


def _body_names(robot: HybridRobot) -> list[str]:
    """Return a name for each body: its first link, whose frame is the body's."""
    names = [""] * len(robot.bodies.bodies)
    for link, (body, _, _) in robot.bodies.place.items():
        names[body] = names[body] or link
    return names


def _places(names: Sequence[str], places: Sequence[slice]) -> list[str]:
    """Return lines that list the index range of each name."""
    return [f"     {at.start}..{at.stop - 1}  {name}" for name, at in zip(names, places, strict=True)]


def _comment(lines: Sequence[str]) -> str:
    """Return a C comment; line breaks and comment signs inside names are made harmless."""
    text = "\n".join(" ".join(re.split(r"[\r\n]", line)) for line in lines)
    return f"/* {re.sub(r'/(?=[*])|[*](?=/)', lambda sign: sign.group() + ' ', text)} */"


def _header(robot: HybridRobot, programs: list[Program], name: str, dtype: str) -> str:
    """Return the header."""
    from .equations.guards import GUARD_CLOSED

    motors = [f"     {i}  {motor}" for i, motor in enumerate(robot.motors)]
    bodies = [f"     {24 * i}..{24 * i + 23}  {link}" for i, link in enumerate(_body_names(robot))]
    about = [
        f"Dynamics of the robot '{robot.description.name}', base {robot.base}. {WRITTEN}.",
        "   SI units; positions and rates in the order and the coordinates of Pinocchio:",
        "   q", *_places(robot.joints, robot.q_slices),
        "   v, a", *_places(robot.joints, robot.v_slices),
        "   tau", *motors,
        "   bodies", *bodies,
        *(["   pose, twist, twist_dot", *_posed(robot)] if posed_modules(robot) else []),
        "",
        "   Each function gives a guard: use the results where `guard <= 1`, and nowhere else. Above 1,",
        "   positions, rates or accelerations do not close the loops (to "
        f"{GUARD_CLOSED[dtype]:g} of their size),",
        "   or the robot is near a posture where the pivots of the elimination vanish. NaN: a number that",
        "   is not finite came in or out. `work` is memory of yours; nothing in it is kept between calls,",
        "   and nothing else is written: calls may run at the same time, each with its own.",
    ]  # fmt: skip
    guard = f"{name.upper()}_H"
    lines = [_comment(about), f"#ifndef {guard}\n#define {guard}", '#ifdef __cplusplus\nextern "C" {\n#endif']
    for program in programs:
        lines.append(work_type(program, name, dtype))
        lines.append(f"/* {WHAT[program.name]} */\n{prototype(program, name, dtype)};")
    return "\n\n".join([*lines, "#ifdef __cplusplus\n}\n#endif", "#endif"]) + "\n"


def _posed(robot: HybridRobot) -> list[str]:
    """Return lines that list the platforms of the function `close_platforms` with their bases."""
    names = _body_names(robot)
    out = []
    for i, k in enumerate(posed_modules(robot)):
        module = robot.modules[k]
        m = module.mechanism
        joint = module.joints[int(m.cut.bodies[m.spec.platforms[0] + 1]) - 1]
        platform, base = names[robot.body_of_joint[joint]], names[robot.bodies.place[module.base][0]]
        out.append(f"     {7 * i}..{7 * i + 6}, {6 * i}..{6 * i + 5}  {platform} in {base}")
    return out


def _makefile(name: str) -> str:
    """Return the Makefile."""
    return "\n".join(
        [
            f"# {WRITTEN}.", "CFLAGS ?= -O2 -march=native", "WARN = -std=c99 -Wall -Wextra -pedantic", "",
            f"test: test_{name}", f"\t./test_{name}", "",
            f"test_{name}: test_{name}.c {name}.c {name}.h",
            f"\t$(CC) $(WARN) $(CFLAGS) -o $@ test_{name}.c {name}.c -lm", "",
            "clean:", f"\trm -f test_{name}", "", ".PHONY: test clean", "",
        ]
    )  # fmt: skip


def _readme(
    robot: HybridRobot, effects: Sequence[str], programs: list[Program], name: str, dtype: str
) -> str:
    """Return the README."""
    functions = "\n".join(f"    {prototype(program, name, dtype)};" for program in programs)
    return f"""# Dynamics of '{robot.description.name}' in C

{WRITTEN}. C99, also for C++ (compile the source as C). The code allocates no memory and needs no library but
the C library's mathematics. Base: {robot.base}. Effects: {", ".join(effects) or "none"}.
`{name}.h` lists the meaning of each number of `q`, `v`, `a` and `tau`.

{functions}

Each function returns a guard. Use the results only if it is at most 1, and provide a fallback for other
samples. The guard is above 1 near singular postures and if the loops are open, and NaN if a number is not
finite. `q`, `v` and `a` are those of all joints and must close the loops{_closing(robot, programs, name)}.
The caller provides the memory `work`, one for each thread. `-ffast-math` would remove the NaN of the guard
and is refused.

`make test` compares with {SAMPLES} states computed by hybridyn's general path. `make` passes `CFLAGS` on.
On a processor with fused multiplication and addition, `-march=native` lets the compiler use it.
"""


def _closing(robot: HybridRobot, programs: list[Program], name: str) -> str:
    """Return what the README says of the function `close`."""
    if all(program.name != "close" for program in programs):
        return (
            ". There is no\nfunction that computes them from the motors': a gear between endless joints "
            "loses count of its turns"
        )
    turn = largest_turn(robot.modules)
    limit = f", which\nmay turn by less than {turn:.2g} rad between calls" if turn < np.pi else ""
    return f": `{name}_close`\ncomputes them from the motors'{limit}"
