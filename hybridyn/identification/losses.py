"""What motors need for losses that grow with load, given the numbers of the linear model.

Joints transmit wrenches w = w_0 + R (x - x_0) + B n, linear in the base parameters x and in the friction n of
every joint, so that

    n = N_c(w)    effort of joints = Y x + known + E n    of motors = effort + loss s |effort|

with the coefficients c of load friction, loss = 1 / efficiency - 1 of each gear, and s = tanh(v / width).
Unit loads on the resting robot give R, B and E once; then x, c and losses change without another model.

Wrenches depend on more numbers than efforts tell. Those that no effort tells keep what the file states.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..dynamics.actuation import Sharing
from ..dynamics.inverse import inverse_model, under_loads
from ..dynamics.link_motion import all_bodies
from ..dynamics.load_friction import check_determined, solve_friction, wrenches_of
from ..dynamics.loads import all_loads
from ..effects.choice import Choice, Effects, choose
from ..effects.gears import GearEfficiency, OnGears
from ..effects.listing import listed_units
from ..effects.load_friction import LoadFriction, OnLoads, coefficients
from ..errors import ModelError
from ..spatial import Array, rotate_back
from ..structure.robot import HybridRobot
from .inertial import wrench_matrix
from .parameters import OFFSETS
from .regressor import redundant
from .sought import Sought
from .standard import StandardParameters


@dataclass(frozen=True, eq=False)
class SoughtLosses:
    """Losses that are sought: those with a number among the effects, whatever the number above zero.

    Attributes:
        load: Load friction, or None.
        gears: Gears whose friction is the same both ways, or None.
    """

    load: OnLoads | None
    gears: OnGears | None

    def names(self, robot: HybridRobot) -> tuple[str, ...]:
        """Name of each coefficient, such as "radial of elbow" or "loss of drive"."""
        law, motors = self.load, () if self.gears is None else self.gears.motors
        each = () if law is None else zip(law.words, law.of_joint, strict=True)
        own = [f"{word} of {law.joints[at]}" for word, at in each if law is not None]
        return (*own, *(f"loss of {robot.motors[i]}" for i in motors))

    def as_effects(self, robot: HybridRobot, values: Array) -> tuple[LoadFriction | GearEfficiency, ...]:
        """Return the effects with other coefficients; negative ones count as zero."""
        values, out = np.maximum(values, 0.0), list[LoadFriction | GearEfficiency]()
        count = 0 if self.load is None else len(self.load.words)
        if self.load is not None:
            tables: dict[str, Any] = {word: {} for word in self.load.words}
            for word, at, value in zip(self.load.words, self.load.of_joint, values[:count], strict=True):
                tables[word][self.load.joints[at]] = float(value)
            out.append(replace(self.load.effect, **tables))
        if self.gears is not None:
            found = {
                robot.motors[i]: float(1 / (1 + x))
                for i, x in zip(self.gears.motors, values[count:], strict=True)
            }
            out.append(replace(self.gears.effect, efficiency=found))
        return tuple(out)


def sought_losses(robot: HybridRobot, effects: Choice) -> tuple[Choice, SoughtLosses | None]:
    """Return the effects without losses that grow with load, and these losses, or None.

    Raises:
        ModelError: Effects are unknown, or these losses cannot be identified with this robot.
    """
    if effects is None or isinstance(effects, Effects):
        return effects, None
    words = [effects] if isinstance(effects, str) else list(effects)
    named = [word for word in words if not (isinstance(word, str) and word == OFFSETS)]
    units = listed_units(robot, named)
    linear = [unit for unit in units if not isinstance(unit, LoadFriction | GearEfficiency)]
    if len(linear) == len(units):
        return effects, None
    on = choose(robot, units)
    _check_sought(units)
    if redundant(robot):
        raise ModelError(
            f"the effect '{on.losses[0]}' cannot be identified with redundant motors, whose single efforts "
            "no motion tells: leave it out", element=on.losses[0],
        )  # fmt: skip
    if not (on.inertia and on.velocity):
        raise ModelError(f"to identify '{on.losses[0]}', name the effects 'inertia' and 'velocity', too")
    if on.gears is not None and on.gears.effect.back is not None:
        raise ModelError(
            f"{GearEfficiency.name}: efforts tell efficiency and back only up to a factor of all masses: "
            "leave back out, so that the gear's friction is the same both ways", element=GearEfficiency.name,
        )  # fmt: skip
    found = SoughtLosses(on.loaded, on.gears)
    return [*linear, *(OFFSETS for word in words if isinstance(word, str) and word == OFFSETS)], found


def _check_sought(units: Iterable[object]) -> None:
    """Check that losses have coefficients, none of which is zero.

    Raises:
        ModelError: A loss has none, or one of load friction is zero.
    """
    for unit in units:
        if isinstance(unit, LoadFriction):
            tables = coefficients(unit).items()
            zero = [(word, joint) for word, table in tables for joint, x in table.items() if not x]
            if zero:
                word, joint = zero[0]
                raise ModelError(
                    f"{unit.name}: {word} of joint '{joint}' is 0, which is not sought: state a first guess "
                    "above zero, or leave the joint out", element=joint,
                )  # fmt: skip
            empty = not unit.joints
        else:
            empty = isinstance(unit, GearEfficiency) and not unit.efficiency
        if empty:
            name = LoadFriction.name if isinstance(unit, LoadFriction) else GearEfficiency.name
            raise ModelError(
                f"{name}: no coefficient is sought: state a first guess above zero, or leave the effect out",
                element=name,
            )


@dataclass(frozen=True, eq=False)
class LossRows:
    """All samples of a log.

    Attributes:
        losses: What is sought.
        Y, known: Regressor of the base parameters, and efforts by what is held, (T, motors, r), (T, motors).
        wrenches: w_0, shape (T, joints, 6).
        of_base: R, shape (T, joints, 6, r).
        of_friction: B, shape (T, joints, 6, joints).
        efforts: E, shape (T, motors, joints).
        direction: s of each gear, shape (T, gears).
        start: x_0, shape (r,).
    """

    losses: SoughtLosses
    Y: Array
    known: Array
    wrenches: Array
    of_base: Array
    of_friction: Array
    efforts: Array
    direction: Array
    start: Array

    def predicted(self, x: Array, c: Array) -> tuple[Array, Array]:
        """Compute efforts of motors, shape (T, motors), and their derivatives by x and c, (T, motors, p).

        Args:
            x: Base parameters, shape (r,).
            c: Coefficients, those of load friction first.

        Raises:
            ActuationError: Friction does not settle.
        """
        count = 0 if self.losses.load is None else len(self.losses.load.words)
        tau, slope = self.known + self.Y @ x, np.pad(self.Y, ((0, 0), (0, 0), (0, len(c))))
        if self.losses.load is not None:
            n, n_slope = self._friction(self.losses.load, x, c[:count])
            tau = tau + np.einsum("tmj,tj->tm", self.efforts, n)
            slope[:, :, : len(x) + count] += np.matmul(self.efforts, n_slope)
        if (gears := self.losses.gears) is not None:
            own, loss = tau[:, gears.motors], c[count:]
            slope[:, gears.motors] *= (1 + loss * self.direction * np.sign(own))[:, :, None]
            at = len(x) + count + np.arange(len(loss))
            slope[:, gears.motors, at] += self.direction * np.abs(own)
            tau = tau.copy()
            tau[:, gears.motors] += loss * self.direction * np.abs(own)
        return tau, slope

    def _friction(self, law: OnLoads, x: Array, c: Array) -> tuple[Array, Array]:
        """Compute the friction of every joint, shape (T, joints), and its derivatives by x and c."""
        law = law._replace(factor=c)
        loads = self.wrenches + self.of_base @ (x - self.start)
        n = solve_friction(law, loads, self.of_friction)
        under = loads + np.einsum("tikj,tj->tik", self.of_friction, n)
        at = law.slopes(under)
        of_base = np.einsum("tik,tikr->tir", at, self.of_base)
        of_each = np.stack([law._replace(factor=one).sizes(under) for one in np.eye(len(c))], axis=2)
        feedback = np.eye(len(law.joints)) - np.einsum("tik,tikj->tij", at, self.of_friction)
        return n, np.linalg.solve(feedback, np.concatenate([of_base, of_each], axis=2))


def loss_rows(
    robot: HybridRobot, sought: Sought, losses: SoughtLosses, moves: Array, q: Array, v: Array, a: Array,
    Y: Array, known: Array,
) -> LossRows:  # fmt: skip
    """Compute the rows of a motion.

    Args:
        sought: What of the linear model is sought.
        moves: How the standard parameters follow the base parameters, shape (standard, r).
        q, v, a: Closed states, shapes (T, nq), (T, nv), (T, nv).
        Y, known: As in `LossRows`.

    Raises:
        ModelError: The motion does not determine a load on which friction depends.
        ActuationError: A passive motion would need an effort.
    """
    standard, law, gears = sought.model.standard, losses.load, losses.gears
    joints, r = () if law is None else law.joints, moves.shape[1]
    w, E = np.zeros((len(q), len(joints), 6)), np.zeros((len(q), len(robot.motors), len(joints)))
    R, B = np.zeros((*w.shape, r)), np.zeros((*w.shape, len(joints)))
    if law is not None:
        found = inverse_model(robot, q, v, a, effects=standard.effects, reactions=True).reactions
        assert found is not None
        check_determined(law, found)
        w = wrenches_of(law, found)
        D = law.directions(v)
        for j in range(len(joints)):
            E[..., j], B[..., j] = _at_rest(robot, law, q, {}, D[..., j])
        for i, (wrenches, efforts) in enumerate(_forces(robot, standard, moves, q, v, a)):
            R[..., i] = _at_rest(robot, law, q, wrenches, efforts)[1]
    s = np.zeros((len(q), 0)) if gears is None else np.tanh(v[:, gears.columns] / gears.effect.width)
    start = sought.model.combination @ standard.values
    return LossRows(losses, Y, known, w, R, B, E, s, start)


def _at_rest(
    robot: HybridRobot, law: OnLoads, q: Array, wrenches: dict[str, Array], efforts: Array
) -> tuple[Array, Array]:
    """Compute what balances loads alone: efforts, (T, motors), and wrenches of joints, (T, joints, 6)."""
    on, rest = Effects(), np.zeros((len(q), robot.nv))
    loads = replace(all_loads(robot, on, q, rest, None, wrenches), joints=efforts)
    sharing = Sharing(None, "raise", "Losses that grow with load take a motor for every freedom")
    found = under_loads(robot, q, rest, rest, loads, sharing, solved=False, reactions=True)
    assert found.reactions is not None
    return found.values, wrenches_of(law, found.reactions)


def _forces(
    robot: HybridRobot, standard: StandardParameters, moves: Array, q: Array, v: Array, a: Array
) -> Iterator[tuple[dict[str, Array], Array]]:
    """Yield what each step of the standard parameters adds: wrenches on links, and efforts of joints."""
    motion = all_bodies(robot, q, v, a)
    g = robot.gravity if standard.effects.gravity else np.zeros(3)
    W = wrench_matrix(*(rotate_back(motion.R, x) for x in (motion.p_ddot - g, motion.w, motion.w_dot)))
    top = {
        body: link
        for link, (body, R, p) in robot.bodies.place.items()
        if np.array_equal(R, np.eye(3)) and not p.any()
    }
    laws = [(term, term.efforts(q, v, a)) for term in standard.terms if term.law is not None]
    for step in moves.T:
        wrenches, efforts = dict[str, Array](), np.zeros_like(v)
        for body, at in (*standard.bodies.items(), *standard.payloads):
            wrenches[top[body]] = wrenches.get(top[body], 0.0) - W[:, body] @ step[at]
        for term, along in laws:
            efforts[:, term.freedoms] -= along * step[term.columns]  # a law acts on each joint once
        yield wrenches, efforts
