"""The test that goes with exported C: states, what the general path makes of them, and calls to refuse."""

from __future__ import annotations

import numpy as np

from ..ddm import ddm
from ..effects.choice import Effects
from ..errors import HybridynError
from ..idm import idm
from ..robot import HybridRobot
from ..spatial import Array
from .bodies import body_rows
from .exporting import REAL, WRITTEN
from .printing import literal
from .program import Program

SAMPLES = 5
"""Reference states in the test."""

AGREE = {"float64": 1e-9, "float32": 1e-2}
"""What the test allows, relative to each result's largest entry: another compiler may round otherwise, and
floats lose what conditioning takes."""

DIFFERENCE = """/* Largest difference, relative to the largest entry of what was expected. */
static double difference(const {real} *result, const {real} *expected, int n) {{
    double worst = 0.0, scale = 0.0;
    int k;
    for (k = 0; k < n; k++) {{
        scale = fmax(scale, fabs((double)expected[k]));
        worst = fmax(worst, fabs((double)result[k] - (double)expected[k]));
        if (result[k] != result[k]) return HUGE_VAL;
    }}
    return scale > 0.0 ? worst / scale : worst;
}}"""

CHECK = """    trusted = 0;
    for (t = 0; t < {samples}; t++) {{
        static {name}_{model}_work work;
        {real} result[{size}];
        const double guard = (double){name}_{model}({arguments});
        const double off = difference(result, {model}_{output}[t], {size});
        printf("{model} %d: guard %.2g, difference %.2g\\n", t, guard, off);
        if (guard <= 1.0) worst = fmax(worst, off);
        trusted += guard <= 1.0;
    }}
    {{
        static {name}_{model}_work work;
        {real} result[{size}], bad[{wide}];
        for (t = 0; t < {wide}; t++) bad[t] = ({real})HUGE_VAL;
        t = 0;
        if (!trusted || {name}_{model}({refused}) <= 1) {{
            printf("{model}: no state is trusted, or what is not finite is\\n");
            worst = HUGE_VAL;
        }}
    }}"""


def test_text(robot: HybridRobot, effects: Effects, programs: list[Program], name: str, dtype: str) -> str:
    """Give the test in C.

    Args:
        robot: The robot.
        effects: What is computed.
        programs: The models.
        name: Prefix of files and names in C.
        dtype: "float64" or "float32".
    """
    lines = [
        f'/* {WRITTEN}. */\n#include <math.h>\n#include <stdio.h>\n\n#include "{name}.h"',
        DIFFERENCE.format(real=REAL[dtype]),
    ]
    checks: list[str] = []
    for program, values in zip(programs, _references(robot, effects, programs), strict=True):
        if values:
            arrays = (*program.inputs, *program.outputs)
            lines += [_array(f"{program.name}_{n}", values[n], dtype) for n, _ in arrays]
            checks.append(_check(program, name, dtype))
    limit = AGREE[dtype]
    body = ["int main(void) {", "    double worst = 0.0;", "    int t, trusted;", *checks]
    body += [
        f'    printf("largest difference from the reference: %.2g (limit {limit:g})\\n", worst);',
        f"    return worst <= {limit!r} ? 0 : 1;", "}",
    ]  # fmt: skip
    return "\n\n".join([*lines, "\n".join(body)]) + "\n"


def _references(robot: HybridRobot, effects: Effects, programs: list[Program]) -> list[dict[str, Array]]:
    """Give each program's inputs and outputs, shapes (SAMPLES, n); none where motors cannot do the motion."""
    from .states import random_states

    q, v, _, tau = random_states(robot, SAMPLES, seed=1)
    a = ddm(robot, q, v, tau, effects=effects)
    known = {"q": q, "v": v, "tau": tau, "a": a, "base_acceleration": a[:, :6]}
    out: list[dict[str, Array]] = []
    for program in programs:
        values = dict(known)
        if program.name == "kinematics":
            values["bodies"] = body_rows(robot, q, v, a)
        elif program.name == "idm":
            try:
                values["tau"] = idm(robot, q, v, a, effects=effects)
            except HybridynError:
                values = {}
        elif robot.base == "moving":
            values["a"] = ddm(robot, q, v, tau, effects=effects, base_acceleration=a[:, :6])
        out.append(values)
    return out


def _array(name: str, values: Array, dtype: str) -> str:
    """Give samples as an array in C."""
    rounded: Array = values.astype(dtype).astype(np.float64)
    rows = ",\n    ".join("{" + ", ".join(map(literal, row)) + "}" for row in rounded.tolist())
    shape = f"[{values.shape[0]}][{max(values.shape[1], 1)}]"
    return f"static const {REAL[dtype]} {name}{shape} = {{\n    {rows}}};"


def _check(program: Program, name: str, dtype: str) -> str:
    """Give the lines that run a program on every state and compare, and see it refuse what is not finite."""
    ((output, size),) = program.outputs
    rest = [f"{program.name}_{n}[t]" for n, _ in program.inputs[1:]]
    first, wide = program.inputs[0]
    return CHECK.format(
        samples=SAMPLES,
        name=name,
        model=program.name,
        real=REAL[dtype],
        size=size,
        output=output,
        wide=wide,
        arguments=", ".join([f"{program.name}_{first}[t]", *rest, "result", "&work"]),
        refused=", ".join(["bad", *rest, "result", "&work"]),
    )
