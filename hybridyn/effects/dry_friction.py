"""Dry friction of joints that hold still: which joints have it, and how much each can hold or resists."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import ModelError
from ..spatial import Array, Index, Mask
from ..structure.robot import HybridRobot
from .choice import Effects
from .joint_laws import DryFriction
from .joints import OnJoints
from .load_friction import OnLoads, larger


class DryLaw(NamedTuple):
    """Dry friction that does not depend on load, of some joints that can stick.

    Attributes:
        effect: The law.
        p: Its parameters, each of shape (n,).
        at: Numbers of its joints among those that can stick.
    """

    effect: DryFriction
    p: list[Array]
    at: Index


class OnSticking(NamedTuple):
    """Dry friction with stiction, applied to joints of one robot.

    Attributes:
        joints: Names of the joints that can stick, each of one freedom.
        columns: Their freedoms in v, shape (k,).
        laws: The laws, but for friction that grows with load.
        loaded: Friction that grows with load, or None.
        of_load: For each joint of `loaded`, its number among `joints`.
        besides: The effects without dry friction.
    """

    joints: tuple[str, ...]
    columns: Index
    laws: tuple[DryLaw, ...]
    loaded: OnLoads | None
    of_load: Index
    besides: Effects

    def levels(self, v: Array, signs: Array) -> Array:
        """Compute the size of friction that does not depend on load, of rates and directions, (..., k)."""
        out = np.zeros(v.shape)
        for law in self.laws:
            out[..., law.at] += law.effect.size(law.p, v[..., law.at], signs[..., law.at])
        return out

    def sliding(self, v: Array, signs: Array) -> Array:
        """Compute that friction, shape (T, k), from rates of the robot, (T, nv), and directions, (T, k)."""
        out: Array = -signs * self.levels(v[:, self.columns], signs)
        return out

    def gains(self, v: Array) -> Array:
        """Compute the friction of each joint of `loaded` at rates v, shape (k,), over that far from rest."""
        assert self.loaded is not None
        out: Array = larger(self.loaded.rise, v[self.of_load], self.loaded.speed)
        return out


def _rubs(law: OnJoints) -> Mask:
    """Return which freedoms of a law have some friction at rest: a level of zero holds nothing."""
    assert isinstance(law.effect, DryFriction)
    rest = np.zeros(len(law.columns))
    sizes = (law.effect.size(law.p, rest, np.full_like(rest, s)) for s in (1.0, -1.0))
    return np.maximum(*sizes) > 0


def on_sticking(on: Effects, robot: HybridRobot) -> OnSticking:
    """Find the joints that can stick.

    Raises:
        ModelError: No joint has dry friction, or one that has some has several freedoms.
    """
    dry = [isinstance(x, OnJoints) and isinstance(x.effect, DryFriction) for x in on.joints]
    laws = tuple(x for x, is_dry in zip(on.joints, dry, strict=True) if is_dry and isinstance(x, OnJoints))
    rubs = [_rubs(x) for x in laws]
    names = {name: x.effect.name for x in laws for name in x.joints}
    loaded = {} if on.loaded is None else dict.fromkeys(on.loaded.joints, on.loaded.effect.name)
    rubbing = {column for x, some in zip(laws, rubs, strict=True) for column in x.columns[some].tolist()}
    columns: dict[int, str] = {}
    for name, effect in (names | loaded).items():
        at = robot.v_slices[robot.joint_index[name]]
        if at.stop - at.start > 1:
            raise ModelError(
                f"stiction: joint '{name}' has {at.stop - at.start} freedoms, and only joints of one can "
                f"stick: leave it out of {effect}, or leave stiction out", element=name,
            )  # fmt: skip
        if at.start in rubbing or name in loaded:
            columns[at.start] = name
    if not columns:
        raise ModelError(
            "stiction: no joint has dry friction: name coulomb_friction, stribeck_friction, "
            "directed_friction or load_friction among the effects, or leave stiction out"
        )
    every = np.array(sorted(columns))
    joints = tuple(columns[at] for at in every.tolist())
    of_load = [] if on.loaded is None else [joints.index(name) for name in on.loaded.joints]
    others = tuple(x for x, is_dry in zip(on.joints, dry, strict=True) if not is_dry)
    besides = replace(on, joints=others, loaded=None)
    own = tuple(
        DryLaw(x.effect, [n[some] for n in x.p], np.searchsorted(every, x.columns[some]))
        for x, some in zip(laws, rubs, strict=True)
        if isinstance(x.effect, DryFriction)
    )
    return OnSticking(joints, every, own, on.loaded, np.array(of_load, int), besides)
