"""Robots with every effect on them, for tests that state identities."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from hybridyn import HybridRobot
from hybridyn import effects as fx

Units = list[Any]


def per_motor(robot: HybridRobot, low: float, high: float, seed: int) -> dict[str, float]:
    """Draw a number for each motor."""
    rng = np.random.default_rng(seed)
    return {
        motor: float(x)
        for motor, x in zip(robot.motors, rng.uniform(low, high, len(robot.motors)), strict=True)
    }


def stop(robot: HybridRobot) -> Units:
    """Stops in the middle of the motors' ranges, so that about half of them are touched."""
    stiffness = per_motor(robot, 200, 400, 4)
    return [fx.Stop(stiffness, 0.3, dict.fromkeys(stiffness, -9.0), dict.fromkeys(stiffness, 0.025))]


def wrench(robot: HybridRobot) -> Units:
    """A constant wrench on the last link and a table on another, in world axes."""
    links = [link.name for link in robot.description.links]
    time, rows = np.array([0.0, 1.0, 2.0]), np.random.default_rng(8).normal(size=(3, 6))
    return [
        fx.Wrench(links[-1], [1, 2, 3, 0.1, 0.2, 0.3]),
        fx.Wrench(links[len(links) // 2], 9 * rows, time, "world"),
    ]


def ground(robot: HybridRobot) -> Units:
    """Two points of the last link, so deep in the ground that they touch it."""
    link = robot.bodies.bodies[-1].name
    points = {link: [[0.0, 0.0, 0.0], [0.1, 0.05, -0.1]]}
    return [fx.GroundContact(points, 300.0, 0.2, 0.6, width=0.05, height=3.0)]


def springs(robot: HybridRobot) -> Units:
    """Springs along lines between a link, the root, and another link."""
    links = [link.name for link in robot.description.links]
    far, near, root = links[-1], links[len(links) // 2], robot.description.root
    point = [[0.1, 0.0, 0.2], [0.3, -0.2, 0.4], [0.0, 0.1, -0.1]]
    return [
        fx.LineSprings(
            {"one": [far, root, near], "two": [near, root]}, {"one": point, "two": point[:2]},
            {"one": 30.0, "two": 20.0}, {"one": 3.0}, {"two": 2.0}, {}, {"one": 0.3, "two": 0.1}, 0.4,
            {"one": [1.0, 0.5]},
        )
    ]  # fmt: skip


def bushings(robot: HybridRobot) -> Units:
    """A bushing with three stiffnesses between two links, and one of damping alone to the root."""
    links = [link.name for link in robot.description.links]
    far, near, root = links[-1], links[len(links) // 2], robot.description.root
    places = [[0.1, 0.0, 0.2, 0.0, 0.6, 0.0, 0.8], [0.3, -0.2, 0.4, 0.48, 0.6, 0.0, 0.64]]
    return [
        fx.Bushings(
            {"one": [far, near], "two": [near, root]}, {"one": places},
            {"one": [3.0, 2.0, 4.0]}, {"two": [0.3, 0.1, 0.2]}, {"one": [30.0, 20.0, 10.0]},
            {"one": [3.0, 4.0, 2.0], "two": [1.0, 0.0, 2.0]},
        )
    ]  # fmt: skip


def tendons(robot: HybridRobot) -> Units:
    """Two tendons over the motors that count turns."""
    kinds = dict(zip(robot.joints, robot.kinds, strict=True))
    geared = [motor for motor in robot.motors if kinds[motor] in ("revolute", "prismatic")]
    arms = {motor: {"t": 0.5 + i, "u": 1.0 - 0.3 * i} for i, motor in enumerate(geared)}
    stated = [{"t": a, "u": b} for a, b in ((30.0, 20.0), (3.0, 1.0), (2.0, 1.0), (-0.01, 0.01), (0.0, 0.02))]
    return [fx.Tendons(arms, *(numbers if geared else {} for numbers in stated), 0.4)]


def balls(robot: HybridRobot) -> list[str]:
    """Return the ball joints that were not cut."""
    pairs = zip(robot.joints, robot.kinds, strict=True)
    return [name for name, kind in pairs if kind == "spherical" and name not in robot.cut_joints]


CASES: dict[str, Callable[[HybridRobot], Units]] = {
    "gravity": lambda robot: ["gravity"],
    "leg_inertia": lambda robot: ["leg_inertia"],
    "rotor_inertia": lambda robot: [fx.RotorInertia(per_motor(robot, 0.1, 2.0, 0))],
    "viscous_friction": lambda robot: [fx.ViscousFriction(per_motor(robot, 1, 5, 1))],
    "coulomb_friction": lambda robot: [fx.CoulombFriction(per_motor(robot, 1, 5, 2), 0.3)],
    "stribeck_friction": lambda robot: [
        fx.StribeckFriction(
            per_motor(robot, 1, 2, 3), per_motor(robot, 3, 4, 3), per_motor(robot, 0.4, 0.5, 3), 0.2
        )
    ],
    "directed_friction": lambda robot: [
        fx.DirectedFriction(per_motor(robot, 1, 5, 2), per_motor(robot, 1, 5, 3), 0.3)
    ],
    "spring": lambda robot: [fx.Spring(per_motor(robot, 20, 90, 5), per_motor(robot, -0.2, 0.2, 6))],
    "damper": lambda robot: [fx.Damper(per_motor(robot, 1, 5, 7))],
    "stop": stop,
    "wrench": wrench,
    "ground_contact": ground,
    "polynomial_spring": lambda robot: [
        fx.PolynomialSpring(
            {motor: [k, 30.0, 50.0] for motor, k in per_motor(robot, 20, 90, 9).items()},
            per_motor(robot, -0.2, 0.2, 6),
        )
    ],
    "polynomial_damper": lambda robot: [
        fx.PolynomialDamper({motor: [c, 3.0, 2.0] for motor, c in per_motor(robot, 1, 5, 10).items()})
    ],
    "ball_spring": lambda robot: [fx.BallSpring(dict.fromkeys(balls(robot), 5.0))],
    "tendons": tendons,
    "gravity_compensation": lambda robot: [
        fx.GravityCompensation({link.name: 0.7 for link in robot.description.links[1::2]})
    ],
    "line_springs": springs,
    "bushings": bushings,
}
"""Effects that one robot can have without being rebuilt, by name."""


def every(robot: HybridRobot) -> Units:
    """Return all of them."""
    return [unit for case in CASES.values() for unit in case(robot)]


def rate_of(
    robot: HybridRobot, value: Callable[[np.ndarray, np.ndarray], np.ndarray], q: np.ndarray, v: np.ndarray,
    a: np.ndarray, step: float = 2e-4,
) -> np.ndarray:  # fmt: skip
    """Return the time derivative of value(q, v) along motions by central differences, shape (T,)."""
    steps, weights = step * np.array([1, 2, 3, -1, -2, -3]), np.array([45.0, -9.0, 1.0])
    moved = [pin.integrate(robot.model, x, h * x_dot) for h in steps for x, x_dot in zip(q, v, strict=True)]
    rates = np.concatenate([v + h * a for h in steps])
    ahead, back = value(np.array(moved), rates).reshape(2, len(weights), len(q))
    slope: np.ndarray = weights @ (ahead - back) / (60 * step)
    return slope
