"""Samples of a motion and a design, as models with sweeps take them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics.loads import in_every_sample
from ..errors import ModelError, TrajectoryError
from ..spatial import Array
from ..structure.parameters.chosen import Parameters
from ..structure.samples import same_samples


class Samples(NamedTuple):
    """Samples of a motion and a design.

    Attributes:
        q, v: Positions and rates, shapes (T, nq), (T, nv).
        x: Accelerations, shape (T, nv), or efforts, shape (T, motors).
        slots: Numbers in slots, shape (T, slots).
        p: The parameters, shape (k,).
        single: Whether the input was one sample.
        wrenches: Wrenches on links, shape (T, 6 links).
        base: Acceleration of a prescribed base, shape (T, 6); zero where the caller gives efforts.
    """

    q: Array
    v: Array
    x: Array
    slots: Array
    p: Array
    single: bool
    wrenches: Array
    base: Array

    @property
    def numbers(self) -> tuple[Array, Array, Array, Array]:
        """The arguments of the rows of loops; where efforts are given, accelerations do not matter."""
        a = self.x if self.x.shape == self.v.shape else np.zeros(self.v.shape)
        return self.q, self.v, a, self.slots

    def repeated(self, count: int) -> Samples:
        """Return each sample a number of times."""
        q, v, x, slots, *more = (np.repeat(one, count, axis=0) for one in (*self[:4], *self[6:]))
        return Samples(q, v, x, slots, self.p, self.single, *more)


def samples_of(
    parameters: Parameters,
    given: tuple[tuple[Array, bool], ...],
    values: ArrayLike | None,
    wrenches: Array,
    *,
    moving: bool,
) -> Samples:
    """Return samples of a design.

    Args:
        parameters: The parameters.
        given: q, v, and a or efforts, with whether they are of one sample.
        values: Values of the parameters, shape (k,), or None for those of the robot.
        wrenches: As `wrench_columns` returns them.
        moving: Whether the motion of the base is prescribed.

    Raises:
        TrajectoryError: Numbers of samples differ, or the parameters have a wrong shape or are not finite.
        ModelError: A design is not possible.
    """
    (q, single), (v, _), (x, _) = given
    p = parameters.nominal if values is None else np.asarray(values, dtype=float)
    same_samples(**{"q": q, "v": v, "a or tau": x})
    if p.shape != (parameters.size,) or not np.isfinite(p).all():
        raise TrajectoryError(
            f"parameters has shape {p.shape}; wanted {parameters.size} finite numbers "
            f"({', '.join(parameters.labels[:6])}{', ...' if parameters.size > 6 else ''})"
        )
    slots = parameters.slot_values(p[None])[0]
    parameters.check(slots)
    base = x[:, :6] if moving and x.shape == v.shape else np.zeros((len(q), 6))
    return Samples(q, v, x, np.tile(slots, (len(q), 1)), p, single, wrenches, base)


def wrench_columns(links: Sequence[str], given: Mapping[str, ArrayLike], samples: int) -> Array:
    """Return wrenches side by side, shape (samples, 6 links); those that are not given are zero.

    Raises:
        ModelError: One is on another link.
        TrajectoryError: One has a wrong shape, or is not finite.
    """
    if unknown := {*given} - {*links}:
        raise ModelError(
            f"wrench on '{min(unknown)}': name the link among the 'wrenches' of DesignGradients",
            element=min(unknown),
        )
    columns = [in_every_sample(given.get(x, np.zeros(6)), f"wrench on '{x}'", samples) for x in links]
    return np.concatenate([np.zeros((samples, 0)), *columns], axis=1)
