"""A motion of the motors that a robot follows exactly, and the efforts that it takes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..assembly.assemble import assemble
from ..assembly.task import closure_residual
from ..dynamics.energy import energy
from ..dynamics.inverse import idm
from ..effects import Effects
from ..simulation.result import Counters, Origin, SimulationResult
from ..simulation.system import State
from ..spatial import Array
from ..streams.one_pass import rows_at_once, samples_counted_from
from ..structure.robot import HybridRobot
from .references import Reference

if TYPE_CHECKING:
    from ..compiled import CompiledRobot


def follow_motion(
    robot: HybridRobot,
    reference: Reference,
    times: Array,
    effects: Effects,
    guess: Array,
    compiled: CompiledRobot | None = None,
) -> SimulationResult:
    """Compute the motion of a robot whose motors follow a reference exactly, and the efforts, block by block.

    Args:
        robot: The robot; its motors must determine its posture.
        reference: The motion of the motors.
        times: Times of the samples, shape (T,), [s].
        effects: The effects that are computed.
        guess: Posture near the start, shape (nq,).
        compiled: The robot's compiled models with these effects; None for the general path.

    Raises:
        AssemblyError: A posture is out of reach, or motors do not determine the motion.
        ActuationError: A passive motion would need an effort.
    """
    rows = rows_at_once(robot)
    blocks: list[tuple[Array, ...]] = []
    for first in range(0, len(times), rows):
        with samples_counted_from(first):
            posture, *found = _block(robot, reference, times[first : first + rows], effects, guess, compiled)
        guess = posture[-1]
        blocks.append(tuple(found))
    q, v, a, tau, kinetic, potential, residual = map(np.concatenate, zip(*blocks, strict=True))
    return SimulationResult(
        origin=Origin(robot.name, "prescribed"), t=times, q=q, v=v, a=a, tau=tau, kinetic=kinetic,
        potential=potential, residual=residual, pivot=np.zeros(0), events=(), status="finished", message="",
        counters=Counters(), state=State(float(times[-1]), q[-1], v[-1], a[-1]), next_step=0.0, on_grid=0,
        start=float(times[0]),
    )  # fmt: skip


def _block(
    robot: HybridRobot,
    reference: Reference,
    times: Array,
    effects: Effects,
    guess: Array,
    compiled: CompiledRobot | None,
) -> tuple[Array, ...]:
    """Compute some samples.

    Returns:
        The assembled positions, shape (T, nq); those with a prescribed base's pose, rates, accelerations,
        efforts, kinetic and potential energy, and residuals.
    """
    x = reference.rows(times)
    motors = {name: tuple(level[:, i] for level in x) for i, name in enumerate(robot.motors)}
    close = partial(assemble, robot) if compiled is None else compiled.assemble
    closed, v, a = close(motors=motors, guess=guess)
    q = closed
    if effects.base is not None:
        q, v, a = effects.base.into(robot, times, q, v, a)
    model = partial(idm, robot, effects=effects, time=times) if compiled is None else compiled.idm
    tau = model(q, v, a)
    stored = energy(robot, q, v, effects=effects)
    residual = np.asarray(closure_residual(robot, q))
    return closed, q, v, a, tau, stored.kinetic, stored.potential, residual
