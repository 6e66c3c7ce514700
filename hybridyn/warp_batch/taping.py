"""Gradients on a tape of Warp: going back, it runs the products of a model's derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..compiled import SecondDerivatives
from ..effects.choice import Effects
from ..errors import ModelError, TrajectoryError
from ..spatial import Index
from ..structure.robot import HybridRobot
from .arrays import Arrays, requires_gradient
from .derivatives import DTYPE, DerivativeKernels
from .functions import defined, wp

#: Inputs that carry a gradient, by model, in the order of its derivatives.
OVER = {"idm": ("q", "v", "a"), "ddm": ("q", "v", "tau"), "close": ("position", "rate", "acceleration")}
#: Python of the kernel that adds columns of a slope to columns of a gradient. One row may stand for all.
ADD = """@wp.kernel(module="unique", enable_backward=False)
def add(slope: rows, columns: numbers, to: numbers, gradient: rows):
    i = wp.tid()
    for k in range(columns.shape[0]):
        wp.atomic_add(gradient, i, to[k], slope[i, columns[k]])
"""
#: Python of the kernel that adds slopes over the freedoms of joints whose turn is a unit quaternion, or a
#: cosine and a sine: numbers of each are its begin in q and in v, the size of its shift, and its freedoms.
TURN = """@wp.kernel(module="unique", enable_backward=False)
def turn(slope: rows, q: rows, joints: table, gradient: rows):
    i = wp.tid()
    for k in range(joints.shape[0]):
        start, at, n = joints[k, 0], joints[k, 1], joints[k, 2]
        t, w = start + n, at + n
        if joints[k, 3] == 1:
            c, s = q[i, t], q[i, t + 1]
            wp.atomic_add(gradient, i, t, -s * slope[i, w])
            wp.atomic_add(gradient, i, t + 1, c * slope[i, w])
            if n == 2:
                wp.atomic_add(gradient, i, start, c * slope[i, at] - s * slope[i, at + 1])
                wp.atomic_add(gradient, i, start + 1, s * slope[i, at] + c * slope[i, at + 1])
        else:
            r = wp.quatd(q[i, t], q[i, t + 1], q[i, t + 2], q[i, t + 3])
            p = r * wp.quatd(slope[i, w], slope[i, w + 1], slope[i, w + 2], wp.float64(0.0))
            for m in range(4):
                wp.atomic_add(gradient, i, t + m, wp.float64(2.0) * p[m])
            if n == 3:
                x = wp.quat_rotate(r, wp.vec3d(slope[i, at], slope[i, at + 1], slope[i, at + 2]))
                for m in range(3):
                    wp.atomic_add(gradient, i, start + m, x[m])
"""


class Taping:
    """Records "idm", "ddm" and "close" of a batch on tapes."""

    def __init__(
        self, robot: HybridRobot, effects: Effects, arrays: Arrays, derivatives: DerivativeKernels
    ) -> None:
        """Take the models; nothing is written before a tape goes back."""
        self._robot, self._effects, self._arrays, self._derivatives = robot, effects, arrays, derivatives

    def of(self, model: str) -> Callable[..., None] | None:
        """Return what records a call of a model, as `Launcher.run` takes it; None if it has no gradient."""
        return partial(self._record, model) if model in OVER else None

    def _record(
        self, model: str, tape: Any, given: Mapping[str, Any], read: Mapping[str, Any], results: Sequence[Any]
    ) -> None:
        """Record a call.

        Args:
            tape: The tape.
            given: Inputs as users gave them, some of which require a gradient.
            read: Inputs, shapes (N, n).
            results: Results, shapes (N, n), which are made to require a gradient.

        Raises:
            HybridynError: There is no such gradient.
        """
        if self._arrays.dtype != DTYPE:
            raise ModelError(
                f"gradients on a tape need a batch of dtype='{DTYPE}', not '{self._arrays.dtype}'"
            )
        asked = {name: x for name, x in given.items() if requires_gradient(x)}
        for name in asked:
            if name not in OVER[model]:
                raise ModelError(
                    f"{name} of '{model}' has no gradient on a tape: give an array without requires_grad"
                )
        first = next(iter(given))
        if not isinstance(given[first], wp.array):
            raise TrajectoryError(
                f"{next(iter(asked))} requires a gradient, but {first} is no array of Warp: make it one"
            )
        over = "motors" if model == "close" else "joints"
        SecondDerivatives(self._robot, model, self._effects, coordinates=over)  # refuses what has none
        for x in results:
            x.requires_grad = True
        tape.record_func(partial(self._go_back, model, asked, read, results), [*asked.values(), *results])

    def _go_back(
        self, model: str, asked: Mapping[str, Any], read: Mapping[str, Any], results: Sequence[Any]
    ) -> None:
        """Add to the gradients of the inputs; leave those of the results zero, as Warp's own kernels do."""
        arrays, robot, count = self._arrays, self._robot, results[0].shape[0]
        state = results if model == "close" else [read[name] for name in OVER[model]]
        numbers = [read["parameters"]] if "parameters" in read else []
        third = len(robot.motors) if model == "ddm" else robot.nv
        still = [np.zeros(width) for width in (robot.nv, robot.nv, third)]
        found = self._derivatives.run(model, "product", *state, *numbers, *still, self._weights(results))
        slopes = [x for name, x in found.items() if name.endswith("_slope")]
        add, turn = self._kernels
        for name, slope in zip(OVER[model], slopes, strict=True):
            if name in asked:
                gradient = arrays.rows(name, asked[name].grad, count)
                arrays.launch(add, count, [slope, *self._places[name], gradient])
                if name == "q" and len(self._turning):
                    arrays.launch(turn, count, [slope, read[name], self._turning, gradient])
        for x in results:
            if not x.retain_grad:
                x.grad.zero_()

    def _weights(self, results: Sequence[Any]) -> Any:
        """Return the gradients of all results, one beside the other."""
        if len(results) == 1:
            return results[0].grad
        ends = np.cumsum([x.shape[1] for x in results]).tolist()
        whole = self._arrays.empty(results[0].shape[0], ends[-1])
        for x, end in zip(results, ends, strict=True):
            wp.copy(whole[:, end - x.shape[1] : end], x.grad)
        return whole

    @cached_property
    def _kernels(self) -> tuple[Any, Any]:
        """The kernels that add slopes."""
        scope = {"rows": wp.array(dtype=wp.float64, ndim=2), "numbers": wp.array(dtype=wp.int32)}
        scope["table"] = wp.array(dtype=wp.int32, ndim=2)
        return defined(ADD, "add", scope), defined(TURN, "turn", scope)

    @cached_property
    def _places(self) -> dict[str, tuple[Any, Any]]:
        """Columns of the slope over each input, and of its gradient to which they are added."""
        robot, motors = self._robot, len(self._robot.motors)
        plain = [(v.start, x.start) for kind, x, v in self._joints if kind.additive]
        places: dict[str, tuple[Sequence[Any] | Index, Sequence[Any] | Index]] = {
            "q": ([v for v, _ in plain], [x for _, x in plain])
        }
        places |= {name: (range(robot.nv),) * 2 for name in ("v", "a")} | {"tau": (range(motors),) * 2}
        places |= {name: (robot.motor_v, range(motors)) for name in OVER["close"]}
        return {name: (self._indices(at), self._indices(to)) for name, (at, to) in places.items()}

    @cached_property
    def _turning(self) -> Any:
        """The joints of the kernel `TURN`, shape (k, 4)."""
        rows = [
            (x.start, v.start, kind.shift, kind.nv - kind.shift)
            for kind, x, v in self._joints
            if kind.nv and not kind.additive
        ]
        return self._indices(np.array(rows).reshape(-1, 4))

    @property
    def _joints(self) -> list[tuple[Any, slice, slice]]:
        """Kind of each joint, and its places in q and in v."""
        return [*zip(self._robot.kinds, self._robot.q_slices, self._robot.v_slices, strict=True)]

    def _indices(self, x: Any) -> Any:
        """Return whole numbers on the device."""
        return wp.array(np.array(x, dtype=np.int32), dtype=wp.int32, device=self._arrays.device)
