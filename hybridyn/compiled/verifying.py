"""Verify a newly built model against the general path before it is used."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from ..dynamics.backward import unbalanced
from ..effects.choice import Effects
from ..errors import HybridynError
from ..manifold.manifold import Manifold
from ..spatial import Array, Mask
from ..structure.mechanism import Mechanism
from ..structure.robot import HybridRobot
from .comparing import SAMPLES, States, compare_at_states, random_states, trusted_nowhere
from .programs.general import general
from .reasons import reason
from .rounding import ROUNDINGS, changes_by_rounding, rounded

#: Largest allowed difference from the general path, relative to the largest entry of each sample's result.
#: In single precision it is the rounding, 6e-8, amplified by conditioning.
MODEL_AGREES = {"float64": 1e-10, "float32": 1e-2}

#: Largest difference that rounding may explain, except where the result solves the equations of motion to
#: rounding: an inertia that nearly vanishes along a motion (a rod's about its line) lets rounding do more, to
#: any path.
EXCUSED = 1e-6

#: Largest force that a result of the direct model may leave along a motion, as a part of the largest term.
BALANCED = 1e-12

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
    told: bool | None = None,
    design: Array | None = None,
) -> None:
    """Compare models with the general path on random states that the models compute themselves.

    Args:
        library: A `Library`, or what calls programs like one, as `whole_robot.Interpreted`.
        effects: Effects in the models.
        required: Whether a model must compute some of the states itself.
        told: Whether to log where the general path has to compute most states; None as `required`.
        design: The robot's numbers in the input "parameters" of the models, shape (slots,), if they have it.

    Raises:
        CompileError: They differ by more than `MODEL_AGREES`, or no model computes any of the states itself.
    """
    on = effects.without("limits")  # they act outside the models
    loops = [module.mechanism for module in robot.modules if module.mechanism.reduction.rounded]
    rounding = max((m.rounding for m in loops), default=0.0)
    exact = MODEL_AGREES[str(library.dtype)]
    agree = max(exact, ROUNDINGS * max(map(_second_order, loops), default=0.0))
    states, computed = cache(partial(movable_states, robot, on)), dict[str, int]()

    def run(name: str, *drawn: Array) -> Any:
        """Run a model at states."""
        slots = [] if design is None else [np.tile(design, (len(drawn[0]), 1))]
        return library.batch(name, *_given(robot, name, *drawn).values(), *slots)

    for name in ("ddm", "kinematics", "idm"):
        if name in library.programs:
            computed[name] = compare_at_states(
                robot, f"'{name}'", partial(run, name), partial(_general, robot, on, name), agree,
                states=states, excused=partial(_rounding, robot, on, name),
                told=required if told is None else told,
                why=partial(reason, robot, on),
            )  # fmt: skip
    if "lift" in library.programs and robot.nv:
        closed = max(exact, ROUNDINGS * rounding)  # the steps close the rows with pivots
        steps = partial(_lift, library, Manifold(robot), closed)
        compare_at_states(robot, "'lift'", steps, _closed, closed, states=states, told=False)
    models = [computed[name] for name in ("ddm", "idm") if name in computed]
    if required and models and not any(models):
        raise trusted_nowhere(robot, "models", reason(robot, on))


def _second_order(m: Mechanism) -> float:
    """Return what balancing rows of a rounded file leaves open: its square through their condition."""
    return float(m.rounding * min(1.0, m.rounding / m.reduction.report.kept**2))


def movable_states(robot: HybridRobot, effects: Effects, seed: int) -> States:
    """Draw `random_states`; every other a is the direct model's where motors do not drive every freedom."""
    states = random_states(robot, seed)
    if any(module.mobility > len(module.moving_motors) for module in robot.modules):
        for t in range(0, SAMPLES, 2):
            with contextlib.suppress(HybridynError):
                states[3][t] = _general(robot, effects, "ddm", *(x[t : t + 1] for x in states))[0]
    return states


def _given(robot: HybridRobot, name: str, q: Array, v: Array, tau: Array, a: Array) -> dict[str, Array]:
    """Return the arguments of a model at states."""
    if name != "ddm":
        return {"q": q, "v": v, "a": a}
    moving = {"base_acceleration": a[:, :6]} if robot.base == "moving" else {}
    return {"q": q, "v": v, "tau": tau, **moving}


def _general(robot: HybridRobot, effects: Effects, name: str, *states: Array) -> list[Array]:
    """Compute a model at states by the general path."""
    return [general(robot, effects, name, _given(robot, name, *states))]


def _rounding(
    robot: HybridRobot,
    effects: Effects,
    name: str,
    states: States,
    found: Sequence[Array],
    wanted: Sequence[Array],
) -> Array:
    """Compute what rounding explains of the difference from the general path's result, shape (1, T).

    The states and the masses of the links are rounded, each its own way. The change exceeds `MODEL_AGREES`
    where terms cancel (long stacks at random states) or where the inertia nearly vanishes along a motion. No
    arithmetic of this width can do better there.
    """
    masses = {f"mass:{link.name}": link.mass for link in robot.description.links if link.mass}

    def draw(random: np.random.Generator) -> list[Array]:
        """Compute the model of a rounded robot at rounded states."""
        own = [rounded(x, random) for x in states]
        like = robot.with_parameters({mass: rounded(value, random) for mass, value in masses.items()})
        return _general(like, effects, name, *own)

    sound = name == "ddm" and _sound(robot, effects, states, found[0])
    changes = changes_by_rounding(draw, wanted)
    return np.asarray(np.minimum(changes, np.where(sound, np.inf, EXCUSED)))


def _sound(robot: HybridRobot, effects: Effects, states: States, found: Array) -> Mask:
    """Return at which states accelerations solve the equations of motion to rounding, shape (T,)."""
    q, v, tau, a = states
    found = found.copy()
    if robot.base == "moving":
        found[:, :6] = a[:, :6]
    return np.asarray(unbalanced(robot, effects, q, v, found, tau) <= BALANCED)


def _lift(
    library: Any, manifold: Manifold, agree: float, q: Array, v: Array, *_: Array
) -> tuple[list[Array], Array]:
    """Take Newton's steps from slightly open loops.

    Returns:
        How far the loops and their rates are open at the end, and how far the steps are from the general
        path's, shape (T, 4); and guards, which are infinite where the steps did not converge.
    """
    xi = AWAY * manifold.unit * np.random.default_rng(0).choice([-1.0, 1.0], size=v.shape)
    for _step in range(NEWTON_STEPS):
        before = xi
        (moved, xi, rates, pulled, _, step, *_), _ = library.batch("lift", q, before, v)
    pull, opening = manifold.retraction.pull, manifold.opening
    off = [
        (
            manifold.residual(moved[t])[0],
            opening(moved[t], rates[t])[0],
            np.abs(manifold.retraction.move(q[t], xi[t]) - moved[t]).max(),
            np.abs(pull(before[t], rates[t]) - pulled[t]).max() / (np.abs(rates[t]).max() or 1.0),
        )
        for t in range(len(q))
    ]
    return [np.array(off)], np.where(step.max(axis=1) <= agree, 0.0, np.inf)


def _closed(q: Array, *_: Array) -> list[Array]:
    """Return the zeros that `_lift` should return."""
    return [np.zeros((len(q), 4))]
