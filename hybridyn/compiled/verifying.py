"""Verify a newly built model against the general path before it is used."""

from __future__ import annotations

import contextlib
import logging
from typing import Any

import numpy as np

from ..effects.choice import Effects, choose
from ..errors import CompileError, HybridynError
from ..manifold.manifold import Manifold
from ..spatial import Array, Mask
from ..structure.robot import HybridRobot
from .code.scalars import GUARD_LIMIT
from .failures import BUG, check_agreement, difference
from .programs.general import general

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


def verify(
    library: Any,
    robot: HybridRobot,
    effects: Effects,
    *,
    required: bool = True,
    design: Array | None = None,
) -> None:
    """Compare models with the general path on random states that the models compute themselves.

    Args:
        library: A `Library`, or what calls programs like one, as `whole_robot.Interpreted`.
        effects: Effects in the models.
        required: Whether a model must compute some of the states itself.
        design: The robot's numbers in the input "parameters" of the models, shape (slots,), if they have it.

    Raises:
        CompileError: They differ by more than `MODEL_AGREES`, or no model computes any of the states itself.
    """
    comparison = _Comparison(library, robot, effects.without("limits"), design)  # they act outside the models
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


def warn_of_handed_over(library: Any, robot: HybridRobot, effects: Effects) -> None:
    """Log a warning for each new model that hands most of `SAMPLES` random states to the general path.

    The accelerations are any that keep the loops closed, as tables have them. States that the general path
    refuses, for example since no motor drives a motion, do not count.
    """
    from .equations.states import any_accelerations, moving_states

    if robot.base == "moving":
        return
    q, v, tau = moving_states(robot, SAMPLES)
    for name, last in (("idm", {"a": any_accelerations(robot, q, v)}), ("ddm", {"tau": tau})):
        if name not in library.programs:
            continue
        given, good = {"q": q, "v": v, **last}, 0
        for t in np.flatnonzero(~(library.batch(name, *given.values())[1] <= GUARD_LIMIT)):
            with contextlib.suppress(HybridynError):
                general(robot, effects.without("limits"), name, {key: x[t] for key, x in given.items()})
                good += 1
        if good > SAMPLES // 2:
            log.warning(
                "robot '%s': the compiled '%s' hands %d of %d random states to the general path%s",
                robot.description.name, name, good, SAMPLES, _reason(robot),
            )  # fmt: skip


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

    def __init__(self, library: Any, robot: HybridRobot, effects: Effects, design: Array | None) -> None:
        self._library, self._robot, self._effects = library, robot, effects
        self._design = [] if design is None else [np.tile(design, (SAMPLES, 1))]
        loops = [module.mechanism for module in robot.modules if module.mechanism.reduction.rounded]
        rounding = max((m.rounding for m in loops), default=0.0)
        self._agree = max(MODEL_AGREES[str(library.dtype)], ROUNDINGS * rounding)
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

        robot, effects = self._robot, self._effects
        state = dict(zip(("q", "v", "tau"), moving_states(robot, SAMPLES, seed), strict=True))
        if robot.base == "moving":
            state["base_acceleration"] = np.zeros((SAMPLES, 6))
        good = self._compare("ddm", state)
        try:
            a = general(robot, effects, "ddm", state)
        except HybridynError as error:  # correct, as long as it refuses none of the good samples
            self.reason = f", which refuses them ({error})"
            if good.any():
                state = {name: x[good] for name, x in state.items()}
            try:
                a = general(robot, effects if good.any() else choose(robot, None), "ddm", state)
            except HybridynError:
                return
        motion = {"q": state["q"], "v": state["v"], "a": a}
        self._compare("kinematics", motion)
        if not self._lifted:
            self._lifted = _lift(self._library, robot, motion["q"], motion["v"], self._agree)
        self._compare("idm", motion)

    def _compare(self, name: str, given: dict[str, Array]) -> Mask:
        """Compare a model on the samples that it computes itself, and return which these are.

        No difference may exceed both `MODEL_AGREES` and `ROUNDINGS` of the general path's own.
        """
        samples = len(given["q"])
        if name not in self._library.programs:
            return np.zeros(samples, dtype=bool)
        (result,), guard = self._library.batch(name, *given.values(), *(x[:samples] for x in self._design))
        good: Mask = np.asarray(guard <= GUARD_LIMIT)
        given = {key: x[good] for key, x in given.items()}
        if not good.any():
            return good
        try:
            wanted = general(self._robot, self._effects, name, given)
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

    def _rounding(self, name: str, given: dict[str, Array], wanted: Array) -> Array:
        """Compute the relative change of the general path's results by rounding, shape (T,).

        The inputs and the masses of the links are rounded, each its own way. The change exceeds
        `MODEL_AGREES` where terms cancel (long stacks at random states) or where the inertia nearly vanishes
        along a motion. No arithmetic of this width can do better there.
        """
        rng, worst = np.random.default_rng(0), np.zeros(len(wanted))
        masses = {f"mass:{link.name}": link.mass for link in self._robot.description.links if link.mass}
        for _ in range(DRAWS):
            rounded = {key: x * (1 + 2.0**-52 * rng.uniform(-1.0, 1.0, x.shape)) for key, x in given.items()}
            robot = self._robot.with_parameters(
                {mass: value * (1 + 2.0**-52 * rng.uniform(-1.0, 1.0)) for mass, value in masses.items()}
            )
            worst = np.maximum(worst, difference(general(robot, self._effects, name, rounded), wanted))
        return worst


def _lift(library: Any, robot: HybridRobot, q: Array, v: Array, agree: float) -> bool:
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
