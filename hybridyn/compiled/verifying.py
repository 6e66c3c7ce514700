"""Verify a newly built model against the general path before it is used."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from ..dynamics.direct import ddm
from ..dynamics.inverse import idm
from ..effects.choice import Effects
from ..errors import CompileError, HybridynError
from ..manifold.manifold import Manifold
from ..spatial import Array, Mask
from ..structure.robot import HybridRobot
from .code.scalars import GUARD_LIMIT
from .failures import BUG, check_agreement, difference
from .library.calls import Numbers
from .programs.general import body_rows

log = logging.getLogger("hybridyn.compiled")

#: Largest allowed difference from the general path, relative to the largest entry of each sample's result.
#: In single precision it is the rounding, 6e-8, amplified by conditioning.
MODEL_AGREES = {"float64": 1e-10, "float32": 1e-2}

#: Allowed difference between two orders of elimination, in multiples of the general path's rounding error, or
#: of what rounding in the file leaves open in redundant loops.
ROUNDINGS = 100

#: Number of random roundings that are tried: in two, terms may round alike, and their difference stays.
DRAWS = 8

#: Largest difference that rounding may explain. Where rounding does more, samples must not be trusted at all.
EXCUSED = 1e-6

#: Number of random states of the comparison that the models must have computed themselves.
SAMPLES = 12

#: Largest number of draws of `SAMPLES` states.
ROUNDS = 8

#: Displacement (rad, module lengths) from closed postures at which the check of Newton's steps begins.
AWAY = 1e-3

#: Number of Newton steps of that check; fewer suffice from `AWAY`.
NEWTON_STEPS = 8


class Built(Protocol):
    """Interface to a robot's programs."""

    dtype: Any
    programs: Any

    def batch(self, name: str, *inputs: Array) -> tuple[tuple[Numbers, ...], Numbers]:
        """Compute outputs, shapes (T, n), and guards, shape (T,)."""


def verify(
    library: Built,
    robot: HybridRobot,
    effects: Effects,
    *,
    required: bool = True,
    design: Array | None = None,
) -> None:
    """Compare models with the general path on random states that the models compute themselves.

    Args:
        effects: Effects in the models.
        required: Whether a model must compute some of the states itself.
        design: The robot's numbers in the input "parameters" of the models, shape (slots,), if they have it.

    Raises:
        CompileError: They differ by more than `MODEL_AGREES`, or no model computes any of the states itself.
    """
    without = replace(effects, limits=None)  # limits act outside the models
    comparison = _Comparison(library, robot, without, design)
    for seed in range(ROUNDS):
        comparison.draw(seed)
        if min(comparison.computed.values()) >= SAMPLES:
            break
    drawn = (seed + 1) * SAMPLES
    if not required:
        return
    nowhere = [name for name, count in comparison.computed.items() if not count]
    if len(nowhere) == len(comparison.computed):
        raise _trusted_nowhere(robot, drawn, comparison.reason)
    for name in nowhere:
        log.warning(
            "robot '%s': the compiled '%s' hands every one of %d random states to the general path%s",
            robot.description.name, name, drawn, comparison.reason or _reason(robot),
        )  # fmt: skip


def warn_of_handed_over(library: Built, robot: HybridRobot, effects: Effects) -> None:
    """Log a warning for each new model that hands most of `SAMPLES` random states to the general path.

    The accelerations are any that keep the loops closed, as tables have them. States that the general path
    refuses, for example since no motor drives a motion, do not count.
    """
    from .equations.states import any_accelerations, moving_states

    if robot.base == "moving":
        return
    q, v, tau = moving_states(robot, SAMPLES)
    a = any_accelerations(robot, q, v)
    for name, model, last in (("idm", idm, a), ("ddm", ddm, tau)):
        if name not in library.programs:
            continue
        doubtful = np.flatnonzero(~(library.batch(name, q, v, last)[1] <= GUARD_LIMIT))
        if len(doubtful) <= SAMPLES // 2:
            continue
        good = 0
        for t in doubtful:
            with contextlib.suppress(HybridynError):
                model(robot, q[t], v[t], last[t], effects=replace(effects, limits=None))
                good += 1
        if good > SAMPLES // 2:
            log.warning(
                "robot '%s': the compiled '%s' hands %d of %d random states to the general path%s",
                robot.description.name, name, good, SAMPLES, _reason(robot),
            )  # fmt: skip


def check_trusted(guards: Callable[..., dict[str, Array]], robot: HybridRobot, effects: Effects) -> None:
    """Check that one of the models can be trusted at one random state at least.

    Args:
        guards: Function of q, v, a, tau, each of shape (T, n), that returns the guards of each model, (T,).
        effects: Effects in the models.

    Raises:
        CompileError: No model can be trusted at any of the states.
    """
    from .equations.states import moving_states

    reason = ""
    for seed in range(ROUNDS):
        q, v, tau = moving_states(robot, SAMPLES, seed)
        try:
            a = ddm(robot, q, v, tau, effects=replace(effects, limits=None))
        except HybridynError as error:
            reason, a = f", which refuses them ({error})", np.zeros_like(v)
        if any((guard <= GUARD_LIMIT).any() for guard in guards(q, v, a, tau).values()):
            return
    raise _trusted_nowhere(robot, ROUNDS * SAMPLES, reason)


def _trusted_nowhere(robot: HybridRobot, drawn: int, reason: str) -> CompileError:
    """Return the error of models that compute none of the random states themselves."""
    return CompileError(
        f"the compiled models of the robot '{robot.description.name}' would hand every one of {drawn} "
        f"random states to the general path{reason or _reason(robot)}: they are not used"
    )


def _reason(robot: HybridRobot) -> str:
    """Return why no sample can be trusted if the robot itself is the reason, else an empty text."""
    from .equations.core import is_coarse

    for module in robot.modules:
        if is_coarse(module.mechanism):
            dropped = module.mechanism.reduction.report.dropped
            return (
                f" (the redundant loops of module '{module.name}' agree with each other to {dropped:.1g} "
                "only, because its file is rounded: the solution depends on the order of elimination)"
            )
    return ""


class _Comparison:
    """Draw random states and compare both paths on them.

    Attributes:
        computed: Number of samples that each model has computed so far.
        reason: Why the general path refused states, empty if it refused none.
    """

    def __init__(self, library: Built, robot: HybridRobot, effects: Effects, design: Array | None) -> None:
        self._library, self._robot = library, robot
        self._more = [] if design is None else [np.tile(design, (SAMPLES, 1))]
        loops = [module.mechanism for module in robot.modules if module.mechanism.reduction.rounded]
        rounding = max((m.rounding for m in loops), default=0.0)
        self._agree = max(MODEL_AGREES[str(library.dtype)], ROUNDINGS * rounding)
        models = {"ddm": partial(ddm, effects=effects), "idm": partial(idm, effects=effects)}
        self._general: dict[str, Callable[..., Array]] = {**models, "kinematics": body_rows}
        self.computed, self.reason = {x: 0 for x in ("ddm", "idm") if x in library.programs}, ""
        self._lifted = "lift" not in library.programs

    def draw(self, seed: int) -> None:
        """Compare the models, and Newton's steps, on `SAMPLES` more states.

        Accelerations are those of the direct model; of the states that it computes itself alone, if the
        general path refuses some. Where the effects leave a motion without inertia, any that keep the loops
        closed will do: those under the default effects.

        Raises:
            CompileError: The models differ.
        """
        from .equations.states import moving_states

        robot = self._robot
        q, v, tau = moving_states(robot, SAMPLES, seed)
        still = [np.zeros((SAMPLES, 6))] if robot.base == "moving" else []
        good = self._compare("ddm", (q, v, tau), still)
        try:
            a = self._general["ddm"](robot, q, v, tau)
        except HybridynError as error:  # correct, as long as it refuses none of the good samples
            self.reason = f", which refuses them ({error})"
            try:
                model = self._general["ddm"] if good.any() else ddm
                q, v, tau = (x[good] if good.any() else x for x in (q, v, tau))
                a = model(robot, q, v, tau)
            except HybridynError:
                return
        self._compare("kinematics", (q, v, a))
        if not self._lifted:
            self._lifted = _lift(self._library, robot, q, v, self._agree)
        self._compare("idm", (q, v, a))

    def _compare(self, name: str, given: tuple[Array, ...], still: Sequence[Array] = ()) -> Mask:
        """Compare a model on the samples that it computes itself, and return which these are.

        No difference may exceed both `MODEL_AGREES` and `ROUNDINGS` of the general path's own.

        Args:
            still: Further arguments of the compiled model, zero in the general path.
        """
        if name not in self._library.programs:
            return np.zeros(len(given[0]), dtype=bool)
        more = [x[: len(given[0])] for x in (*still, *self._more)]
        (result,), guard = self._library.batch(name, *given, *more)
        good: Mask = np.asarray(guard <= GUARD_LIMIT)
        given = tuple(x[good] for x in given)
        if not len(given[0]):
            return good
        try:
            wanted = self._general[name](self._robot, *given)
        except HybridynError as error:
            raise CompileError(
                f"the compiled '{name}' of the robot '{self._robot.description.name}' computes a state that "
                f"the general path refuses ({error}): {BUG}"
            ) from error
        if name in self.computed:
            self.computed[name] += len(wanted)
        off, allowed = difference(result[good], wanted), self._agree
        if not (off <= allowed).all():
            rounding = np.minimum(ROUNDINGS * self._rounding(name, given, wanted), EXCUSED)
            check_agreement(self._robot, f"'{name}'", off, np.maximum(allowed, rounding))
        return good

    def _rounding(self, name: str, given: tuple[Array, ...], wanted: Array) -> Array:
        """Compute the relative change of the general path's results by rounding, shape (T,).

        The inputs and the masses of the links are rounded, each its own way. The change exceeds
        `MODEL_AGREES` where terms cancel (long stacks at random states) or where the inertia nearly vanishes
        along a motion. No arithmetic of this width can do better there.
        """
        rng, worst = np.random.default_rng(0), np.zeros(len(wanted))
        masses = {f"mass:{link.name}": link.mass for link in self._robot.description.links if link.mass}
        for _ in range(DRAWS):
            rounded = [x * (1 + 2.0**-52 * rng.uniform(-1.0, 1.0, x.shape)) for x in given]
            robot = self._robot.with_parameters(
                {mass: value * (1 + 2.0**-52 * rng.uniform(-1.0, 1.0)) for mass, value in masses.items()}
            )
            worst = np.maximum(worst, difference(self._general[name](robot, *rounded), wanted))
        return worst


def _lift(library: Built, robot: HybridRobot, q: Array, v: Array, agree: float) -> bool:
    """Check that Newton's steps close slightly open loops, and that the rates keep them closed.

    Returns:
        Whether the steps converged at some sample, or nothing moves.
    """
    if not robot.nv:
        return True
    manifold = Manifold(robot)
    xi = AWAY * manifold.unit * np.random.default_rng(0).choice([-1.0, 1.0], size=v.shape)
    for _ in range(NEWTON_STEPS):
        before = xi
        (moved, xi, rates, pulled, _, step, *_), _ = library.batch("lift", q, before, v)
    pull, opening = manifold.retraction.pull, manifold.opening
    off = [
        max(
            manifold.residual(moved[t])[0],
            opening(moved[t], rates[t])[0],
            float(np.abs(manifold.retraction.move(q[t], xi[t]) - moved[t]).max()),
            float(np.abs(pull(before[t], rates[t]) - pulled[t]).max() / np.abs(rates[t]).max()),
        )
        for t in np.flatnonzero(step.max(axis=1) <= agree)
    ]
    if off and not max(off) <= agree:
        raise CompileError(
            f"the compiled Newton step of the robot '{robot.description.name}' does not close the loops "
            f"(off by {max(off):.2g}, limit {agree:g}): {BUG}"
        )
    return bool(off)
