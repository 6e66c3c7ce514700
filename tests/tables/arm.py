"""Records of small robots, whose numbers do not matter: a slider with an endless tool, and a ball."""

import numpy as np

from hybridyn.description.records import Description, Joint, JointKind, Link


def links(*names: str) -> tuple[Link, ...]:
    return tuple(Link(name, 1.0, np.zeros(3), np.eye(3)) for name in names)


def joint(name: str, kind: JointKind, parent: str, child: str) -> Joint:
    return Joint(name, kind, parent, child, np.eye(4), np.array([0.0, 0.0, 1.0]))


ARM = Description(
    name="arm",
    links=links("base", "slider", "tool"),
    joints=(joint("lift", "prismatic", "base", "slider"), joint("spin", "continuous", "slider", "tool")),
)
BALL = Description("ball", links("base", "tool"), (joint("ball", "spherical", "base", "tool"),))
