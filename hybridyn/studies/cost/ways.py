"""The ways in which a quantity is computed: the general path, C, differences."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...assembly.assemble import assemble
from ...compiled import CompiledRobot, Derivatives, compile, operations
from ...dynamics.direct import ddm
from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...scenes.references import MotorAxes
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..compare.methods import Method, Setting, State, grid
from .points import Use, timed

GENERAL, IN_C, SINGLE, DIFFERENCES = "general path", "compiled", "compiled, float32", "central differences"
#: The setting that leaves no effect out.
EVERY = "every effect"
#: Steps of differences of the motors' positions, rates, and accelerations or efforts.
STEPS = tuple(10.0**-k for k in range(1, 8))

#: Mass of the heaviest link in a design, relative to its own.
HEAVIER = 1.1


class Way(NamedTuple):
    """A way of our own to compute a quantity.

    Attributes:
        method: The method.
        use, what, fragment: As in `CostPoint`.
        setting: What distinguishes it from others of its name.
        threads: Number of threads that share a batch.
    """

    method: Method
    use: Use
    what: str = ""
    fragment: str = ""
    setting: str = EVERY
    threads: int = 1


def ways(quantity: str, effects: Effects) -> list[Way]:
    """Return the ways to compute a quantity, the usual one first."""
    call = "# hybridyn.compile(robot, effects{}).{}"
    if quantity.endswith("jacobian"):
        derive = Method(IN_C, quantity, partial(set_up, quantity, effects, ""), batches=True, threads=True)
        swept = Method(DIFFERENCES, quantity, partial(differences, quantity, effects), grid(step=STEPS))
        return [
            Way(derive, "usual", "keep the derivatives in C", f'# hybridyn.{quantity}(coordinates="motors")'),
            Way(swept, "program", "take central differences", setting=""),
        ]
    slow, fast, single = (
        Method(line, quantity, partial(set_up, quantity, effects, dtype), batches=batches, threads=True)
        for line, dtype, batches in (
            (GENERAL, "", quantity != "designs"), (IN_C, "float64", True), (SINGLE, "float32", True),
        )
    )  # fmt: skip
    told, keep = partial(model_fragment, effects.names, command=quantity), "keep every effect and "
    number, shared = (call.format(x, quantity) for x in (', dtype="float32"', ", threads=2"))
    design = "# robot.with_parameters", call.format(", parameters=[...]", "idm")
    return {
        "close": [
            Way(slow, "usual", "keep the general path", "# hybridyn.assemble", "(usual)"),
            Way(fast, "command", "close the loops in C", call.format("", "assemble"), "a batch"),
        ],
        "designs": [
            Way(slow, "usual", "build the robot of each design", design[0], "a robot a design"),
            Way(fast, "command", "compute designs in C", design[1], "a batch"),
            Way(single, "program", "compute designs in C (float32)", setting="a batch"),
        ],
    }.get(quantity) or [
        Way(slow, "usual", f"{keep}the general path", told("general"), "every effect (usual)"),
        Way(fast, "command", f"{keep}compute in C", told("compiled")),
        Way(single, "program", "compute in C (float32)", number),
        Way(fast, "program", "let two threads share a batch", shared, f"{EVERY}, 2 threads", 2),
    ]


def model_fragment(names: Sequence[str], engine: str, command: str = "idm") -> str:
    """Write the table [effects] of some effects, and the options of a command that request them."""
    return f"{requested(names)}\n# hybridyn {command} --engine {engine} --effects {','.join(names)}"


def requested(names: Sequence[str]) -> str:
    """Write a table [effects] that requests effects by their names."""
    return "[effects]\nuse = [" + ", ".join(f'"{name}"' for name in names) + "]"


def solver(quantity: str, robot: HybridRobot, effects: Effects, model: CompiledRobot | None = None) -> Any:
    """Return the call that computes a quantity for many samples, by the general path without a model.

    Derivatives have compiled models of their own.
    """
    if quantity.endswith("jacobian"):
        return Derivatives(robot, quantity.removesuffix("_jacobian"), effects, coordinates="motors")
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


def share_left_out(
    robot: HybridRobot, every: Effects, left: Effects, quantity: str, state: tuple[Array, ...]
) -> float:
    """Compute the part of a model's work that some effects spare.

    It follows from the operations of the compiled models; from times of the general path for effects that no
    compiled model has.

    Args:
        every: The effects that are computed.
        left: Those that are left.
        state: Many samples, as the quantity takes them.
    """
    if every.uncompiled or left.uncompiled:
        whole, rest = timed(*(partial(solver(quantity, robot, on), *state) for on in (every, left)))
        return 1.0 - rest / whole
    return 1.0 - operations(robot, left, quantity) / operations(robot, every, quantity)


def set_up(quantity: str, effects: Effects, dtype: str, robot: HybridRobot, threads: int = 1) -> Any:
    """Prepare a compiled model of some type of numbers, or the general path without one."""
    free = tuple(design_of(robot)) if quantity == "designs" else ()
    model = (
        compile(robot, effects, dtype=dtype, threads=threads, parameters=free, wait=True) if dtype else None
    )
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


def differences(quantity: str, effects: Effects, robot: HybridRobot) -> Any:
    """Prepare central differences of the compiled model over the motors."""
    model, n = compile(robot, effects, wait=True), len(robot.motors)
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
