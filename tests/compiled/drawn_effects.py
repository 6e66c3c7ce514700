"""Effects that the fuzz draws for repeated mechanisms: friction, also by load, springs and dampers."""

from typing import Any

import numpy as np

import hybridyn
from hybridyn.effects import (
    CoulombFriction,
    DirectedFriction,
    LoadFriction,
    PolynomialDamper,
    Spring,
    StribeckFriction,
)  # fmt: skip
from hybridyn.joints.kinds import JointKind


def numbers_of(robot: hybridyn.HybridRobot, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Draw six numbers of each joint: those of the joint of which it is the copy, by its name, or its own."""
    alike, out = rng.random() < 0.5, dict[str, np.ndarray]()
    for name in robot.joints:
        own = rng.uniform(0.5, 1.0, 6)
        out[name] = out.get("a" + name[1:], own) if alike else own
    return out


def drawn_effects(robot: hybridyn.HybridRobot, seed: int) -> list[Any]:
    """Draw effects: none for every fourth seed, and for the one after it none by load."""
    rng = np.random.default_rng([seed, 54])
    if seed % 4 == 3:
        return ["default"]
    numbers, kinds = numbers_of(robot, rng), dict(zip(robot.joints, robot.kinds, strict=True))
    single = [name for name, kind in kinds.items() if kind.single and name not in robot.cut_joints]

    def some(names: list[str], share: float, size: float, column: int) -> dict[str, float]:
        return {name: size * float(numbers[name][column]) for name in names if rng.random() < share}

    level = some(single, 0.5, 0.2, 0)
    twice = {name: 2 * x for name, x in level.items()}
    dry = [
        CoulombFriction(level, 0.3), DirectedFriction(level, twice, 0.3),
        StribeckFriction(level, twice, dict.fromkeys(level, 0.4), 0.3),
    ][rng.integers(3)]  # fmt: skip
    stiff, rough = some(single, 0.5, 2.0, 1), some(single, 0.3, 0.3, 2)
    out = [
        "default",
        dry,
        Spring(stiff, some([*stiff], 0.5, 0.3, 3)),
        PolynomialDamper({n: [x, x] for n, x in rough.items()}),
    ]
    if seed % 4:
        hinges, slides = ([n for n in single if kinds[n].slides is slides] for slides in (False, True))
        balls = [n for n, kind in kinds.items() if kind is JointKind.SPHERICAL and n not in robot.cut_joints]
        radial, normal = some([*hinges, *balls], 0.4, 1e-3, 4), some(slides, 0.5, 0.02, 5)
        static = some([*radial, *normal], 0.5, 0.5, 0)
        near_rest = {"static": {n: 1 + x for n, x in static.items()}, "speed": dict.fromkeys(static, 0.3)}
        out += [LoadFriction(radial, normal=normal, **near_rest, width=0.1)]
    return out
