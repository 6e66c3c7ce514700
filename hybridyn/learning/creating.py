"""`hybridyn.torch` and `hybridyn.jax`: the models of a robot for PyTorch, and for JAX."""

from __future__ import annotations

from typing import Any

from ..compiled import CompiledRobot, SecondDerivatives, compile
from ..effects.choice import Choice
from ..errors import required
from ..structure.robot import HybridRobot
from ..warp_batch.creating import warp
from .functions import functions_of
from .robot import LearningRobot


def torch(
    robot: HybridRobot, effects: Choice = None, *, threads: int = 1, device: Any = None
) -> LearningRobot:
    """Prepare a robot's models for PyTorch: its tensors come and go, and have gradients through closed loops.

    Values are those of `hybridyn.compile`. `backward`, double `backward`, forward mode and the transforms of
    `torch.func` work. Tensors are of type float64.

    Args:
        robot: The robot.
        effects: As for `hybridyn.idm`; those with a second derivative, see `hybridyn.SecondDerivatives`.
        threads: Number of threads that share a batch.
        device: Where tensors lie and kernels of `hybridyn.warp` compute, as "cuda"; the processor if None.

    Returns:
        The models; see `LearningRobot`.

    Raises:
        HybridynError: PyTorch, or Warp for a device, is not installed.
        ModelError: An effect has no second derivative or no compiled model, or there is no such device.
        CompileError: As `hybridyn.compile` raises.

    Example:
        >>> import torch
        >>> model = hybridyn.torch(hybridyn.load("five_bar"))
        >>> position = torch.tensor([0.1, 0.2], dtype=torch.float64, requires_grad=True)
        >>> tau = model.idm(*model.close(position))
        >>> torch.autograd.grad(tau[0], position)[0].numpy().round(3)
        array([ 2.881, -0.276])
    """
    required("torch", "torch", "hybridyn.torch")
    from .torch_arrays import framework_on  # it imports PyTorch, which takes seconds

    fast = _compiled(robot, effects, threads)
    if device is None:
        return LearningRobot(fast, framework_on("cpu"), functions_of(fast))
    batch = warp(robot, effects, device=device)
    from .on_device import functions_on  # it imports Warp

    return LearningRobot(fast, framework_on(str(batch.device)), functions_on(batch, fast))


def jax(robot: HybridRobot, effects: Choice = None, *, threads: int = 1) -> LearningRobot:
    """Prepare a robot's models for JAX: its arrays come and go, and have gradients through closed loops.

    Values are those of `hybridyn.compile`, which the processor computes, wherever arrays lie. `jax.grad`,
    `jax.jvp`, `jax.hessian`, `jax.vmap`, `jax.jit` and `jax.lax.scan` work, one inside the other. JAX has to
    compute in double precision.

    Args:
        robot: The robot.
        effects: As for `hybridyn.torch`.
        threads: Number of threads that share a batch.

    Returns:
        The models; see `LearningRobot`.

    Raises:
        HybridynError: JAX is not installed, or computes in single precision.
        ModelError: As `hybridyn.torch` raises.
        CompileError: As `hybridyn.compile` raises.

    Example:
        >>> import jax
        >>> jax.config.update("jax_enable_x64", True)
        >>> model = hybridyn.jax(hybridyn.load("five_bar"))
        >>> effort = lambda position: model.idm(*model.close(position))[0]
        >>> print(jax.grad(effort)(jax.numpy.array([0.1, 0.2])).round(3))
        [ 2.881 -0.276]
    """
    required("jax", "jax", "hybridyn.jax")
    from .jax_arrays import JAX  # it imports JAX, which takes seconds

    fast = _compiled(robot, effects, threads)
    return LearningRobot(fast, JAX, functions_of(fast))


def _compiled(robot: HybridRobot, effects: Choice, threads: int) -> CompiledRobot:
    """Return the compiled models of a robot whose effects have second derivatives."""
    SecondDerivatives(robot, effects=effects)  # refuses effects with kinks
    return compile(robot, effects, threads=threads)
