"""`BatchMap`: the map between output joints and motors, as of a parallel ankle, for many samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..spatial import Array
from .fallback import Fallback
from .functions import Functions, InWarp


class BatchMap:
    """The map between output joints and motors of a batch.

    Attributes:
        functions: "map_to_joints" and "map_to_motors" as Warp functions, for kernels of your own.
    """

    def __init__(
        self, home: Array, made: dict[str, InWarp], run: Callable[..., tuple[Any, ...]], general: Fallback
    ) -> None:
        self._home, self._made, self._run, self._general = home, made, run, general
        self.functions = Functions(tuple(made), made.__getitem__)

    def to_joints(
        self,
        position: Any,
        rate: Any = 0.0,
        effort: Any = 0.0,
        *,
        near: Any = None,
        fallback: bool = False,
    ) -> tuple[Any, ...]:
        """Compute the output joints from the motors of their modules.

        Args:
            position: Positions of the motors, shape (N, m), [m or rad].
            rate: Their rates, of the same shape; zero by default.
            effort: Their efforts, of the same shape; zero by default.
            near: As in `Batch.close`.
            fallback: Whether the general path computes samples whose guard is above 1, each assembled from
                its own posture `near`.

        Returns:
            q, positions, rates and efforts of equal power of the joints, shapes (N, nq), (N, k), (N, k),
            (N, k), the rates' matrix by rows, shape (N, k m), and guards, shape (N,).

        Raises:
            HybridynError: An array is wrong; or what `hybridyn.joint_map` raises, with `fallback`.
        """
        return self._from("motor", (position, rate, effort), near, fallback)

    def to_motors(
        self,
        position: Any,
        rate: Any = 0.0,
        effort: Any = 0.0,
        *,
        near: Any = None,
        fallback: bool = False,
    ) -> tuple[Any, ...]:
        """Compute the motors from the output joints, as `to_joints` the other way."""
        return self._from("joint", (position, rate, effort), near, fallback)

    def _from(self, side: str, motion: tuple[Any, ...], near: Any, fallback: bool) -> tuple[Any, ...]:
        given = dict(zip((f"{side}_{name}" for name in ("position", "rate", "effort")), motion, strict=True))
        given["near"] = self._home if near is None else near
        made = self._made["map_to_joints" if side == "motor" else "map_to_motors"]
        return self._run(made, given, self._general if fallback else None)
