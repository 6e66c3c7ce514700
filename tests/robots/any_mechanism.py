"""Mechanisms of any rank, also ones that must be refused: joints, closures, gears and motors drawn at will.

No draw is thrown away: rows may nearly depend on others, lock the mechanism or hold its motors, and bodies
may have no mass. The oracle may therefore be of no use, and a refusal is a right answer. `generated.py`
draws mechanisms of clear rank, at states of the oracle, where every answer is known.
"""

from typing import get_args

import numpy as np

from hybridyn.description.records import Description, JointKind
from tests.oracle import Base
from tests.robots.sketch import CLOSURES, Sketch

BASES: tuple[Base, ...] = get_args(Base)
JOINTS: dict[JointKind, float] = {
    "revolute": 0.4, "continuous": 0.2, "prismatic": 0.2, "spherical": 0.1, "planar": 0.1,
}  # fmt: skip
ONE_FREEDOM = ("revolute", "continuous", "prismatic")
#: Coefficients of gears: no small fractions, and some.
RATIOS = (3.14, -2.37, 1.234, 0.558, -1.0, 0.5)
MOST_JOINTS, MOST_CLOSURES, MOST_GEARS = 6, 2, 2


def any_mechanism(seed: int) -> tuple[Description, Base]:
    """Draw a mechanism and a base.

    Args:
        seed: Same seed, same mechanism.
    """
    rng = np.random.default_rng([seed, 2])
    s = Sketch(rng)
    links = ["base"]
    for _ in range(rng.integers(1, MOST_JOINTS + 1)):
        kind = rng.choice([*JOINTS], p=[*JOINTS.values()])
        parent = links[-1] if rng.random() < 0.7 else str(rng.choice(links))
        at = s.poses[parent][:3, 3] + rng.uniform(-0.4, 0.4, 3)
        motor = kind in ONE_FREEDOM and rng.random() < 0.6
        links.append(s.joint(kind, parent, at, motor=motor, massless=rng.random() < 0.1))
    for _ in range(rng.integers(0, MOST_CLOSURES + 1)):
        if len(links) > 2:
            a, b = rng.choice(links, size=2, replace=False)
            s.close(str(rng.choice([*CLOSURES])), a, b, s.poses[b][:3, 3] + rng.uniform(-0.3, 0.3, 3))
    single = [joint.child for joint in s.joints if joint.kind in ONE_FREEDOM]
    for _ in range(rng.integers(0, MOST_GEARS + 1)):
        if len(single) > 1:
            some = rng.choice(single, size=rng.integers(2, min(len(single), 3) + 1), replace=False)
            s.couple([*map(str, some)], rng.choice(RATIOS, size=len(some)))
    return s.description(f"any_{seed}"), BASES[rng.integers(len(BASES))]
