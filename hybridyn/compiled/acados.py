"""The direct model over the motors as C functions with the names and arguments that acados expects."""

from __future__ import annotations

from collections.abc import Sequence

from ..effects.choice import Effects
from ..errors import ModelError
from ..structure.robot import HybridRobot
from .code.plain_c import WRITTEN, in_lanes, work_size
from .code.scalars import c_text
from .equations.request import request
from .program import Program, stored
from .programs.derivatives.coordinates import check_coordinates
from .programs.derivatives.models import direct_derivatives
from .programs.walking import run_text
from .second.programs import second_program
from .second.smooth import check_smooth

#: Arguments and results of each function, in acados' order: those of an explicit ODE.
SIGNATURES = {
    "expl_ode_fun": ("x u p", "f"),
    "expl_vde_forw": ("x Sx Su u p", "f Sx Su"),
    "expl_vde_adj": ("x f u p", "adj"),
    "expl_ode_hess": ("x Sx Su f u p", "adj hess"),
}
#: What CasADi asks of a function: names after its own, what they return, their arguments and text.
ASKED = """const casadi_int *{f}_sparsity_in(casadi_int i) {{
    static const casadi_int dense[][3] = {{{inputs}}};
    return i < {n_in} ? dense[i] : 0;
}}
const casadi_int *{f}_sparsity_out(casadi_int i) {{
    static const casadi_int dense[][3] = {{{outputs}}};
    return i < {n_out} ? dense[i] : 0;
}}
casadi_int {f}_n_in(void) {{ return {n_in}; }}
casadi_int {f}_n_out(void) {{ return {n_out}; }}
int {f}_work(casadi_int *sz_arg, casadi_int *sz_res, casadi_int *sz_iw, casadi_int *sz_w) {{
    if (sz_arg) *sz_arg = {n_in};
    if (sz_res) *sz_res = {n_out};
    if (sz_iw) *sz_iw = 0;
    if (sz_w) *sz_w = (casadi_int)(sizeof(Acados) / sizeof(S));
    return 0;
}}"""
HEADER = """/* {written}. The functions of '{robot}' for acados: an explicit ODE of the motors.

   x: positions of the motors, then their rates
{motors}
   u: their efforts, in this order
   p: a posture that closes the loops (`q` of {name}.h), from which the motors move straight to x

   Of each function f there are f_n_in, f_n_out, f_sparsity_in, f_sparsity_out and f_work. Functions return 1,
   and NaN as results, where no posture follows. Build with -Dcasadi_int='long long int' for CasADi itself. */
#ifndef {guard}
#define {guard}
#ifndef casadi_int
#define casadi_int int
#endif
#ifdef __cplusplus
extern "C" {{
#endif
{functions}
#ifdef __cplusplus
}}
#endif
#endif
"""
CALL = "int {f}(const double **arg, double **res, casadi_int *iw, double *w, int mem);"
ASKING = (
    "const casadi_int *{f}_sparsity_in(casadi_int i);", "const casadi_int *{f}_sparsity_out(casadi_int i);",
    "casadi_int {f}_n_in(void);", "casadi_int {f}_n_out(void);",
    "int {f}_work(casadi_int *sz_arg, casadi_int *sz_res, casadi_int *sz_iw, casadi_int *sz_w);",
)  # fmt: skip


def motor_programs(robot: HybridRobot, effects: Effects) -> list[Program]:
    """Return the programs of the first and second derivatives of "ddm" over motors.

    Raises:
        ModelError: There are no motors, they are not coordinates of the robot, or an effect has no second
            derivative.
        SingularityError: The motors of a module do not determine its motion at any posture.
    """
    if not robot.motors:
        raise ModelError("functions for acados need motors; the robot has none")
    check_smooth(robot, effects)
    check_coordinates(robot, "ddm", "motors")
    first = direct_derivatives(request(robot, effects), motors=True)
    return [first, second_program(robot, effects, "ddm", "product", coordinates="motors")]


def acados_text(
    robot: HybridRobot,
    name: str,
    closing: Sequence[Program],
    models: Sequence[Program],
    public: Sequence[Program],
) -> tuple[str, str]:
    """Return the C of the functions after that of the control step, and their header.

    Args:
        name: Prefix of all identifiers.
        closing: The programs of the walk.
        models: The model and its derivatives, as of `motor_programs`.
        public: All programs whose functions are offered.
    """
    m, lanes = len(robot.motors), in_lanes(list(public))
    names = {
        "NX": 2 * m, "NU": m,
        "TAKEN": max(program.sizes[0] for program in models),
        "FOUND": max(program.sizes[1] for program in models),
        "ROOM_OF_ACADOS": max(work_size(program, lanes=lanes) for program in (*closing, *models)),
    }  # fmt: skip
    words = {"delta": "Q", "v_near": "V", "tau": "TAU"}
    for what, _, at in stored(models[-1].outputs):
        of, _, order = what.rpartition("_")
        if order in ("slope", "product"):
            names[f"{words[of]}_{order.upper()}"] = at
    declared = [line.format(f=f"{name}_{word}") for word in SIGNATURES for line in (CALL, *ASKING)]
    lines = [run_text(program, name) for program in models]
    lines += [f'#include "{name}_acados.h"', f"#define NAMED(word) {name}_##word"]
    lines += [f"#define {word} {size}" for word, size in names.items()]
    motors = "\n".join(f"     {i}  {motor}" for i, motor in enumerate(robot.motors))
    header = HEADER.format(
        written=WRITTEN, robot=robot.description.name, name=name, motors=motors,
        guard=f"{name.upper()}_ACADOS_H", functions="\n".join(declared),
    )  # fmt: skip
    return "\n".join([*lines, c_text("acados.h"), *_asked(robot, name)]), header


def _asked(robot: HybridRobot, name: str) -> list[str]:
    """Return the C of what CasADi asks of each function."""
    m, out = len(robot.motors), []
    shapes = {
        "x": (2 * m, 1), "u": (m, 1), "p": (robot.nq, 1), "f": (2 * m, 1), "Sx": (2 * m, 2 * m),
        "Su": (2 * m, m), "adj": (3 * m, 1), "hess": (3 * m * (3 * m + 1) // 2, 1),
    }  # fmt: skip
    for word, sides in SIGNATURES.items():
        ends = [side.split() for side in sides]
        dense = [", ".join("{{{}, {}, 1}}".format(*shapes[x]) for x in end) for end in ends]
        n_in, n_out = map(len, ends)
        f = f"{name}_{word}"
        out.append(ASKED.format(f=f, inputs=dense[0], outputs=dense[1], n_in=n_in, n_out=n_out))
    return out
