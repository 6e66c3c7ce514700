"""The exported control step from poses and joints, by the programs and the walk of tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..code.plain_c import prototype, work_size
from ..code.scalars import c_text
from ..equations.request import Request
from ..equations.scales import GUARD_CLOSED
from ..program import Program, stored
from .closing.chain_program import ChainWriter
from .closing.closing_source import closing_programs, constants_of, far_source
from .closing.module_parts import CLOSED_TO_ROUNDING, kinds_of
from .closing.rows import place_program
from .given_control import GIVEN_STEP, GivenMotion
from .writer import ModuleWriter

#: Records of `row_records.h` that programs read and write, and where their inputs and outputs are in these.
RECORDS = {
    "newton": ("const NewtonIn *x, NewtonOut *y", "at.q at.p g", "at.q at.p step wrist open kept"),
    "settle": (
        "const SettleIn *x, SettleOut *y",
        "at.q at.p start.q start.p g_0 row.g row.g_dot row.g_ddot kept",
        "now.at.q now.at.p now.v now.a step open turning",
    ),
    "branch": (
        "const BranchIn *x, BranchOut *y",
        "start.q start.p g_0 predicted.q predicted.p found.q found.p g",
        "off turned",
    ),
    "place": ("const Posture *x, Posture *y, S *own", "q", "p"),
    "measure": ("const Posture *x, const S *joints, const S *wanted, S *now, S *next", "q p", ""),
}
#: Before `advance.h`: a program; gives whether its guard is within the limit.
CALL = "#define RUN(program, in, out) (program##_run(&(in), &(out), w->programs) <= 1)"
#: C99 has no arrays without numbers: they have one.
SOME = "#define SOME(n) ((n) + !(n))"


def given_step(
    request: Request, inverse: Program, name: str, motion: GivenMotion
) -> tuple[Program, list[Program], str]:
    """Write the control step from what is given.

    Inputs are "last", a posture that closes the loops, what is "given", its "rates" and "accelerations", and
    "wrenches" if the model has them. Outputs are those of "close" and of "idm".

    Returns:
        Its arguments and workspace, the programs that it calls, and its C.
    """
    robot, parts = request.robot, motion.parts
    programs = closing_programs(robot, parts, None, motion.chains)
    every = [*programs.values(), place_program(robot, parts), measure_program(motion)]
    names = constants_of(programs, 0) | {
        "PROGRAMS_WORK": max(work_size(program, lanes=True) for program in (*every, inverse)),
        "OWN": sum(part.given.size for part in parts),
        "ROUNDING": CLOSED_TO_ROUNDING,
        "CLOSED": GUARD_CLOSED[request.dtype],
        "WRENCHES": sum(size for _, size in request.wrench_inputs),
    }
    given, rates = dict(every[-1].inputs)["wanted"], int(names["NR"])
    inputs = ("last", robot.nq), ("given", given), ("rates", rates), ("accelerations", rates)
    outputs = ("q", robot.nq), ("v_closed", robot.nv), ("a_closed", robot.nv), *inverse.outputs
    step = Program(GIVEN_STEP, (*inputs, *request.wrench_inputs), outputs, (), (), _numbers_of_work(names), 0)
    text = [
        *("#include <string.h>", "#undef NUMBERS", "#undef RUN"),
        *(f"#undef {x}\n#define {x} {n!r}" for x, n in names.items()),
        *(SOME, CALL, "typedef long long Long;"),
        *(far_source(parts, motion.chains), c_text("row_records.h")),
        *(_called(program, name) for program in every),
        *(c_text("advance.h"), c_text("given_step.h"), _function(step, name, request.dtype)),
    ]
    return step, [_without_empty(program) for program in every], "\n".join(text)


def measure_program(motion: GivenMotion) -> Program:
    """Write the program "measure": from a posture, and what is wanted next, to what is prescribed in both.

    Inputs are "q_0", "p_0", the positions of the "joints" that are given there, and the next numbers
    "wanted", without headings. Outputs are "now" and "next". The guard is at most 1 if quaternions and
    directions have a length of one.
    """
    robot, parts, chains = motion.robot, motion.parts, motion.chains
    sizes, kinds = [part.given.size for part in parts], kinds_of(robot, parts, [one.given for one in chains])
    ends = np.cumsum([0, *sizes, *(one.given.size - len(one.given.turning) for one in chains)]).tolist()
    each, own = [np.arange(*pair) for pair in pairwise(ends)], np.arange(sum(sizes))
    kinds |= {"wanted": (ends[-1], each), "joints": (len(own), each[: len(parts)])}
    inputs = {"q_0": "q", "p_0": "p", "joints": "joints", "wanted": "wanted"}
    w, fixed = ModuleWriter("measure", inputs, {"now": "g", "next": "g"}, kinds), robot.bodies.place
    if len(own):
        w.keep(now=("joints", own), next=("wanted", own))
    for k, one in enumerate(chains):
        ChainWriter(robot, parts, one, k, (fixed, fixed)).measure(w)
    return w.program()


def _without_empty(program: Program) -> Program:
    """Return a program without inputs and outputs that have no numbers, which C99 does not know."""
    inputs, outputs = (tuple(x for x in ends if x[1]) for ends in (program.inputs, program.outputs))
    return replace(program, inputs=inputs, outputs=outputs)


def _numbers_of_work(names: Mapping[str, float]) -> int:
    """Return how many numbers `Work` of `row_records.h` has."""
    n = {name: int(value) for name, value in names.items()}
    kept, slots, m, g = max(n["KEPT"], 1), max(n["SLOTS"], 1), n["MODULES"], n["NG"]
    posture = n["NQ"] + max(n["NP"], 1)
    state, row = posture + 2 * n["NV"], g + 2 * n["NR"]
    newton = 2 * posture + g + slots + 3 * m + kept
    settle = 2 * posture + g + row + kept + slots + state + 3 * m
    branch = 3 * posture + 2 * g + slots + 2 * m
    return newton + settle + branch + 2 * state + 5 * m + 2 + n["PROGRAMS_WORK"] + 2 * posture + g + row


def _called(program: Program, name: str) -> str:
    """Return the C function by which the walk calls an exported one; it leaves out what has no numbers."""
    head, reads, writes = RECORDS[program.name]
    words = [word.split("*")[1] for word in head.split(", ")]
    more = [word for word in words if word not in ("x", "y")]
    now = [f"x->{x}" for x in reads.split()], [f"y->{x}" for x in writes.split()]
    inputs = [*now[0], *(x for x in more if x in dict(program.inputs))]
    outputs = [*now[1], *more[len(inputs) - len(now[0]) :]]
    ends = *zip(inputs, program.inputs, strict=True), *zip(outputs, program.outputs, strict=True)
    given = [place for place, (_, size) in ends if size]
    used = {place.split("->")[0] for place in given}
    unread = "".join(f"    (void){word};\n" for word in words if word not in used)
    call = f"{name}_{program.name}({', '.join([*given, f'({name}_{program.name}_work *)room'])})"
    return f"static S {program.name}_run({head}, S *room) {{\n{unread}    return {call};\n}}"


def _function(step: Program, name: str, dtype: str) -> str:
    """Return the exported function."""
    start, works = step.sizes[0], f"sizeof({name}_{step.name}_work)"
    wrenches = "wrenches" if any(n == "wrenches" for n, _ in step.inputs) else "given"
    each = (f"    for (k = 0; k < {n}; k++) {x}[k] = result[{at} + k];" for x, n, at in stored(step.outputs))
    return "\n".join([
        f"typedef char enough_room[sizeof(Work) <= {works} - {start + step.sizes[1]} * sizeof(S) ? 1 : -1];",
        f"{prototype(step, name, dtype)} {{",
        f"    S *const result = work->numbers + {start};",
        f"    Work *const w = (Work *)(result + {step.sizes[1]});",
        f"    const S guard = given_step(last, given, rates, accelerations, {wrenches}, result, w);",
        "    int k;",
        *each,
        "    return guard;\n}",
    ])  # fmt: skip
