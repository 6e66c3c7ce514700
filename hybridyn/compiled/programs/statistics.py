"""Count the operations of a robot's models before and after each reduction."""

from __future__ import annotations

from ...effects.choice import Choice, choose
from ...errors import CompileError
from ...structure.robot import HybridRobot
from ..code.alone import describe_single, lanes_of_codes
from ..code.kernels import kernel_graph, kernel_text
from ..code.operations import operations_table
from ..code.plain_c import in_lanes
from ..code.quotients import costing, operations_of
from ..code.rules import trimmed
from ..code.scalars import Scalar
from ..library.cache import known
from ..library.compilers import best_lanes
from ..needs import needs_casadi
from ..program import Program
from .sources import library_key

MODELS = ("idm", "ddm")


def statistics(robot: HybridRobot, effects: Choice = None) -> str:
    """Return a printable table of the operations of both models, by part and by variant.

    The first variant has inertial parameters as inputs and body axes that are aligned with no joint. Each
    further variant adds one reduction: axes aligned with the joints, so that zeros and ones vanish; constant
    inertial parameters; base inertial parameters.

    Args:
        robot: The robot.
        effects: Effects to include, as for `hybridyn.idm`.

    Raises:
        ModelError: An effect is not available in compiled models.
        CompileError: casadi is not installed.
    """
    needs_casadi()
    from .whole_robot import programs

    variants: dict[str, dict[str, Program]] = {
        name: programs(
            robot, effects, models=MODELS, regroup=regroup, align=align, parameters=parameters, counted=True
        )
        for name, regroup, align, parameters in (
            ("axes and inertial parameters of any kind", False, False, True),
            ("axes of the joints", False, True, True),
            ("inertial parameters folded in", False, True, False),
            ("base inertial parameters", True, True, False),
        )
    }
    titles = {"idm": "Inverse model, operations per sample", "ddm": "Direct model, operations per sample"}
    tables, times = [], _measured(robot, effects)
    for model, title in titles.items():
        table = operations_table({name: models[model] for name, models in variants.items()})
        program = trimmed(variants["base inertial parameters"][model])
        with_guard, alone = flattened(program)
        statements = [kernel_text(kernel_graph(kernel)).count("\n") for kernel in program.kernels]
        codes = lanes_of_codes(program, statements, best_lanes())
        single = describe_single(codes, times.get(model))
        shared = f"as one expression, shared across legs and stages: {with_guard}; without the guard: {alone}"
        tables.append(f"{title}\n\n{table}\n{shared}\n{single}")
    own = [variants["base inertial parameters"][model] for model in titles]
    exported = "4 lanes for equal legs with AVX, else plain numbers" if in_lanes(own) else "plain numbers"
    return "\n\n".join([*tables, f"exported C: {exported}"])


def _measured(robot: HybridRobot, effects: Choice) -> dict[str, list[float]]:
    """Return the measured times of the codes of single calls by model; empty if there is no build."""
    scalar = Scalar("float64", best_lanes())
    try:
        built = known(library_key(robot, choose(robot, effects), scalar))
    except CompileError:  # there is no compiler
        return {}
    models = built.about["programs"].items() if built else ()
    return {name: about["times"] for name, about in models if "times" in about}


def flattened(program: Program) -> tuple[int, int]:
    """Count the operations of a program written as one expression, with common terms computed once.

    Args:
        program: The program.

    Returns:
        The number of operations with the guard and without it.
    """
    import casadi as ca

    from .interpreter import run

    symbols = [ca.SX.sym(name, size) for name, size in program.inputs]
    result, guard = run(program, [x for column in symbols for x in ca.vertsplit(column)])
    outputs = [ca.vertcat(*result), guard]
    both = (ca.Function("flat", symbols, ca.cse(wanted)) for wanted in (outputs, outputs[:-1]))
    with_guard, alone = (len(costing(operations_of(f))) for f in both)
    return with_guard, alone
