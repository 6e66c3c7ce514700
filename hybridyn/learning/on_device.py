"""A robot's models and their derivatives on a device of Warp: for tensors that lie there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

import torch

from ..compiled import CompiledRobot
from ..errors import HybridynError
from ..warp_batch.arrays import Arrays
from ..warp_batch.batch import Batch
from ..warp_batch.derivatives import DTYPE, DerivativeKernels
from ..warp_batch.launching import Launcher
from .functions import SmoothFunction, functions_of


class OnDevice:
    """Second derivatives of one model of tensors, shapes (T, n), like `hybridyn.SecondDerivatives`.

    Those of "close" are over the motors, all others over the joints. Tensors are read and written in place.
    """

    def __init__(self, batch: Batch, model: str) -> None:
        """Take the models; a program is written, and built by Warp, at its first use."""
        launcher = Launcher(batch.robot, Arrays(batch.device, DTYPE))
        self._run = partial(DerivativeKernels(batch.robot, batch.effects, (), launcher).run, model)
        self._motors, self._nv = batch.robot.motor_v if model == "close" else None, batch.robot.nv

    def product(self, q: Any, v: Any, x: Any, weights: Any, direction: Sequence[Any]) -> SimpleNamespace:
        """Compute the slope of weighted results, and its change along a direction."""
        found = self._run("product", q, v, x, *self._spread(direction), weights)
        each = {
            what: {name: self._own(one) for name, one in found.items() if name.endswith(f"_{what}")}
            for what in ("slope", "product")
        }
        return SimpleNamespace(**each)

    def along(self, q: Any, v: Any, x: Any, direction: Sequence[Any]) -> SimpleNamespace:
        """Compute the first two derivatives of results along a direction."""
        spread = self._spread(direction)
        found = self._run("path", q, v, x, *spread, *map(torch.zeros_like, spread))
        result = next(iter(found))  # the first output
        return SimpleNamespace(first=found[f"{result}_dot"], second=found[f"{result}_ddot"])

    def _spread(self, direction: Sequence[Any]) -> list[Any]:
        """Return a direction as programs read it, zero at joints that are no motors."""
        if self._motors is None:
            return [*direction]
        out = [one.new_zeros(len(one), self._nv) for one in direction]
        for whole, own in zip(out, direction, strict=True):
            whole[:, self._motors] = own
        return out

    def _own(self, found: Any) -> Any:
        """Return a quantity over the coordinates."""
        return found if self._motors is None else found[:, self._motors]


class DeviceFunction(SmoothFunction):
    """A function of tensors on a device; samples in doubt are those of the same function of NumPy arrays."""

    def __init__(
        self, known: SmoothFunction, value: Callable[..., Any], state: Callable[..., Any], batch: Batch
    ) -> None:
        """Join the models of a batch; `known` is the same function of NumPy arrays."""
        super().__init__(known.name, known.sizes, value, state, partial(OnDevice, batch, known.name), torch)
        self._known = known

    def compute(self, weighted: bool, *given: Any) -> Any:
        """Compute y or a derivative, shape (T, n).

        Raises:
            HybridynError: As the function of NumPy arrays raises for a sample.
        """
        found = super().compute(weighted, *given)
        doubtful = found.isnan().any(1).nonzero().flatten()
        if len(doubtful):
            try:
                own = self._known.compute(weighted, *(x[doubtful].numpy(force=True) for x in given))
            except HybridynError as error:
                error.sample = None if error.sample is None else int(doubtful[error.sample])
                raise
            found[doubtful] = torch.from_numpy(own).to(found.device)
        return found


def functions_on(batch: Batch, fast: CompiledRobot) -> dict[str, SmoothFunction]:
    """Return the models "idm", "ddm" and "close" on tensors of the batch's device, as `functions_of`.

    Args:
        batch: The models on the device.
        fast: The same models, which compute samples of which those are not certain.
    """
    nq, nv = batch.robot.nq, batch.robot.nv

    def model(call: Callable[..., Any], near: Any, _: Any, v: Any, x: Any) -> Any:
        """Compute efforts or accelerations."""
        return call(near, v, x)[0]

    def close(near: Any, position: Any, rate: Any, acceleration: Any) -> Any:
        """Close the loops."""
        return torch.cat(batch.close(position, rate, acceleration, near=near)[:3], dim=1)

    def moved(*given: Any) -> Any:
        """Return the state on closed loops."""
        return torch.split(close(*given), [nq, nv, nv], dim=1)

    def as_given(near: Any, _: Any, v: Any, x: Any) -> Any:
        """Return the state that is given."""
        return near, v, x

    calls: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
        "idm": (partial(model, batch.idm), as_given),
        "ddm": (partial(model, batch.ddm), as_given),
        "close": (close, moved),
    }
    return {name: DeviceFunction(known, *calls[name], batch) for name, known in functions_of(fast).items()}
