"""The general path behind a batch: it computes samples in doubt, and is what new models are compared with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..assembly.assemble import assemble
from ..assembly.posture import holding, posture_at
from ..compiled import DesignsInSlots, verify
from ..dynamics.inverse import idm
from ..dynamics.quantities.joint_map import joint_map, motors_beside
from ..errors import SingularityError
from ..scenes.controllers import ComputedTorque, Pd
from ..simulation.motion_law import Effort
from ..simulation.simulate import simulate
from ..spatial import Array, Index
from ..structure.robot import HybridRobot
from .functions import Native
from .native_models import LAWS

#: Computes some samples by the general path: numbers of the samples and all inputs, to rows of the outputs.
Fallback = Callable[[Index, dict[str, Array]], Sequence[Array]]


class General:
    """Functions of the general path for some samples of a batch."""

    def __init__(self, designs: DesignsInSlots, dtype: str) -> None:
        self._designs, self._dtype = designs, dtype
        self._robot, self._effects = designs.robot, designs.effects

    def model(self, name: str, rows: Index, given: dict[str, Array]) -> Sequence[Array]:
        """Compute "idm" or "ddm" of some samples, each with its parameters.

        Args:
            rows: Numbers of the samples.
            given: All inputs by name, shape (N, width) each.
        """
        return [self._designs.general(name, given, rows)]

    def close(self, rows: Index, given: dict[str, Array]) -> Sequence[Array]:
        """Compute "close" of some samples, each from its own posture."""
        states = [self._closed(robot, row, given)[1:] for robot, row in self._each(rows, given)]
        return [np.array(x) for x in zip(*states, strict=True)]

    def control(self, rows: Index, given: dict[str, Array]) -> Sequence[Array]:
        """Compute "idm_from_motors" of some samples."""
        found = [self._closed(robot, row, given) for robot, row in self._each(rows, given)]
        efforts = [idm(robot, q, v, a, effects=self._designs.effects_of(robot)) for robot, q, v, a in found]
        return [*(np.array(x) for x in list(zip(*found, strict=True))[1:]), np.array(efforts)]

    def step(self, law: str, rows: Index, given: dict[str, Array]) -> Sequence[Array]:
        """Take the steps of some samples by `hybridyn.simulate`.

        Raises:
            SingularityError: A sample's steps cannot be taken to the end; the message has its number.
            HybridynError: As `hybridyn.simulate` raises.
        """
        closed = "project" if self._dtype == "float32" else "refuse"  # its rates are open by its rounding
        ends = []
        for robot, row in self._each(rows, given):
            h, steps = given["clock"][row]
            run = simulate(
                robot, given["q"][row], given["v"][row], (0.0, h * steps),
                effects=self._designs.effects_of(robot),
                effort=self._law(law, [given[name][row] for name in LAWS[law]]),
                initial_velocity=closed, method="rk4", step=abs(h),
            )  # fmt: skip
            if run.status != "finished":
                raise SingularityError(f"sample {row}: the steps cannot be taken: {run.message}", sample=row)
            ends.append((run.q[-1], run.v[-1], run.a[-1]))
        return [np.array(x) for x in zip(*ends, strict=True)]

    def _law(self, law: str, reads: list[Array]) -> Effort:
        """Return a law of `Batch.step`, one of `LAWS`, as `simulate` takes it, from what it reads."""
        start, slope, bend = [*reads, np.zeros(1), np.zeros(1)][:3]

        def at(t: float) -> tuple[Any, ...]:
            return start + t * slope + t * t / 2 * bend, slope + t * bend, bend

        if law in ("constant", "table"):
            return lambda t, q, v: at(t)[0]
        gains = (dict(zip(self._robot.motors, x, strict=True)) for x in reads[3:])
        make: Any = Pd if law == "pd" else partial(ComputedTorque, effects=self._effects)
        return make(self._robot, SimpleNamespace(at=at), *gains)  # type: ignore[no-any-return]

    def map(self, joints: Sequence[str], rows: Index, given: dict[str, Array]) -> Sequence[Array]:
        """Compute the map between output joints and motors of some samples, from the side that is given."""
        side, other = ("motor", "joint") if "motor_position" in given else ("joint", "motor")
        names = motors_beside(self._robot, joints) if side == "motor" else joints
        held, found = holding(self._robot, names), []
        for row in rows:
            x, rate, effort = (given[f"{side}_{name}"][row] for name in ("position", "rate", "effort"))
            q = posture_at(held, dict(zip(names, x, strict=True)), given["near"][row])
            relation = joint_map(self._robot, q, joints)
            position, to_rate, to_effort, matrix = (
                getattr(relation, f"{other}{name}")
                for name in ("_positions", "_rates", "_efforts", f"s_per_{side}s")
            )
            found.append((q, position, to_rate(rate), to_effort(effort), matrix.ravel()))
        return [np.array(x) for x in zip(*found, strict=True)]

    def _each(self, rows: Index, given: dict[str, Array]) -> list[tuple[HybridRobot, int]]:
        """Return the robot of each sample."""
        numbers = given.get("parameters", np.zeros((rows.max() + 1, 0)))
        return [(self._designs.robot_of(numbers[row]), int(row)) for row in rows]

    def _closed(self, robot: HybridRobot, row: int, given: dict[str, Array]) -> tuple[Any, ...]:
        """Return the robot of a sample, and its motion from the motors'."""
        levels = (given[name][row] for name in ("position", "rate", "acceleration"))
        motors = dict(zip(robot.motors, zip(*levels, strict=True), strict=True))
        return (robot, *assemble(robot, motors=motors, guess=given["near"][row]))

    def check(self, native: Native, run: Callable[[dict[str, Any]], Any]) -> None:
        """Compare a new model with the general path at random states, see `compiled.verifying.verify`.

        Args:
            native: The model.
            run: Computes results and guards from its inputs by name.

        Raises:
            CompileError: They differ.
        """
        names = [name for name, _ in native.inputs]
        design = self._designs.numbers(None, ()) if self._designs.parameters.size else None

        def batch(_: str, *inputs: Array) -> tuple[tuple[Any, ...], Any]:
            *results, guard = run(dict(zip(names, inputs, strict=True)))
            return tuple(results), guard

        library = SimpleNamespace(dtype=self._dtype, programs={native.name: None}, batch=batch)
        verify(library, self._robot, self._effects, design=design)
