"""The law of motion: efforts, wrenches, a prescribed base, and the direct model's accelerations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..assembly.task import closure_residual
from ..compiled import Law
from ..dynamics.direct import states_before, with_load_friction
from ..dynamics.direct_recursion import accelerate, articulate
from ..dynamics.loads import all_loads
from ..effects.choice import Choice, choose
from ..effects.dry_friction import on_sticking
from ..errors import HybridynError, ModelError, TrajectoryError
from ..spatial import LARGEST, Array
from ..structure.robot import HybridRobot

if TYPE_CHECKING:
    from ..compiled import CompiledRobot, Steps
    from ..dynamics.stiction import Free

Effort = Callable[[float, Array, Array], Array]
Wrenches = Callable[[float, Array, Array], Mapping[str, Array]]

#: Effects that store energy without dissipating any, besides inertia and velocity.
CONSERVATIVE = {"gravity", "leg_inertia", "rotor_inertia", "spring"}


class StepError(HybridynError):
    """The equations of a step could not be solved; a shorter step may succeed."""


class MotionLaw:
    """Accelerations of a robot as a function of time and state.

    Attributes:
        on: The effects that are computed.
        evaluations: Number of states at which the direct model was evaluated so far.
        sticking: The joints that can stick, None without stiction.
        signs: Directions in which these slide, 0 of those that stick, while states do not say so.
    """

    def __init__(
        self,
        robot: HybridRobot,
        effort: Effort | Array | None = None,
        wrenches: Wrenches | Mapping[str, Array] | None = None,
        effects: Choice = None,
        compiled: CompiledRobot | None = None,
        *,
        stiction: bool = False,
    ) -> None:
        """Collect efforts, wrenches and effects; see `simulate` for the arguments.

        Raises:
            ModelError: Effects that are unknown, lack numbers or contradict each other; no inertia; no joint
                that can stick; compiled models of another robot or of other effects, or together with
                wrenches or stiction.
            TrajectoryError: Efforts of the wrong shape; a base motion that is missing, or given for a base
                that does not move.
        """
        self.robot, self.evaluations = robot, 0
        self.on = choose(robot, effects)
        if self.on.inertia is None:
            raise ModelError("nothing moves without the effect 'inertia'", element="inertia")
        self._wrenches, self._compiled = wrenches, compiled
        self.sticking = on_sticking(self.on, robot) if stiction else None
        self.signs = np.zeros(0 if self.sticking is None else len(self.sticking.columns))
        if compiled is not None:
            self._check_compiled(compiled)
        if (self.on.base is not None) != (robot.base == "moving"):
            raise TrajectoryError(
                f"the base of '{robot.name}' is '{robot.base}': a base that is 'moving' needs the effect "
                "'base_motion' (`hybridyn.effects.BaseMotion`), another must not have it"
            )
        self._law = effort if callable(effort) else None
        self._effort = _constant(robot, None if callable(effort) else effort)

    def _check_compiled(self, compiled: CompiledRobot) -> None:
        """Check that compiled models are of this robot and these effects, and that there are no wrenches."""
        if compiled.robot is not self.robot:
            raise ModelError(f"compiled: these models are of another robot object, '{compiled.robot.name}'")
        if compiled.effects.names != self.on.names:
            raise ModelError("compiled: these models were compiled with other effects")
        if self.sticking is not None:
            raise ModelError("compiled: compiled models have no stiction; simulate without compiled=")
        if self._wrenches is not None:
            raise ModelError("compiled: compiled models take no wrenches; simulate without compiled=")

    @property
    def conserves(self) -> bool:
        """Whether no effect, effort or wrench can change the energy."""
        names = set(self.on.names)
        quiet = names - CONSERVATIVE == {"inertia", "velocity"} and self.robot.base != "moving"
        return quiet and self._law is None and not self._effort.any() and not self._wrenches

    @property
    def steps(self) -> Steps | None:
        """The compiled steps in time, or None where there are none."""
        return None if self._compiled is None else self._compiled.steps

    @cached_property
    def in_c(self) -> Law | None:
        """The motor efforts within their limits for steps in C; None where there are none."""
        if self.steps is None or self._compiled is None:
            return None
        if self._law is None:
            law = Law.constant(self._effort)
        else:
            in_c = getattr(self._law, "in_c", None)  # as those of `scenes.controllers` have
            made = in_c(self._compiled) if in_c else None
            robot = self.robot
            law = made or Law.function(self._law, (robot.nq, robot.nv, len(robot.motors)))
        limits = self.on.limits
        return law if limits is None else law.bounded(limits.bounds(self.robot))

    @contextmanager
    def counted_as_general(self) -> Iterator[None]:
        """Count each state that is evaluated inside as one that the general path computes."""
        compiled, before = self._compiled, self.evaluations
        earlier = 0 if compiled is None else compiled.recomputed
        try:
            yield
        finally:
            if compiled is not None:
                left = earlier + self.evaluations - before - compiled.recomputed
                compiled.hand_over("simulate", left)

    def closure_residual(self, q: Array) -> Array:
        """Compute the worst relative closure residual of assembled postures, shapes (T, nq) and (T,)."""
        quick = None if self._compiled is None else self._compiled.closure_residual(q)
        return np.asarray(closure_residual(self.robot, q)) if quick is None else quick

    def effort(self, t: float, q: Array, v: Array) -> Array:
        """Return the motor efforts, shape (motors,).

        Raises:
            TrajectoryError: The user's callable returned the wrong shape, or numbers that are not finite.
        """
        if self._law is None:
            return self._effort
        tau = np.asarray(self._law(t, q, v), dtype=float)
        if tau.shape != self._effort.shape or not np.isfinite(tau).all():
            raise TrajectoryError(
                f"effort(t, q, v) returned {tau} at t = {t:g} s; expected {len(self._effort)} finite numbers"
            )
        return tau

    def place_base(self, t: float, q: Array, v: Array) -> Array:
        """Write a prescribed base's pose and twist into q and v; return its acceleration, shape (6,)."""
        if self.on.base is None:
            return np.zeros(6)
        q[:7], v[:6], acceleration = (x[0] for x in self.on.base.at(np.array([t])))
        return np.asarray(acceleration)

    def acceleration(self, t: float, q: Array, v: Array) -> Array:
        """Compute the accelerations at one state, shape (nv,), after placing a prescribed base in q and v."""
        return np.asarray(self.accelerations(np.array([t]), q[None], v[None])[0])

    def accelerations(self, t: Array, q: Array, v: Array) -> Array:
        """Compute the accelerations at many closed states, shapes (T,), (T, nq), (T, nv).

        A prescribed base is first placed in q and v. The recursions are those of `ddm`, without its checks.

        Raises:
            SingularityError: A force acts on a motion without inertia, or closures lose rank.
            ActuationError: A gear locks itself, or friction that grows with load may jam joints.
            StepError: They are not finite, or so large that their squares overflow.
        """
        a = self.driven(t, q, v)[0]
        far = np.flatnonzero(~(np.abs(a.astype(float)) <= LARGEST).all(axis=1))
        if len(far):
            raise StepError(f"at t = {t[far[0]]:g} s the accelerations exceed {LARGEST:.0e}")
        return a

    def driven(self, t: Array, q: Array, v: Array, signs: Array | None = None) -> tuple[Array, Array]:
        """Compute what `accelerations` does, and the efforts within their limits, shape (T, motors).

        Args:
            signs: Directions of joints with stiction, shape (T, k); those of this law by default.
        """
        base = np.array([self.place_base(*s) for s in zip(t, q, v, strict=True)])
        tau, fell_back = self._efforts(t, q, v)
        self.evaluations += len(t)
        if self._compiled is not None:
            quick = self._compiled.accelerations(q, v, tau, base)
            if quick is not None:
                self._compiled.hand_over("simulate", len(t) if fell_back else 0)
                return quick, tau
        on, dry = self.on, self.sticking
        if dry is not None:
            each = np.broadcast_to(self.signs if signs is None else signs, (len(t), len(dry.columns)))
            if dry.loaded is not None or dry.at_rest(each).any():
                from ..dynamics.stiction import friction_of  # which most runs need not

                rows = zip(self._free(t, q, v, base, tau), each, strict=True)
                return np.array([one.accelerations(friction_of(one, s).efforts) for one, s in rows]), tau
            on = dry.besides
        loads = all_loads(self.robot, on, q, v, t, self._gather(t, q, v))
        if dry is not None:
            loads.joints[:, dry.columns] += dry.sliding(v, each)
        a = np.zeros_like(v)
        if self.robot.base == "moving":
            a[:, :6] = base
        joint_side = tau if self.on.gears is None else self.on.gears.behind(self.robot, tau, v)
        states = states_before(self.robot, self.on, q, v, a)
        loads = with_load_friction(self.robot, states, q, v, a, joint_side, loads, passing=True)
        accelerate(self.robot, articulate(self.robot, states, loads, joint_side, None, passing=True), v, a)
        return a, tau

    def free(self, t: float, q: Array, v: Array) -> Free:
        """Compute one state without dry friction, and how it answers to that, after placing a base."""
        time, q, v = np.array([t]), q[None].copy(), v[None].copy()
        base = self.place_base(t, q[0], v[0])
        self.evaluations += 1
        return next(self._free(time, q, v, base[None], self._efforts(time, q, v)[0]))

    def _free(self, t: Array, q: Array, v: Array, base: Array, tau: Array) -> Iterator[Free]:
        """Yield each state without dry friction."""
        from ..dynamics.stiction import free_of_friction  # which most runs need not

        assert self.sticking is not None
        on, joint_side = self.sticking.besides, tau
        if on.gears is not None:
            joint_side = on.gears.behind(self.robot, tau, v)
        for k in range(len(t)):
            one = slice(k, k + 1)
            loads = all_loads(self.robot, on, q[one], v[one], t[one], self._gather(t[one], q[one], v[one]))
            yield free_of_friction(
                self.robot, self.sticking, q[one], v[one], base[k], joint_side[one], loads
            )  # fmt: skip

    def _efforts(self, t: Array, q: Array, v: Array) -> tuple[Array, bool]:
        """Compute the motor efforts within their limits, (T, motors), and whether C left them to Python."""
        steps = None if self.in_c is None or self.in_c.calls else self.steps
        if steps is not None and self.in_c is not None:
            quick = steps.efforts(self.in_c, t, q, v)
            if quick is not None:
                return quick, False
        tau = np.array([self.effort(*s) for s in zip(t, q, v, strict=True)]).reshape(len(t), -1)
        return self.on.within_bounds(self.robot, tau, v), steps is not None

    def _gather(self, t: Array, q: Array, v: Array) -> Mapping[str, Array] | None:
        """Return the wrenches of a batch by link, shape (T, 6) or (6,) each."""
        if not callable(self._wrenches):
            return self._wrenches
        each = [self._wrenches(*s) for s in zip(t, q, v, strict=True)]
        links = sorted({link for one in each for link in one})
        return {link: np.array([one.get(link, np.zeros(6)) for one in each]) for link in links}


def _constant(robot: HybridRobot, effort: Array | None) -> Array:
    """Return efforts that stay as they are, shape (motors,); none by default."""
    if effort is None:
        return np.zeros(len(robot.motors))
    out = np.asarray(effort, dtype=float)
    if out.shape != (len(robot.motors),) or not np.isfinite(out).all():
        raise TrajectoryError(
            f"effort must be {len(robot.motors)} finite numbers, or a callable of (t, q, v)"
        )
    return out
