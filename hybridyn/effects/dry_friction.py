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
from .load_friction import LoadFriction, OnLoads, larger


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

    Friction that grows with load is one vector for a ball, which sticks as a whole. Coulomb friction of a
    ball acts about each of its axes, which stick one by one.

    Attributes:
        joints: Names of the joints that can stick.
        columns: Their freedoms in v, shape (k,).
        laws: The laws, but for friction that grows with load.
        loaded: Friction that grows with load, or None.
        of_load: For each joint of `loaded`, the places of its freedoms among `columns`.
        balls: Those of all balls.
        besides: The effects without dry friction.
    """

    joints: tuple[str, ...]
    columns: Index
    laws: tuple[DryLaw, ...]
    loaded: OnLoads | None
    of_load: tuple[Index, ...]
    balls: tuple[Index, ...]
    besides: Effects

    @property
    def vectors(self) -> tuple[Index, ...]:
        """Places of the freedoms of balls whose friction is one vector."""
        return tuple(at for at in self.of_load if len(at) > 1)

    def at_rest(self, signs: Array) -> Mask:
        """Return which freedoms stick, (..., k), from directions: of balls unit vectors, or zero at rest."""
        out: Mask = signs == 0
        for at in self.vectors:
            out[..., at] = out[..., at].all(axis=-1, keepdims=True)
        return out

    def stays(self, signs: Array) -> Mask:
        """Return which freedoms stick that have a position, shape (k,): not some axes of a ball."""
        out = self.at_rest(signs)
        for at in self.balls:
            out[at] = out[at].all()
        return out

    def along(self, v: Array, signs: Array) -> Array:
        """Compute rates along directions, both of shape (..., k): those of balls once for each freedom."""
        out: Array = v * signs
        for at in self.vectors:
            out[..., at] = out[..., at].sum(axis=-1, keepdims=True)
        return out

    def directions(self, v: Array, signs: Array) -> Array:
        """Compute directions at rates v of these freedoms from earlier ones, shape (k,) each.

        A ball slides along its rate, or against it where it has passed rest: so a step is smooth up to there.
        Next to rest, below some `width`, its rate has no direction of its own: the earlier one is added.
        """
        out, way = signs.astype(float), self.along(v, signs)
        for at in self.vectors:
            assert self.loaded is not None
            width, size = self.loaded.effect.width, float(np.linalg.norm(v[at]))
            towards = np.copysign(1.0, way[at]) * v[at] + width * np.exp(-((size / width) ** 2)) * signs[at]
            if signs[at].any():
                out[at] = towards / np.linalg.norm(towards)
        return out

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
        speeds = np.array([np.linalg.norm(v[at]) for at in self.of_load])
        out: Array = larger(self.loaded.rise, speeds, self.loaded.speed)
        return out

    def of_loads(self, numbers: Array) -> Array:
        """Return the number of each freedom's joint of `loaded`, (k,), or 0, from those, shape (joints,)."""
        out = np.zeros(len(self.columns))
        for at, number in zip(self.of_load, numbers, strict=True):
            out[at] = number
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
        ModelError: No joint has dry friction, or a ball has some about its axes besides load friction.
    """
    dry = [isinstance(x, OnJoints) and isinstance(x.effect, DryFriction) for x in on.joints]
    laws = tuple(x for x, is_dry in zip(on.joints, dry, strict=True) if is_dry and isinstance(x, OnJoints))
    rubs = [_rubs(x) for x in laws]
    loaded = () if on.loaded is None else on.loaded.joints
    rubbing = {column for x, some in zip(laws, rubs, strict=True) for column in x.columns[some].tolist()}
    freedoms = {name: range(robot.nv)[robot.v_slices[robot.joint_index[name]]] for name in robot.joints}
    for name in loaded:
        if len(freedoms[name]) > 1 and rubbing.intersection(freedoms[name]):
            raise ModelError(
                f"stiction: friction of ball joint '{name}' about its axes and {LoadFriction.name}, which is "
                "one vector, cannot stick together: give the joint one of them, or leave stiction out",
                element=name,
            )
    own = {name: [at for at in freedoms[name] if name in loaded or at in rubbing] for name in robot.joints}
    joints = tuple(name for name, found in own.items() if found)
    if not joints:
        raise ModelError(
            "stiction: no joint has dry friction: name coulomb_friction, stribeck_friction, "
            "directed_friction or load_friction among the effects, or leave stiction out"
        )
    every = np.array(sorted(at for found in own.values() for at in found))
    others = tuple(x for x, is_dry in zip(on.joints, dry, strict=True) if not is_dry)
    besides = replace(on, joints=others, loaded=None)
    dry_laws = tuple(
        DryLaw(x.effect, [n[some] for n in x.p], np.searchsorted(every, x.columns[some]))
        for x, some in zip(laws, rubs, strict=True)
        if isinstance(x.effect, DryFriction)
    )
    of_load = tuple(np.searchsorted(every, own[name]) for name in loaded)
    balls = tuple(np.searchsorted(every, own[name]) for name in joints if len(freedoms[name]) > 1)
    return OnSticking(joints, every, dry_laws, on.loaded, of_load, balls, besides)
