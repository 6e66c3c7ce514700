"""A built model against the general path, before anybody gets it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ..dynamics.direct import ddm
from ..dynamics.inverse import idm
from ..effects.choice import Effects
from ..errors import CompileError, HybridynError
from ..manifold.manifold import Manifold
from ..spatial import Array
from ..structure.robot import HybridRobot
from .code.scalars import GUARD_LIMIT
from .library.calls import Numbers
from .programs.body_rows import body_rows

log = logging.getLogger("hybridyn.compiled")

#: Largest difference from the general path, relative to the largest entry of each sample's result; for floats
#: their rounding, 6e-8, times what conditioning makes of it.
MODEL_AGREES = {"float64": 1e-10, "float32": 1e-2}

#: Roundings that two ways of elimination may lie apart.
ROUNDINGS = 100

#: More than this no rounding excuses: where it does that much, samples are not to be trusted.
EXCUSED = 1e-6

#: Random states on which both are compared: as many must have been computed by the models themselves.
SAMPLES = 12

#: How many times as many states are drawn, at most, until there are enough.
ROUNDS = 8

#: By how much (rad, module lengths) postures are left before Newton's steps are looked at.
AWAY = 1e-3

#: More than Newton needs from there.
NEWTON_STEPS = 8

BUG = "it is not used. This is a bug: report it with the robot's files; the general path is right"


class Built(Protocol):
    """What computes a robot's programs."""

    dtype: Any
    programs: Any

    def batch(self, name: str, *inputs: Array) -> tuple[tuple[Numbers, ...], Numbers]:
        """Return outputs, shapes (T, n), and guards, shape (T,)."""


def verify(library: Built, robot: HybridRobot, effects: Effects) -> None:
    """Compare models with the general path on random states that the models compute themselves.

    Args:
        library: The models.
        robot: The robot.
        effects: What they compute.

    Raises:
        CompileError: They differ by more than `MODEL_AGREES`, or trust themselves nowhere.
    """
    comparison = _Comparison(library, robot, replace(effects, limits=None))  # which act outside the models
    for seed in range(ROUNDS):
        comparison.draw(seed)
        if min(comparison.computed.values()) >= SAMPLES:
            break
    drawn = (seed + 1) * SAMPLES
    nowhere = [name for name, count in comparison.computed.items() if not count]
    if len(nowhere) == len(comparison.computed):
        raise CompileError(
            f"the written-out models of the robot '{robot.description.name}' would hand every one of {drawn} "
            f"random states to the general path{comparison.reason or _reason(robot)}: they are not used"
        )
    for name in nowhere:
        log.warning(
            "robot '%s': the written-out '%s' hands every one of %d random states to the general path%s",
            robot.description.name, name, drawn, _reason(robot),
        )  # fmt: skip


def _reason(robot: HybridRobot) -> str:
    """Say why no sample may be trusted, where the robot as such is the reason."""
    for module in robot.modules:
        if module.mechanism.reduction.rounded:
            dropped = module.mechanism.reduction.report.dropped
            return (
                f" (loops of module '{module.name}' agree with each other to {dropped:.1g} only, rounding of "
                "the file: what follows from them depends on the order of elimination)"
            )
    return ""


class _Comparison:
    """Draws states and compares.

    Attributes:
        computed: How many samples each model computed so far.
        reason: Why the general path refuses states, where it does.
    """

    def __init__(self, library: Built, robot: HybridRobot, effects: Effects) -> None:
        self._library, self._robot, self._effects = library, robot, effects
        self._agree = MODEL_AGREES[str(library.dtype)]
        self.computed, self.reason = {"ddm": 0, "idm": 0}, ""
        self._lifted = "lift" not in library.programs

    def draw(self, seed: int) -> None:
        """Compare both models on `SAMPLES` more states.

        Raises:
            CompileError: They differ.
        """
        from .equations.states import moving_states

        robot = self._robot
        q, v, tau = moving_states(robot, SAMPLES, seed)
        still = [np.zeros((SAMPLES, 6))] if robot.base == "moving" else []
        (a,), guard = self._library.batch("ddm", q, v, tau, *still)
        good = guard <= GUARD_LIMIT
        try:
            wanted = ddm(robot, q, v, tau, effects=self._effects)
        except HybridynError as error:  # as it should, if none of the good samples is among those refused
            self.reason = f", which refuses them ({error})"
            q, v, tau, a, good = q[good], v[good], tau[good], a[good], good[good]
            if not len(q):
                return
            wanted = self._general(ddm, "ddm", q, v, tau)
        self._compare("ddm", ddm, (q[good], v[good], tau[good]), a[good], wanted[good])
        (rows,), guard = self._library.batch("kinematics", q, v, wanted)
        good = guard <= GUARD_LIMIT
        if good.any():
            given = (q[good], v[good], wanted[good])
            self._compare("kinematics", body_rows, given, rows[good], body_rows(robot, *given))
        if not self._lifted:
            self._lifted = _lift(self._library, robot, q, v, self._agree)
        self._inverse(q, v, wanted)

    def _inverse(self, q: Array, v: Array, a: Array) -> None:
        """Compare the inverse model on samples that it computes itself."""
        (tau,), guard = self._library.batch("idm", q, v, a)
        good = guard <= GUARD_LIMIT
        q, v, a, tau = q[good], v[good], a[good], tau[good]
        if len(q):
            self._compare("idm", idm, (q, v, a), tau, self._general(idm, "idm", q, v, a))

    def _general(self, model: Callable[..., Array], name: str, *given: Array) -> Array:
        """Return what the general path says of samples that the written-out model computes itself.

        Raises:
            CompileError: It refuses them.
        """
        try:
            return model(self._robot, *given, effects=self._effects)
        except HybridynError as error:
            raise CompileError(
                f"the written-out '{name}' of the robot '{self._robot.description.name}' computes what the "
                f"general path refuses ({error}): {BUG}"
            ) from error

    def _compare(
        self, name: str, model: Callable[..., Array], given: tuple[Array, ...], result: Numbers, wanted: Array
    ) -> None:
        """Refuse a difference above `MODEL_AGREES`, or above `ROUNDINGS` of the general path's own.

        Raises:
            CompileError: There is one.
        """
        if name in self.computed:
            self.computed[name] += len(wanted)
        off = difference(result, wanted)
        if (off <= self._agree).all():
            return
        rounding = np.minimum(ROUNDINGS * self._rounding(name, model, given, wanted), EXCUSED)
        allowed = np.maximum(self._agree, rounding)
        if not (off <= allowed).all():
            worst = int(np.argmax(np.where(np.isnan(off), np.inf, off / allowed)))
            raise CompileError(
                f"the written-out '{name}' of the robot '{self._robot.description.name}' differs from the "
                f"general path by {off[worst]:.2g} of its largest entry (limit {allowed[worst]:.2g}) at a "
                f"random state: {BUG}"
            )

    def _rounding(
        self, name: str, model: Callable[..., Array], given: tuple[Array, ...], wanted: Array
    ) -> Array:
        """Return what rounding its inputs does to the general path's own results, relative, shape (T,).

        Where terms cancel, as in a long stack thrown about at random, or inertia all but vanishes along some
        motion, that is more than `MODEL_AGREES`, and no arithmetic of this width can do better.
        """
        rng, worst = np.random.default_rng(0), np.zeros(len(wanted))
        for _ in range(3):
            signs = [rng.choice([-1.0, 1.0], size=x.shape) for x in given]
            rounded = [x * (1 + 2.0**-52 * sign) for x, sign in zip(given, signs, strict=True)]
            more = {} if name == "kinematics" else {"effects": self._effects}
            with_those = model(self._robot, *rounded, **more)
            worst = np.maximum(worst, difference(with_those, wanted))
        return worst


def _lift(library: Built, robot: HybridRobot, q: Array, v: Array, agree: float) -> bool:
    """See that Newton's steps close loops that are open by a little, and that the rates keep them closed.

    Returns:
        Whether they led back at some sample at all.

    Raises:
        CompileError: They do not close them.
    """
    manifold = Manifold(robot)
    xi = AWAY * manifold.unit * np.random.default_rng(0).choice([-1.0, 1.0], size=v.shape)
    for _ in range(NEWTON_STEPS):
        before = xi
        (moved, xi, rates, pulled, _, step, *_), _ = library.batch("lift", q, before, v)
    pull, opening = manifold.retraction.pull, manifold.opening
    off = [
        max(
            manifold.residual(moved[t]),
            opening(moved[t], rates[t])[0],
            float(np.abs(manifold.retraction.move(q[t], xi[t]) - moved[t]).max()),
            float(np.abs(pull(before[t], rates[t]) - pulled[t]).max() / np.abs(rates[t]).max()),
        )
        for t in np.flatnonzero(step.max(axis=1) <= agree)
    ]
    if off and not max(off) <= agree:
        raise CompileError(
            f"the written-out Newton step of the robot '{robot.description.name}' does not close the loops "
            f"(off by {max(off):.2g}, limit {agree:g}): {BUG}"
        )
    return bool(off)


def difference(result: Numbers, reference: Array) -> Array:
    """Return the difference of each sample, relative to its largest entry, shape (T,)."""
    scale = np.abs(reference).max(axis=1, initial=0.0)
    out: Array = np.abs(result - reference).max(axis=1, initial=0.0) / np.where(scale > 0, scale, 1.0)
    return out
