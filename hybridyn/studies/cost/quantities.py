"""What is measured along a motion: a quantity, the ways to compute it, and its reference in 113 bits."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...assembly.assemble import assemble
from ...compiled.compiling import compile
from ...compiled.derivatives import Derivatives
from ...compiled.library.calls import load
from ...compiled.model import CompiledRobot
from ...compiled.program import Call, Program
from ...dynamics.direct import ddm
from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...scenes.references import MotorAxes
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..compare.methods import Method, Setting, State, grid
from .points import Use
from .settings import model_fragment

#: Quantities, and what has the errors.
QUANTITIES = {
    "idm": "motor efforts",
    "ddm": "accelerations",
    "close": "the motion of all joints from the motors'",
    "designs": "motor efforts of designs with another mass",
    "idm_jacobian": "derivatives of motor efforts over the motors' motion",
    "ddm_jacobian": "derivatives of the motors' accelerations over their motion and efforts",
}
GENERAL, IN_C, SINGLE, DIFFERENCES = "general path", "compiled", "compiled, float32", "central differences"
#: The setting that leaves no effect out.
EVERY = "every effect"
#: Steps of differences of the motors' positions, rates, and accelerations or efforts.
STEPS = tuple(10.0**-k for k in range(1, 8))
#: Step of the differences that are extrapolated.
EXTRAPOLATED = 1e-4

#: Mass of the heaviest link in a design, relative to its own.
HEAVIER = 1.1

#: Speed of the second motion, relative to the first, on the same path.
SLOWER = 0.7


class Way(NamedTuple):
    """A way of our own to compute a quantity.

    Attributes:
        method: The method.
        use, what, fragment: As in `Point`.
        setting: What distinguishes it from others of its name.
        threads: Number of threads that share a batch.
    """

    method: Method
    use: Use
    what: str = ""
    fragment: str = ""
    setting: str = EVERY
    threads: int = 1


def off(found: Array, exact: Array, rows: Any = slice(None)) -> float:
    """Compare a block: efforts each with the peak of its motor, other numbers with the largest of all."""
    peak = np.abs(exact).max(axis=0) if exact.ndim == 2 else np.abs(exact).max()
    error = float((np.abs(found - exact[rows]) / np.where(peak > 0, peak, 1.0)).max(initial=0.0))
    return error if np.isfinite(error) else np.inf


def blocks(found: Any) -> list[Array]:
    """Return a result as a list of arrays."""
    parts = [*found.values()] if isinstance(found, dict) else found
    return [np.asarray(x, dtype=float) for x in (parts if isinstance(parts, tuple | list) else [parts])]


def ways(quantity: str, effects: Effects) -> list[Way]:
    """Return the ways to compute a quantity, the usual one first."""
    call = "# hybridyn.compile(robot, effects{}).{}"
    if quantity.endswith("jacobian"):
        derive = Method(IN_C, quantity, partial(_derivatives, quantity, effects), batches=True)
        setup = partial(differences, quantity, effects)
        swept = Method(DIFFERENCES, quantity, setup, grid(step=STEPS))
        return [
            Way(derive, "usual", "keep the derivatives in C", f'# hybridyn.{quantity}(coordinates="motors")'),
            Way(swept, "program", "take central differences", setting=""),
        ]
    slow = Method(GENERAL, quantity, lambda robot: lambda _: solver(quantity, robot, effects), batches=True)
    fast, single = (
        Method(line, quantity, partial(in_c, quantity, effects, dtype), batches=True, threads=True)
        for line, dtype in ((IN_C, "float64"), (SINGLE, "float32"))
    )
    if quantity == "close":
        return [
            Way(slow, "usual", "keep the general path", "# hybridyn.assemble", "(usual)"),
            Way(fast, "command", "close the loops in C", call.format("", "assemble"), "a batch"),
        ]
    if quantity == "designs":
        slow = replace(slow, batches=False)
        return [
            Way(
                slow, "usual", "build the robot of each design", "# robot.with_parameters", "a robot a design"
            ),
            Way(fast, "command", "compute designs in C", call.format(", parameters=[...]", "idm"), "a batch"),
            Way(single, "program", "compute designs in C (float32)", setting="a batch"),
        ]
    told, keep = partial(model_fragment, effects.names, command=quantity), "keep every effect and "
    number, shared = (call.format(x, quantity) for x in (', dtype="float32"', ", threads=2"))
    return [
        Way(slow, "usual", f"{keep}the general path", told("general"), "every effect (usual)"),
        Way(fast, "command", f"{keep}compute in C", told("compiled")),
        Way(single, "program", "compute in C (float32)", number),
        Way(fast, "program", "let two threads share a batch", shared, f"{EVERY}, 2 threads", 2),
    ]


def solver(quantity: str, robot: HybridRobot, effects: Effects, model: CompiledRobot | None = None) -> Any:
    """Return the call that computes a quantity for many samples, by the general path without a model."""
    if quantity == "close":
        return partial(_closed, model.assemble if model else partial(assemble, robot), robot)
    if quantity == "designs":
        design = design_of(robot)
        if model:
            return partial(model.idm, parameters=[*design.values()])
        return lambda *state: idm(robot.with_parameters(design), *state, effects=effects)
    if model:
        return getattr(model, quantity)
    return partial(idm if quantity == "idm" else ddm, robot, effects=effects)


def in_c(quantity: str, effects: Effects, dtype: Any, robot: HybridRobot, threads: int = 1) -> Any:
    """Prepare a compiled model."""
    free = tuple(design_of(robot)) if quantity == "designs" else ()
    model = compile(robot, effects, dtype=dtype, threads=threads, parameters=free)
    solve = solver(quantity, robot, effects, model)
    return lambda setting: solve


def design_of(robot: HybridRobot) -> dict[str, float]:
    """Return the design that is measured: another mass of the heaviest link."""
    heaviest = max(robot.description.links, key=lambda link: link.mass)
    return {f"mass:{heaviest.name}": HEAVIER * heaviest.mass}


def motors_of(robot: HybridRobot, q: Array, v: Array, a: Array) -> State:
    """Return positions, rates and accelerations of the motors, shapes (T, motors)."""
    axes = MotorAxes.of(robot)
    return axes.positions(q), v[..., axes.columns], a[..., axes.columns]


def _closed(close: Any, robot: HybridRobot, q: Array, v: Array, a: Array) -> State:
    """Close the loops of some rows from the motors' motion and the first posture."""
    found: State = close(motors=motors_of(robot, q, v, a), guess=q[0])
    return found


def _derivatives(quantity: str, effects: Effects, robot: HybridRobot) -> Any:
    """Prepare the derivatives of a model over the motors."""
    derive = Derivatives(robot, quantity.removesuffix("_jacobian"), effects, coordinates="motors")
    return lambda setting: derive


def differences(quantity: str, effects: Effects, robot: HybridRobot) -> Any:
    """Prepare central differences of the compiled model over the motors."""
    model, n = compile(robot, effects), len(robot.motors)
    inverse = quantity == "idm_jacobian"

    def at_setting(setting: Setting) -> Any:
        shift = setting["step"] * np.vstack([np.eye(3 * n), -np.eye(3 * n)]).reshape(-1, 3, n)

        def solve(q: Array, v: Array, given: Array) -> list[Array]:
            """Close the loops around a sample, and compute there."""
            x, rate, change = motors_of(robot, q, v, given if inverse else v)
            x, rate, last = np.moveaxis(np.array([x, rate, change if inverse else given]) + shift, 1, 0)
            near = model.close(x, rate, last if inverse else None, last=q)
            found = model.idm(*near) if inverse else model.ddm(*near[:2], last)[:, robot.motor_v]
            ahead, behind = found.reshape(2, 3, n, n)
            return [*((ahead - behind) / (2 * setting["step"])).swapaxes(-1, -2)]

        return solve

    return at_setting


def exact(quantity: str, robot: HybridRobot, effects: Effects, state: State) -> list[Array]:
    """Compute a quantity in 113-bit arithmetic, rounded at the end, as blocks of shape (T, n).

    Raises:
        HybridynError: The C code cannot be built, or it is not certain of every sample.
        ImportError: CasADi is not installed.
    """
    if quantity == "designs":
        quantity, robot = "idm", robot.with_parameters(design_of(robot))
    program = program_of(robot, effects, quantity)
    base = [np.zeros((len(state[0]), size)) for _, size in program.inputs[3:]]  # that of a moving base
    found, guard = load([program], dtype="float128").batch(program.name, *state, *base)
    if not np.all(guard <= 1.0):
        raise HybridynError("the compiled model is not certain of every sample")
    return [np.asarray(x, dtype=float) for x in found]


def extrapolated(
    quantity: str, robot: HybridRobot, effects: Effects, state: State
) -> tuple[list[Array], float]:
    """Compute derivatives by central differences, extrapolated to a step of zero.

    Code of derivatives in 113 bits takes minutes to build.

    Returns:
        Blocks of shape (T, motors, motors), and their own error, relative to the largest number of each.
    """
    at = differences(quantity, effects, robot)
    samples = [*zip(*state, strict=True)]
    coarse, middle, fine = (
        np.array([at({"step": factor * EXTRAPOLATED})(*sample) for sample in samples]) for factor in (4, 2, 1)
    )
    less, best = ((4.0 * x - y) / 3.0 for x, y in ((middle, coarse), (fine, middle)))
    found = [*np.moveaxis(best, 1, 0)]
    own = max(map(off, np.moveaxis(less, 1, 0), found))
    return found, own


def program_of(robot: HybridRobot, effects: Effects, model: str) -> Program:
    """Write a model as a program; this needs CasADi."""
    from ...compiled.programs.whole_robot import programs

    return programs(robot, effects, models=(model,))[model]


def operations(robot: HybridRobot, effects: Effects, model: str) -> float:
    """Count the operations of a model without building code; nan where no program can be written."""
    try:
        program = program_of(robot, effects, model)
    except (HybridynError, ImportError):
        return float("nan")
    calls = (step for step in program.steps if isinstance(step, Call))
    return float(sum(program.kernels[c.kernel].function.n_instructions() * c.copies for c in calls))
