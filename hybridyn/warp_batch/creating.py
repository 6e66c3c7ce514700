"""`hybridyn.warp`: the models of a robot for many samples at once, on a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from ..compiled import asked_for, needs_casadi
from ..effects.choice import Choice
from ..errors import CompileError, install_advice
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot

if TYPE_CHECKING:
    from .batch import Batch


def warp(
    robot: HybridRobot,
    effects: Choice = None,
    parameters: Sequence[str | Slot] = (),
    dtype: str = "float64",
    device: Any = None,
) -> Batch:
    """Prepare a robot's models for many samples at once through Warp, on a GPU or on the processor.

    Each model is built by Warp when it is first called, and kept in Warp's cache.

    Args:
        robot: The robot.
        effects: Effects to include, as for `hybridyn.idm`; without "limits".
        parameters: Numbers of the robot that calls may change, as for `hybridyn.compile`.
        dtype: "float64" or "float32".
        device: Device of Warp, such as "cuda:0" or "cpu"; default the one that Warp prefers.

    Returns:
        The models; see `Batch`.

    Raises:
        CompileError: Warp or casadi is not installed.
        ModelError: A parameter is unknown, `dtype` is invalid, there is no such device, no joint moves, or an
            effect is not available.

    Example:
        >>> batch = hybridyn.warp(hybridyn.load("five_bar"), device="cpu")
        >>> q, v, a, failed = batch.random_states(100)
        >>> tau, guard = batch.idm(q, v, a)
        >>> tau.shape
        (100, 2)
    """
    needs_casadi()
    if find_spec("warp") is None:
        raise CompileError(f"batches need Warp: {install_advice('gpu')}")
    from .arrays import device_of  # they import Warp, which takes half a second
    from .batch import Batch

    robot, on, chosen = asked_for(robot, effects, parameters, dtype, "batches")
    return Batch(robot, on, chosen, dtype, device_of(device))
