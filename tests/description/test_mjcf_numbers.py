"""Every number of a robot read from MJCF is MuJoCo's. `tests/conversion` compares shipped robots."""

from pathlib import Path

import numpy as np
import pytest

from tests import ROOT
from tests.description.mjcf_states import Pair
from tests.robots.mjcf_texts import ROBOTS, random_tree
from tests.support.command_line import call, table_text
from tests.support.files import save
from tests.support.snippets import blocks

#: Numbers against MuJoCo's, relative to the largest of each table: two ways through ten products of doubles.
AGAINST_MUJOCO = 1e-10


def assert_close(ours: np.ndarray, theirs: np.ndarray, what: str) -> None:
    assert np.abs(ours - theirs).max() <= AGAINST_MUJOCO * max(1.0, np.abs(theirs).max()), what


TEXTS = {**ROBOTS, **{f"random tree {seed}": random_tree(seed) for seed in range(12)}}


@pytest.mark.parametrize("name", TEXTS)
def test_a_robot_has_the_numbers_of_mujoco(name: str, tmp_path: Path) -> None:
    """Compare poses, mass matrix, bias and equality rows at random states, which close no loop."""
    pair, draw = Pair(save(tmp_path, TEXTS[name], "robot.xml")), np.random.default_rng(1)
    for _ in range(3):
        q, v = pair.place(draw)
        assert_close(*pair.poses(q), "poses of bodies")
        assert_close(pair.our_mass_matrix(q), pair.mass_matrix(), "mass matrix")
        assert_close(pair.our_bias(q, v), pair.data.qfrc_bias, "bias")
        if pair.data.ne:
            J = pair.data.efc_J.reshape(-1, pair.model.nv)[: pair.data.ne]
            assert_close(pair.our_rows(q), J, "equality rows")


def test_the_commands_take_the_robot_of_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example, _ = blocks(ROOT / "docs" / "formats.md", "xml")
    file, motion = tmp_path / "five_bar.xml", tmp_path / "motion.csv"
    file.write_text(example.text)
    time = np.linspace(0, 1, 20)
    rows = np.column_stack([time, 0.2 * np.sin(time), 0.1 * time**2])
    motion.write_text(table_text(["time", "motor_left/position", "motor_right/position"], rows))
    efforts = call(capsys, "idm", file, motion, "--effects", "model", "-q")
    assert efforts.out.startswith("time,motor_left/effort,motor_right/effort")
    assert len(efforts.out.splitlines()) == 21
