"""Export a robot's models as a folder of C99: header, source, test, Makefile and README."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..description.writing import write_text
from ..effects.choice import Choice
from ..errors import CompileError, ModelError
from ..spatial import Array
from ..structure.parameters.slots import values_of
from ..structure.robot import HybridRobot
from .failures import WITHOUT_CASADI, as_compile_error
from .programs.sources import asked_for
from .verifying import verify

try:
    from .acados import acados_text, motor_programs
    from .code.plain_c import WRITTEN, plain_source, prototype
    from .equations.request import request
    from .export_reference import SAMPLES, test_text
    from .program import Program
    from .programs.c_header import header_text
    from .programs.closing.platform_program import close_platforms_program
    from .programs.given_control import given_motion
    from .programs.given_step import given_step
    from .programs.map_programs import map_programs
    from .programs.walking import control_step
    from .programs.whole_robot import Interpreted, programs
except ModuleNotFoundError as error:
    raise CompileError(WITHOUT_CASADI) from error

#: Models that are exported of every robot; those that it does not have are left out.
ALWAYS = ("idm", "ddm", "kinematics", "close")


def export(
    robot: HybridRobot,
    directory: str | Path,
    effects: Choice = None,
    *,
    name: str | None = None,
    dtype: str = "float64",
    map_joints: Sequence[str] = (),
    parameters: Sequence[str] = (),
    wrenches: Sequence[str] = (),
    given: Sequence[str] = (),
    acados: bool = False,
) -> list[Path]:
    """Write a robot's models as C source for other programs.

    Args:
        directory: Folder for the files; it is created if it does not exist.
        effects: Effects to include, as for `hybridyn.idm`.
        name: Prefix of the files and of all C identifiers; default the robot's name.
        dtype: "float64", or "float32" for processors with single precision only.
        map_joints: Output joints whose map to their motors is written, too, as for `hybridyn.joint_map`.
        parameters: Numbers of the robot that are arguments of the functions, as for `hybridyn.compile`; the
            header lists them. The function `close_platforms` is then left out.
        wrenches: Links on which wrenches are arguments of the models of forces, as of feet that stand.
        given: Columns as in tables from which the control step `idm_from_given` takes its motion: LINK/pose,
            LINK@OTHER/pose/x, JOINT/position, ... Freedoms that they leave move least from the last tick.
        acados: Whether the direct model over the motors is written with two orders of derivatives, too, as
            functions that acados calls; for a fixed base and in double precision.

    Returns:
        Paths of the written files.

    Raises:
        ModelError: A parameter is unknown, or together with `map_joints`, `given` or `acados`; no wrench can
            act on a link; what is given cannot be met in C, or `dtype` is not "float64" with it; an effect is
            not available in compiled models; the functions for acados cannot have an effect, the base, the
            motors or an option; `dtype` is invalid, `name` is not a C identifier, no joint moves, or a file
            of the same name exists that hybridyn did not write.
        CompileError: casadi is not installed, the models cannot be generated, they differ from the general
            path, or their guards are above 1 at every random state.
        SingularityError, TrajectoryError: The output joints do not fit their modules, or are unknown.
    """
    name = checked_name(robot, name)
    robot, on, chosen = asked_for(robot, effects, parameters, dtype, "exported C")
    slots = chosen.slots
    if slots and map_joints:
        raise ModelError("the map of output joints has no parameters: export it by itself")
    if given and (slots or dtype != "float64"):
        raise ModelError("a control step from poses needs double precision, and has no parameters")
    if acados and (slots or wrenches or given or dtype != "float64"):
        raise ModelError(
            "functions for acados need double precision, and have no parameters, wrenches or 'given'"
        )
    values = np.array(values_of(robot.description, slots))
    with as_compile_error(robot):
        derived = motor_programs(robot, on) if acados else []
        built = programs(robot, on, models=ALWAYS, dtype=dtype, parameters=slots, wrenches=wrenches)
        asked = request(robot, on, parameters=slots, dtype=dtype, wrenches=wrenches, contacts=True)
        models = list(built.values())
        posed = None if slots else close_platforms_program(asked)
        models += [] if posed is None else [posed]
        verify(_WithoutWrenches(models, dtype), robot, on, design=values if slots else None)
        models += map_programs(asked, map_joints) if map_joints else []
        step, turning, more = control_step(asked, built["close"], built["idm"], name)
        public, inner = [*models, step], [turning]
        motion, about = given_motion(robot, given) if given else None, list[str]()
        if motion:
            step, called, text = given_step(asked, built["idm"], name, motion)
            public, inner, more = [*public, step], [*inner, *called], f"{more}\n{text}"
            about = motion.about
        for_acados = dict[str, str]()
        if acados:
            closing, of_motors = (built["close"], turning), (built["ddm"], *derived)
            text, header = acados_text(robot, name, closing, of_motors, public)
            inner, more, for_acados = [*inner, *derived], f"{more}\n{text}", {f"{name}_acados.h": header}
        contents = {
            f"{name}.h": header_text(robot, public, name, dtype, map_joints, slots, wrenches, about),
            f"{name}.c": plain_source(models, name, dtype, more, inner),
            f"test_{name}.c": test_text(robot, on, public, name, dtype, map_joints, values, wrenches, motion),
            "Makefile": _makefile(name),
            "README.md": _readme(robot, on.names, public, name, dtype, arguments=bool(slots)),
            **for_acados,
        }
    return written(Path(directory), contents)


class _WithoutWrenches(Interpreted):
    """Programs for states of a robot without wrenches on its links."""

    def batch(self, name: str, *inputs: Array) -> tuple[tuple[Array, ...], Array]:
        """Run a program as `Interpreted` does, with wrenches of zero."""
        size = dict(self.programs[name].inputs).get("wrenches")
        more = [] if size is None else [np.zeros((len(inputs[0]), size))]
        return super().batch(name, *inputs, *more)


def checked_name(robot: HybridRobot, name: str | None) -> str:
    """Return the prefix of the files and of all C identifiers.

    Raises:
        ModelError: It is not a C identifier.
    """
    name = c_name(robot.description.name) if name is None else name
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise ModelError(
            f"'{name}' is not a C identifier: use letters, digits and _, no digit first", element=name
        )
    return name


def written(folder: Path, contents: Mapping[str, str]) -> list[Path]:
    """Write files into a folder, and return their paths.

    Raises:
        ModelError: A file of the same name exists that hybridyn did not write.
    """
    paths = [folder / file for file in contents]
    for path in paths:
        if path.exists() and WRITTEN not in path.read_text(encoding="utf-8", errors="replace"):
            raise ModelError(f"'{path}' exists and was not written by hybridyn: name another folder")
    for path, text in zip(paths, contents.values(), strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text)
    return paths


def c_name(text: str) -> str:
    """Convert any name to a C identifier."""
    name = re.sub(r"\W", "_", text, flags=re.ASCII).lower() or "robot"
    return name if not name[0].isdigit() else f"robot_{name}"


def _makefile(name: str) -> str:
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
    robot: HybridRobot,
    effects: Sequence[str],
    programs: list[Program],
    name: str,
    dtype: str,
    *,
    arguments: bool,
) -> str:
    functions = "\n".join(f"    {prototype(program, name, dtype)};" for program in programs)
    numbers = ". `parameters` are numbers of the robot" if arguments else ""
    return f"""# Dynamics of '{robot.description.name}' in C

{WRITTEN}. C99, also for C++ (compile the source as C). The code allocates no memory and needs no library but
the C library's mathematics. Base: {robot.base}. Effects: {", ".join(effects) or "none"}.
`{name}.h` lists the meaning of each number of `q`, `v`, `a` and `tau`.

{functions}

Each function returns a guard. Use the results only if it is at most 1, and provide a fallback for other
samples. The guard is above 1 near singular postures and if the loops are open, and NaN if a number is not
finite. `q`, `v` and `a` are those of all joints and must close the loops: `{name}_close`
computes them from the motors'{numbers}. `{name}_idm_from_motors` does so and computes the efforts; its
guard is `{name.upper()}_OTHER_BRANCH` if no continuous motion leads there from the posture of the last tick.
The caller provides the memory `work`, one for each thread. `-ffast-math` would remove the NaN of the guard
and is refused, and so are `-funsafe-math-optimizations`, `-fassociative-math` and `-fno-signed-zeros`.

`make test` compares with {SAMPLES} states computed by hybridyn's general path. `make` passes `CFLAGS` on.
On a processor with fused multiplication and addition, `-march=native` lets the compiler use it.
"""
