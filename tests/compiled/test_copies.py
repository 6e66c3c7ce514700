"""Modules and legs that repeat, mirrored and turned: what they share is right for each of them."""

import os
from unittest.mock import patch

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import random_states
from hybridyn.joints.kinds import JointKind
from hybridyn.structure.building import build_robot
from tests.compiled import fuzzing
from tests.compiled.copies import mirrored_legs
from tests.robots.mechanisms import random_mechanism
from tests.robots.mirrors import MIRRORS, image, position
from tests.support.comparing import SOLVED, close_to
from tests.support.samples import slow

#: Mirrors that keep the direction of gravity.
UPRIGHT = [S for S in MIRRORS[1:] if S[2, 2] == 1.0]


def rates(kind: JointKind, v: np.ndarray, S: np.ndarray, sign: float) -> np.ndarray:
    """Return the rates of a joint in the mirror image, axial vectors for turns."""
    if kind.single:
        return sign * v
    moved = np.zeros(6)
    moved[kind.columns] = v
    turns = np.linalg.det(S) * S @ moved[3:]
    out: np.ndarray = np.concatenate([S @ moved[:3], turns])[kind.columns]
    return out


@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 6))])
def test_a_mirror_image_needs_the_same_efforts(seed: int) -> None:
    """Its joints move alike, or the other way where they count so; the first has all kinds of them."""
    description = mirrored_legs(seed) if seed else random_mechanism(1, kind="serial_all")
    signs = {joint.name: (-1.0) ** i for i, joint in enumerate(description.joints)}
    robot = build_robot(description)
    q, v, a, _ = (x[0] for x in random_states(robot, 1))
    for S in UPRIGHT:
        other = build_robot(image(description, S, {name: sign < 0 for name, sign in signs.items()}))
        x, (x_dot, x_ddot) = q.copy(), np.zeros((2, robot.nv))
        for name, kind, at, to in zip(robot.joints, robot.kinds, robot.q_slices, robot.v_slices, strict=True):
            x[at] = position(kind, q[at], S, signs[name])
            x_dot[to], x_ddot[to] = (rates(kind, y[to], S, signs[name]) for y in (v, a))
        tau = hybridyn.idm(other, x, x_dot, x_ddot)
        close_to(tau, [signs[name] for name in robot.motors] * hybridyn.idm(robot, q, v, a), SOLVED)


@pytest.mark.parametrize("seed", [64, *map(slow, range(4, 16))])
def test_copies_are_those_of_the_general_path(seed: int) -> None:
    """Models, loops, map and, of some, derivatives and control step in C; the general path by the oracle.

    By default four cranks whose rods spin; two share code, and theirs point elsewhere in their bodies.
    """
    found = fuzzing.Found()
    with patch.dict(os.environ, {"CC": "none"}):
        fuzzing.compare(seed, found, "repeated")
    assert found.wrong == []
