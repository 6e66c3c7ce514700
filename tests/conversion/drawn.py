"""Draw effects on the joints and links of a robot, with numbers and names that a file may hold."""

from dataclasses import replace
from typing import Any

import numpy as np

from hybridyn.description import Description
from hybridyn.description.loop_signs import WeldedBodies
from hybridyn.structure.building import build_robot

ONE_FREEDOM = ("revolute", "prismatic")
Tables = dict[str, dict[str, Any]]


def with_drawn_effects(d: Description, seed: int) -> Description:
    """Return a robot with effects instead of its own: each one on some joints or links, or left out."""
    draw = np.random.default_rng([seed, 9])
    drawn = _on_joints(d, draw) | _on_links(d, draw)
    return replace(d, effects=tuple((name, x) for name, x in drawn.items() if draw.random() < 0.7))


def _some(draw: np.random.Generator, names: list[str], *shape: int) -> dict[str, Any]:
    """Draw numbers above zero for some of the names, for one at least."""
    chosen = [name for name in names if draw.random() < 0.6] or names[:1]
    return {name: draw.uniform(0.5, 2.0, shape).tolist() for name in chosen}


def _on_joints(d: Description, draw: np.random.Generator) -> Tables:
    """Draw effects on the joints that were not cut."""
    robot = build_robot(d)
    free = [(n, k) for n, k in zip(robot.joints, robot.kinds, strict=True) if n not in robot.cut_joints]
    single, balls = ([n for n, kind in free if kind in of] for of in (ONE_FREEDOM, ("spherical",)))
    stiff, bent, stopped = (_some(draw, single, *shape) for shape in ((), (3,), ()))
    rests = {name: x / np.linalg.norm(x) for name in balls for x in draw.normal(size=(1, 4))}
    tendons = ["rope", *single[:1]]  # one has the name of a joint
    every: Tables = {
        "spring": {"stiffness": stiff, "rest": {name: float(draw.normal()) for name in stiff}},
        "polynomial_spring": {"coefficients": bent, "rest": {name: float(draw.normal()) for name in bent}},
        "stop": {
            "stiffness": stopped, "lower": dict.fromkeys(stopped, -0.1), "upper": dict.fromkeys(stopped, 0.1),
        },
        "tendons": {
            "arms": {joint: {t: float(draw.normal()) for t in tendons} for joint in single[:3]},
            "stiffness": _some(draw, tendons), "upper": _some(draw, tendons),
            "lower": dict.fromkeys(tendons, -0.1),
        },
        "ball_spring": {
            "stiffness": dict.fromkeys(rests, 2.0), "rest": {name: x.tolist() for name, x in rests.items()},
        },
    }  # fmt: skip
    return {name: x for name, x in every.items() if (balls if name == "ball_spring" else single)}


def _on_links(d: Description, draw: np.random.Generator) -> Tables:
    """Draw effects on links; weights of those that move."""
    place, body = build_robot(d).bodies.place, WeldedBodies(d).of
    links = [link.name for link in d.links if link.name in place]
    heavy = [link.name for link in d.links if link.mass and body[link.name] != d.root and link.name in place]
    lines = {"rope": draw.choice(links, 3).tolist(), links[-1]: [d.root, links[-1]]}  # named as a link
    return {
        "gravity_compensation": {"fraction": _some(draw, heavy)},
        "line_springs": {
            "ends": lines,
            "points": {name: draw.normal(size=(len(ends), 3)).tolist() for name, ends in lines.items()},
            "stiffness": _some(draw, [*lines]), "upper": _some(draw, [*lines]),
        },
        "bushings": {
            "ends": {name: ends[:2] for name, ends in lines.items()},
            "torque_stiffness": _some(draw, [*lines], 3), "force_stiffness": _some(draw, [*lines], 3),
        },
        "ground_contact": {"points": _some(draw, links, 2, 3), "stiffness": 300.0, "height": 1.0},
        "payload": {"link": links[-1], "mass": 0.7, "com": [0.1, 0.2, 0.3]},
    }  # fmt: skip
