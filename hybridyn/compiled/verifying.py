"""A built model against the general path, before anybody gets it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..dynamics.direct import ddm
from ..dynamics.inverse import idm
from ..errors import CompileError, HybridynError
from ..manifold.manifold import Manifold
from ..spatial import Array
from .library.calls import Numbers
from .programs.body_rows import body_rows

if TYPE_CHECKING:
    from .model import CompiledRobot

#: Largest difference from the general path, relative to the largest entry of each sample's result; for floats
#: their rounding, 6e-8, times what conditioning makes of it.
AGREE = {"float64": 1e-10, "float32": 1e-2}

ROUNDINGS = 100
"""Roundings that two ways of elimination may lie apart."""

SAMPLES = 12
"""Random states on which both are compared."""

AWAY = 1e-3
"""By how much (rad, module lengths) postures are left before Newton's steps are looked at."""

NEWTON_STEPS = 8
"""More than Newton needs from there."""


def verify(model: CompiledRobot) -> None:
    """Compare a model with the general path on random states.

    Raises:
        CompileError: They differ by more than `AGREE`.
    """
    from .equations.states import random_states

    robot, effects = model.robot, model.effects
    q, v, _, tau = random_states(robot, SAMPLES)
    with_general = ddm(robot, q, v, tau, effects=effects)
    _compare(model, "ddm", model.ddm(q, v, tau), with_general)
    rows = model.library.batch("kinematics", q, v, with_general)[0][0]
    _compare(model, "kinematics", rows, body_rows(robot, q, v, with_general))
    if "lift" in model.library.programs:
        _lift(model, q, v)
    try:
        efforts = idm(robot, q, v, with_general, effects=effects)
    except HybridynError:  # motors that cannot do it: there is nothing to compare
        return
    _compare(
        model, "idm", model.idm(q, v, with_general), efforts, _rounding(model, q, v, with_general, efforts)
    )


def _lift(model: CompiledRobot, q: Array, v: Array) -> None:
    """See that Newton's steps close loops that are open by a little, and that the rates keep them closed.

    Raises:
        CompileError: They do not.
    """
    manifold = Manifold(model.robot)
    xi = AWAY * manifold.unit * np.random.default_rng(0).choice([-1.0, 1.0], size=v.shape)
    for _ in range(NEWTON_STEPS):
        before = xi
        (moved, xi, rates, pulled, _, step, *_), _ = model.library.batch("lift", q, before, v)
    pull, opening = manifold.retraction.pull, manifold.opening
    off = [
        max(
            manifold.residual(moved[t]),
            opening(moved[t], rates[t])[0],
            float(np.abs(manifold.retraction.move(q[t], xi[t]) - moved[t]).max()),
            float(np.abs(pull(before[t], rates[t]) - pulled[t]).max() / np.abs(rates[t]).max()),
        )
        for t in np.flatnonzero(step.max(axis=1) <= AGREE[str(model.dtype)])
    ]
    if not off or not max(off) <= AGREE[str(model.dtype)]:
        raise CompileError(
            f"the written-out Newton step does not close the loops (off by {max(off, default=np.inf):.2g}, "
            f"limit {AGREE[str(model.dtype)]:g}): it is not used. This is a bug: report it with the robot's "
            "files"
        )


def _rounding(model: CompiledRobot, q: Array, v: Array, a: Array, efforts: Array) -> float:
    """Return what rounding the accelerations does to the general path's own efforts, relative.

    In a long stack thrown about at random it is more than `AGREE`: terms cancel from module to module, and no
    arithmetic of this width can do better.
    """
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=a.shape)
    rounded = idm(model.robot, q, v, a * (1 + 2.0**-52 * signs), effects=model.effects)
    return float(difference(rounded, efforts).max(initial=0.0))


def difference(result: Numbers, reference: Array) -> Array:
    """Return the difference of each sample, relative to its largest entry, shape (T,)."""
    scale = np.abs(reference).max(axis=1, initial=0.0)
    out: Array = np.abs(result - reference).max(axis=1, initial=0.0) / np.where(scale > 0, scale, 1.0)
    return out


def _compare(
    model: CompiledRobot, name: str, result: Numbers, reference: Array, rounding: float = 0.0
) -> None:
    """Refuse a difference above `AGREE`, or above `ROUNDINGS` of the general path's own.

    Raises:
        CompileError: There is one.
    """
    off = difference(result, reference)
    allowed = max(AGREE[str(model.dtype)], ROUNDINGS * rounding)
    if not (off <= allowed).all():
        worst = int(np.argmax(np.where(np.isnan(off), np.inf, off)))
        raise CompileError(
            f"the written-out '{name}' differs from the general path by {off[worst]:.2g} of its largest "
            f"entry (limit {allowed:g}) at random state {worst}: it is not used. This is a bug: "
            "report it with the robot's files; the general path is right"
        )
