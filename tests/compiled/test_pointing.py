"""Directions, distances and orientations alone in C: rows, rates and accelerations of the general path."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot
from hybridyn.assembly.requests import gather_requests
from hybridyn.compiled.programs.closing.libraries import ClosingLibraries
from tests.assembly.test_angles import arm
from tests.assembly.test_pointing import Levels, direction, distance
from tests.compiled.test_chains import compare, load, some_of, swing
from tests.robots.posing import Triple, of_link
from tests.support.samples import slow

SPIN = ("wx", "wy", "wz")
FAR, WIDE = np.array([0.8, -1.1, 0.4]), np.array([0.02, 0.03, -0.02])  # a point that moves [m]


def moving(T: int) -> Levels:
    """Return a point that goes round, shape (T, 3), and its derivatives."""
    turn, t = 2 * np.pi, np.linspace(0.0, 1.0, T)[:, None]
    away = WIDE * np.sin(turn * t)
    return FAR + away, WIDE * turn * np.cos(turn * t), -(turn**2) * away


def named(robot: HybridRobot, states: Triple, link: str, words: str) -> Triple:
    """Return coordinates, directions of axes (`zz`: that of z) and a distance of a link, by their names."""
    levels = of_link(robot, *states, link, robot.description.root)
    out = some_of(levels, " ".join(word for word in words.split() if len(word) == 1))
    for axis in (word[0] for word in words.split() if len(word) == 2):
        pointed = direction(*levels, "xyz".index(axis))
        for one, level in zip(out, pointed, strict=True):
            one.update({axis + name: x for name, x in zip("xyz", level.T, strict=True)})
    if "turn" in words:
        for one, level, names in zip(out, levels, (("qx", "qy", "qz", "qw"), SPIN, SPIN), strict=True):
            one.update(dict(zip(names, level[:, 3:].T, strict=True)))
    if "distance" in words:
        centre = moving(len(states[0]))
        for one, d, c in zip(out, distance(*levels, centre), centre, strict=True):
            one.update({"distance": d} | dict(zip(("cx", "cy", "cz"), c.T, strict=True)))
    return out


@pytest.mark.parametrize(
    ("name", "link", "words", "size"),
    [
        slow("arm zyy", "l2", "xx distance", 0.05),
        slow("arm zyyzy", "l4", "x xx distance", 0.05),
        slow("arm zyxyzyx", "l6", "x zz distance", 0.05),
        slow("arm zyxyzyx", "l6", "zz", 0.05),
        slow("arm zyxyzyx", "l6", "turn", 0.05),
        slow("stewart_ur5", "wrist_3_link", "x turn", 0.02),
        slow("arm zyxyzyx", "l6", "distance", 0.05),
        slow("arm zyyzy", "l4", "x y z xx", 0.05),
        slow("gough 1", "", "x y z zz", 0.02),
        slow("delta_bars 1", "", "distance", 0.01),
        slow("scara_delta 2", "", "x distance", 0.01),
        slow("stewart_ur5", "wrist_3_link", "yy distance", 0.02),
    ],
)
def test_rows_are_those_of_the_general_path(
    name: str, link: str, words: str, size: float, tmp_path: Path
) -> None:
    """Through several modules or of one, with freedoms left or without; directions and points move."""
    robot = load(name, tmp_path)
    link = link or robot.modules[-1].outputs[0]
    states = swing(robot, size)
    compare(robot, states[0][0], {link: named(robot, states, link, words)})


def test_a_direction_that_turns_out_of_a_plane_is_left_to_the_general_path(tmp_path: Path) -> None:
    """Of its two rows, an arm in a plane moves one."""
    robot = arm(tmp_path, "yyy")
    requests = gather_requests(robot, None, {"l2": ({"zx": 0.1, "zy": 0.0, "zz": 1.0},)})
    assert ClosingLibraries(robot).artifact(requests) is None
    q = hybridyn.assemble(robot, platforms={"l2": ({"zx": 0.1, "zy": 0.0, "zz": 1.0},)})[0]
    assert abs(q.sum() - np.arctan2(0.1, 1.0)) < 1e-12
