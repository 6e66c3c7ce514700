"""What is measured along a motion: a quantity, the ways to compute it, and its reference in 113 bits."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...assembly.assemble import assemble
from ...dynamics.direct import ddm
from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...scenes.references import MotorAxes
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..compare.methods import Method, Setting, grid
from .fragments import model_fragment
from .points import Use

if TYPE_CHECKING:
    from ...compiled.model import CompiledRobot

#: Quantities, and what has the errors.
QUANTITIES = {
    "idm": "motor efforts",
    "ddm": "accelerations",
    "close": "the motion of all joints from the motors'",
    "idm_jacobian": "derivatives of motor efforts over the motors' motion",
    "ddm_jacobian": "derivatives of the motors' accelerations over their motion and efforts",
}
GENERAL, IN_C, SINGLE, DIFFERENCES = "general path", "compiled", "compiled, float32", "central differences"
#: Steps of differences of the motors' positions, rates, and accelerations or efforts.
STEPS = tuple(10.0**-k for k in range(1, 8))
#: Step of the differences that are extrapolated.
EXTRAPOLATED = 1e-4

#: Speed of the second motion, relative to the first, on the same path.
SLOWER = 0.7

#: Positions, rates, and accelerations or efforts of some samples.
State = tuple[Array, Array, Array]


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
    what: str
    fragment: str
    setting: str = "every effect"
    threads: int = 1


class Models:
    """The compiled models of a robot, built without their warnings and kept.

    Attributes:
        robot: The robot.
    """

    def __init__(self, robot: HybridRobot) -> None:
        self.robot = robot
        self._found: dict[tuple[Any, ...], CompiledRobot | HybridynError] = {}

    def compiled(self, effects: Effects, dtype: str = "float64", threads: int = 1) -> CompiledRobot:
        """Return a model, built when it is first requested.

        Raises:
            HybridynError: It cannot be built.
        """
        from ...compiled.compiling import compile

        key = effects.names, dtype, threads
        log = logging.getLogger("hybridyn.compiled")
        if key not in self._found:
            before = log.level
            log.setLevel(logging.ERROR)  # without its legs' inertia, a robot may have massless motions
            try:
                self._found[key] = compile(self.robot, effects, dtype=dtype, threads=threads)
            except HybridynError as error:
                self._found[key] = error
            finally:
                log.setLevel(before)
        found = self._found[key]
        if isinstance(found, HybridynError):
            raise found
        return found


@dataclass(frozen=True, eq=False)
class Task:
    """A quantity at the states of two motions.

    Attributes:
        motions: States of the motion, and of the same path at another speed.
        exact: The quantity there, as blocks of shape (T, ...).
    """

    motions: list[State]
    exact: list[list[Array]]

    def errors(self, call: Any, batches: bool = True, rows: Any = slice(None)) -> tuple[float, float]:
        """Return the errors of a call on both motions: the largest of any number, relative to the peak.

        Args:
            call: Computes the quantity for many samples, or for one.
            batches: Whether it takes many.
            rows: Those that are compared.
        """
        out = []
        for motion, exact in zip(self.motions, self.exact, strict=True):
            states = tuple(x[rows] for x in motion)
            if batches:
                found = blocks(call(*states))
            else:
                each = [blocks(call(*state)) for state in zip(*states, strict=True)]
                found = [np.array(x) for x in zip(*each, strict=True)]
            out.append(max(map(_error, found, exact, len(exact) * [rows])))
        return out[0], out[1]


def _error(found: Array, exact: Array, rows: Any) -> float:
    """Compare a block: efforts each with the peak of its motor, other numbers with the largest of all."""
    peak = np.abs(exact).max(axis=0) if exact.ndim == 2 else np.abs(exact).max()
    return float((np.abs(found - exact[rows]) / np.where(peak > 0, peak, 1.0)).max(initial=0.0))


def blocks(found: Any) -> list[Array]:
    """Return a result as a list of arrays."""
    parts = (
        found.values() if isinstance(found, dict) else found if isinstance(found, tuple | list) else [found]
    )
    return [np.asarray(x, dtype=float) for x in parts]


def ways(models: Models, quantity: str, effects: Effects) -> Iterator[Way]:
    """Yield the ways to compute a quantity, the usual one first."""
    call = f"# hybridyn.{quantity}"
    if quantity.endswith("jacobian"):
        derive = Method(IN_C, quantity, partial(_derivatives, quantity, effects), batches=True)
        yield Way(derive, "usual", "keep the derivatives in C", f'{call}(..., coordinates="motors")')
        setup = partial(_differences, models, quantity, effects)
        swept = Method(DIFFERENCES, quantity, setup, grid(step=STEPS))
        yield Way(swept, "program", "take central differences", "", setting="")
        return

    def usual(robot: HybridRobot) -> Callable[[Setting], Any]:
        """Prepare the general path."""
        return lambda setting: general(quantity, robot, effects)

    def in_c(dtype: str, robot: HybridRobot, threads: int = 1) -> Callable[[Setting], Any]:
        """Prepare a compiled model."""
        model = models.compiled(effects, dtype, threads)
        close = partial(_closed, model.assemble, robot)
        return lambda setting: close if quantity == "close" else getattr(model, quantity)

    slow, fast, single = (
        Method(line, quantity, setup, batches=True, threads=line != GENERAL)
        for line, setup in (
            (GENERAL, usual),
            (IN_C, partial(in_c, "float64")),
            (SINGLE, partial(in_c, "float32")),
        )
    )
    call = "# hybridyn.compile(robot, effects{}).{}"
    if quantity == "close":
        yield Way(slow, "usual", "keep the general path", "# hybridyn.assemble", "(usual)")
        yield Way(fast, "command", "close the loops in C", call.format("", "assemble"), "a batch")
        return
    told = partial(model_fragment, effects.names, command=quantity)
    keep = "keep the general path and every effect"
    yield Way(slow, "usual", keep, told("general"), "every effect (usual)")
    yield Way(fast, "command", "keep every effect and compute in C", told("compiled"))
    words = "compute in C (float32)"
    yield Way(single, "program", words, call.format(', dtype="float32"', quantity))
    words, share = "every effect, 2 threads", "let two threads share a batch"
    yield Way(fast, "program", share, call.format(", threads=2", quantity), words, 2)


def general(quantity: str, robot: HybridRobot, effects: Effects) -> Any:
    """Return the call of the general path."""
    if quantity == "close":
        return partial(_closed, partial(assemble, robot), robot)
    return partial(idm if quantity == "idm" else ddm, robot, effects=effects)


def motors_of(robot: HybridRobot, q: Array, v: Array, a: Array) -> State:
    """Return positions, rates and accelerations of the motors, shapes (T, motors)."""
    axes = MotorAxes.of(robot)
    x = np.array(q[..., axes.at])
    x[..., axes.turns] = np.arctan2(q[..., axes.at[axes.turns] + 1], x[..., axes.turns])
    return x, v[..., axes.columns], a[..., axes.columns]


def _closed(close: Any, robot: HybridRobot, q: Array, v: Array, a: Array) -> State:
    """Close the loops of some rows from the motors' motion and the first posture."""
    found: State = close(motors=motors_of(robot, q, v, a), guess=q[0])
    return found


def _derivatives(quantity: str, effects: Effects, robot: HybridRobot) -> Any:
    """Prepare the derivatives of a model over the motors."""
    from ...compiled.derivatives import Derivatives

    derive = Derivatives(robot, quantity.removesuffix("_jacobian"), effects, coordinates="motors")
    return lambda setting: derive


def _differences(models: Models, quantity: str, effects: Effects, robot: HybridRobot) -> Any:
    """Prepare central differences of the compiled model over the motors."""
    model, n = models.compiled(effects), len(robot.motors)
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
    from ...compiled.library.calls import load
    from ...compiled.programs.whole_robot import programs

    program = programs(robot, effects, models=(quantity,))[quantity]
    base = [np.zeros((len(state[0]), size)) for _, size in program.inputs[3:]]  # that of a moving base
    found, guard = load([program], dtype="float128").batch(program.name, *state, *base)
    if not np.all(guard <= 1.0):
        raise HybridynError("the compiled model is not certain of every sample")
    return [np.asarray(x, dtype=float) for x in found]


def extrapolated(models: Models, quantity: str, effects: Effects, state: State) -> tuple[list[Array], float]:
    """Compute derivatives by central differences, extrapolated to a step of zero.

    Code of derivatives in 113 bits takes minutes to build.

    Returns:
        Blocks of shape (T, motors, motors), and their own error, relative to the largest number of each.
    """
    at = _differences(models, quantity, effects, models.robot)
    samples = [*zip(*state, strict=True)]
    coarse, middle, fine = (
        np.array([at({"step": factor * EXTRAPOLATED})(*sample) for sample in samples]) for factor in (4, 2, 1)
    )
    less, best = ((4.0 * x - y) / 3.0 for x, y in ((middle, coarse), (fine, middle)))
    found = [*np.moveaxis(best, 1, 0)]
    own = max(map(_error, np.moveaxis(less, 1, 0), found, len(found) * [slice(None)]))
    return found, own


def operations(robot: HybridRobot, effects: Effects, model: str) -> float:
    """Count the operations of a model without building code; nan where no program can be written."""
    try:
        from ...compiled.program import Call
        from ...compiled.programs.whole_robot import programs

        program = programs(robot, effects, models=(model,))[model]
    except (HybridynError, ImportError):
        return float("nan")
    calls = (step for step in program.steps if isinstance(step, Call))
    return float(sum(program.kernels[c.kernel].function.n_instructions() * c.copies for c in calls))
