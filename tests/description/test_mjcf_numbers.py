"""Every number of a robot read from MJCF is MuJoCo's: mass matrix, bias, equality Jacobian."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.files import save
from tests.mjcf_states import Pair
from tests.mjcf_texts import ROBOTS, random_tree

#: Numbers against MuJoCo's, relative to the largest of each table: two ways through ten products of doubles.
AGAINST_MUJOCO = 1e-10


def assert_close(ours: np.ndarray, theirs: np.ndarray, what: str) -> None:
    assert np.abs(ours - theirs).max() <= AGAINST_MUJOCO * max(1.0, np.abs(theirs).max()), what


def compare(pair: Pair, draw: np.random.Generator) -> None:
    """Compare poses, mass matrix, bias and equality rows at random states, which close no loop."""
    for _ in range(3):
        q, v = pair.place(draw)
        assert_close(*pair.poses(q), "poses of bodies")
        assert_close(pair.our_mass_matrix(q), pair.mass_matrix(), "mass matrix")
        assert_close(pair.our_bias(q, v), pair.data.qfrc_bias, "bias")
        if pair.data.ne:
            J = pair.data.efc_J.reshape(-1, pair.model.nv)[: pair.data.ne]
            assert_close(pair.our_rows(q), J, "equality rows")


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_has_the_numbers_of_mujoco(name: str, tmp_path: Path) -> None:
    file = save(tmp_path, ROBOTS[name], "robot.xml")
    compare(Pair(file), np.random.default_rng(1))


@pytest.mark.parametrize("seed", range(12))
def test_a_random_tree_has_the_numbers_of_mujoco(seed: int, tmp_path: Path) -> None:
    file = save(tmp_path, random_tree(seed), "robot.xml")
    compare(Pair(file), np.random.default_rng(seed))
