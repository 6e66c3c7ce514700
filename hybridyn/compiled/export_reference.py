"""Generate the test of exported C: reference values of the general path, and inputs that must be refused."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np

from ..assembly.assemble import assemble
from ..dynamics.direct import ddm
from ..dynamics.inverse import idm
from ..effects.choice import Effects
from ..errors import HybridynError
from ..spatial import Array
from ..structure.robot import HybridRobot, joint_position
from .code.c_tables import literal
from .code.plain_c import WRITTEN
from .code.scalars import REAL
from .program import Program
from .programs.closing.platform_program import platform_motions
from .programs.general import body_rows
from .programs.given_control import GIVEN_STEP, GivenMotion
from .programs.map_programs import map_values

#: Number of reference states in the test.
SAMPLES = 5

#: Largest difference that the test allows, relative to each result's largest entry: other compilers round
#: differently, and single precision loses digits to conditioning.
EXPORT_AGREES = {"float64": 1e-9, "float32": 1e-2}

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
        {results}
        const double guard = (double){name}_{model}({arguments});
        const double off = {differences};
        printf("{model} %d: guard %.2g, difference %.2g\\n", t, guard, off);
        if (guard <= 1.0) worst = fmax(worst, off);
        trusted += guard <= 1.0;
    }}
    {{
        static {name}_{model}_work work;
        {results}
        {real} bad[{wide}];
        for (t = 0; t < {wide}; t++) bad[t] = ({real})HUGE_VAL;
        t = 0;
        if (!trusted || {name}_{model}({refused}) <= 1) {{
            printf("{model}: no state is trusted, or what is not finite is\\n");
            worst = HUGE_VAL;
        }}
    }}"""


def test_text(
    robot: HybridRobot,
    effects: Effects,
    programs: list[Program],
    name: str,
    dtype: str,
    map_joints: Sequence[str],
    parameters: Array,
    wrenches: Sequence[str],
    given: GivenMotion | None,
) -> str:
    """Generate the test in C.

    Args:
        effects: Effects in the models.
        name: Prefix of the files and of all C identifiers.
        dtype: "float64" or "float32".
        map_joints: Output joints of the programs of the map.
        parameters: Values of the input "parameters", shape (slots,).
        wrenches: Links on which wrenches are arguments.
        given: What is given to the control step from poses, or None.
    """
    lines = [
        f'/* {WRITTEN}. */\n#include <math.h>\n#include <stdio.h>\n\n#include "{name}.h"',
        DIFFERENCE.format(real=REAL[dtype]),
    ]
    checks: list[str] = []
    references = _references(robot, effects, programs, map_joints, parameters, wrenches, given)
    for program, values in zip(programs, references, strict=True):
        if values:
            arrays = (*program.inputs, *program.outputs)
            lines += [_array(f"{program.name}_{n}", values[n], dtype) for n, _ in arrays]
            checks.append(_check(program, name, dtype))
    limit = EXPORT_AGREES[dtype]
    body = ["int main(void) {", "    double worst = 0.0;", "    int t, trusted;", *checks]
    body += [
        f'    printf("largest difference from the reference: %.2g (limit {limit:g})\\n", worst);',
        f"    return worst <= {limit!r} ? 0 : 1;", "}",
    ]  # fmt: skip
    return "\n\n".join([*lines, "\n".join(body)]) + "\n"


def _references(
    robot: HybridRobot,
    effects: Effects,
    programs: list[Program],
    map_joints: Sequence[str],
    parameters: Array,
    wrenches: Sequence[str],
    given: GivenMotion | None,
) -> list[dict[str, Array]]:
    """Compute each program's inputs and outputs, shapes (SAMPLES, n), among other numbers.

    The entries of the inverse models are empty if the motors cannot produce the motion.
    """
    from .equations.states import random_states

    q, v, _, tau = random_states(robot, SAMPLES, seed=1)
    pushed = np.random.default_rng(1).normal(size=(SAMPLES, len(wrenches), 6)) * _weight(robot)
    on_links = {link: pushed[:, i] for i, link in enumerate(wrenches)}
    acting: dict[str, Any] = {"wrenches": on_links or None, "effects": effects}
    a = ddm(robot, q, v, tau, **acting)
    read = next(rates_read(program) for program in programs if program.name == "close")
    v_closed, a_closed = _following(robot, q, v, a)
    driven = {"v": v * read, "a": a * read, "near": q, "last": q, "v_closed": v_closed, "a_closed": a_closed}
    positions = [joint_position(robot, q, motor) for motor in robot.motors]
    driven["position"] = np.array(positions).reshape(-1, SAMPLES).T
    known = {"q": q, "tau": tau, "base_acceleration": a[:, :6]}
    known["wrenches"] = pushed.reshape(SAMPLES, -1)
    known["parameters"] = np.tile(parameters, (SAMPLES, 1))
    efforts = {
        "idm": _efforts(robot, acting, q, v, a),
        "idm_from_motors": _efforts(robot, acting, q, v_closed, a_closed),
    }
    if given:
        steps = given.states(q)
        motion = steps["q"], steps["v_closed"], steps["a_closed"]
        efforts[GIVEN_STEP] = steps | _efforts(robot, acting, *motion)
    out: list[dict[str, Array]] = []
    for program in programs:
        values = known | (driven if "v_closed" in dict(program.outputs) else {"v": v, "a": a, "near": q})
        if program.name in efforts:
            values = efforts[program.name] and values | efforts[program.name]
        elif program.name == "kinematics":
            values["bodies"] = body_rows(robot, q, v, a)
        elif program.name == "close_platforms":
            values |= platform_motions(robot, q, v, a)
        elif program.name.startswith("map_to_"):
            values |= map_values(robot, q, map_joints, v)
        elif robot.base == "moving" and program.name == "ddm":
            values["a"] = ddm(robot, q, v, tau, **acting, base_acceleration=a[:, :6])
        out.append(values)
    return out


def _weight(robot: HybridRobot) -> Array:
    """Return a tenth of the robot's weight [N], and its moment at the robot's size [N m], shape (6,)."""
    weight = 0.1 * 9.81 * sum(link.mass for link in robot.description.links)
    return np.array([weight] * 3 + [weight * robot.bodies.size] * 3)


def _efforts(robot: HybridRobot, acting: dict[str, Any], *motion: Array) -> dict[str, Array]:
    """Compute the output "tau" of an inverse model; nothing if the motors cannot produce the motion.

    Args:
        acting: Effects and wrenches.
    """
    try:
        return {"tau": idm(robot, *motion, **acting)}
    except HybridynError:
        return {}


def _following(robot: HybridRobot, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """Return rates and accelerations of states as they follow from the motors', with the least idle motions.

    They are those of the states where the motors do not determine the motion: then nothing is left open.
    """
    out = v.copy(), a.copy()
    free = np.arange(robot.nv) >= (0 if robot.base == "fixed" else 6)
    columns = [robot.v_slices[robot.joint_index[name]].start for name in robot.motors]
    for t in range(len(q)):
        at = np.array([float(joint_position(robot, q[t], name)) for name in robot.motors])
        try:
            _, *found = assemble(robot, motors=(at, v[t, columns], a[t, columns]), guess=q[t])
        except HybridynError:
            continue
        for whole, own in zip(out, found, strict=True):
            whole[t, free] = own[free]
    return out


def rates_read(program: Program) -> Array:
    """Return 1 for each freedom whose rate the program "close" reads and 0 for the others, shape (nv,)."""
    from .programs.whole_robot import function_of

    pattern = function_of(program).jac_sparsity(1, 1)  # v_closed over v
    return np.isin(np.arange(pattern.size2()), pattern.get_col()).astype(float)


def _array(name: str, values: Array, dtype: str) -> str:
    """Return samples as a C array."""
    rounded: Array = values.astype(dtype).astype(np.float64)
    rows = ",\n    ".join("{" + ", ".join(map(literal, row)) + "}" for row in rounded.tolist())
    shape = f"[{values.shape[0]}][{max(values.shape[1], 1)}]"
    return f"static const {REAL[dtype]} {name}{shape} = {{\n    {rows}}};"


def _check(program: Program, name: str, dtype: str) -> str:
    """Return the C lines that compare a program on every state and check that it refuses non-finite input."""
    results = [f"result_{n}[{size}]" for n, size in program.outputs]
    names = [f"result_{n}" for n, _ in program.outputs]
    off = [f"difference(result_{n}, {program.name}_{n}[t], {size})" for n, size in program.outputs]
    rest = [f"{program.name}_{n}[t]" for n, _ in program.inputs[1:]]
    first, wide = program.inputs[0]
    return CHECK.format(
        samples=SAMPLES,
        name=name,
        model=program.name,
        real=REAL[dtype],
        results=f"{REAL[dtype]} {', '.join(results)};",
        differences=reduce(lambda worst, one: f"fmax({worst}, {one})", off),
        wide=wide,
        arguments=", ".join([f"{program.name}_{first}[t]", *rest, *names, "&work"]),
        refused=", ".join(["bad", *rest, *names, "&work"]),
    )
