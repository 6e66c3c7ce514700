"""Gears between endless joints: positions given count whole turns, at any ratio and any spacing of rows."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import AssemblyError
from hybridyn.structure.robot import HybridRobot
from tests.oracle import Oracle
from tests.robots.posing import position
from tests.support.command_line import call, table_text
from tests.support.comparing import refused
from tests.support.files import save
from tests.support.samples import slow

OFFSET = 0.2
ROUNDING = 1e-11  # an angle of some hundred turns has lost two digits or three


def link(name: str) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0.1 0.02 0"/><mass value="1"/>'
        '<inertia ixx=".01" iyy=".02" izz=".03" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name: str, kind: str, parent: str, child: str, more: str = "", at: str = "0 0 0") -> str:
    axis = "1 0 0" if kind == "prismatic" else "0 1 0"
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/><axis xyz="{axis}"/>{more}'
        '<limit lower="-9e3" upper="9e3" effort="1" velocity="1"/></joint>'
    )


def mimic(leader: str, ratio: float, offset: float = 0.0) -> str:
    return f'<mimic joint="{leader}" multiplier="{ratio}" offset="{offset}"/>'


def robot(folder: Path, *parts: str, motor: str = "drive") -> HybridRobot:
    text = "\n".join(['<robot name="geared">', *parts, "</robot>"])
    return hybridyn.load(save(folder, text, "geared.urdf"), motors=[motor])


def gear(folder: Path, ratio: float, kind: str = "continuous") -> HybridRobot:
    """Two joints on one base."""
    drive, follower = joint("drive", "continuous", "b", "d"), mimic("drive", ratio, OFFSET)
    parts = [link("b"), link("d"), link("f"), drive, joint("follower", kind, "b", "f", follower, "1 0 0")]
    return robot(folder, *parts)


def crank(folder: Path, ratio: float, motor: str) -> HybridRobot:
    """A slider-crank whose crank drives another joint through a gear."""
    loop = (
        '<loop name="l" type="revolute"><predecessor link="d"><origin xyz="0.3 0 0"/></predecessor>'
        '<successor link="rod"><origin xyz="-1 0 0"/></successor><axis xyz="0 1 0"/></loop>'
    )
    parts = [link(name) for name in ("b", "s", "d", "rod", "f")]
    parts += [joint("slide", "prismatic", "b", "s"), joint("crank", "continuous", "b", "d")]
    parts += [joint("pin", "continuous", "s", "rod"), loop]
    parts += [joint("follower", "continuous", "b", "f", mimic("crank", ratio), "0 0 1")]
    return robot(folder, *parts, motor=motor)


def folded(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi


# -------------------------------------------------------------------- coordinates


def test_positions_of_geared_endless_joints_are_angles(tmp_path: Path) -> None:
    """They have one coordinate, in the robot, its Pinocchio model and the oracle; others keep two."""
    geared = gear(tmp_path, 3.14)
    assert geared.kinds == ("revolute", "revolute")
    assert geared.nq == geared.model.nq == Oracle(geared.description).nq == 2
    assert geared.description.endless_gears == {"drive", "follower"}
    alone = robot(tmp_path, link("b"), link("d"), joint("drive", "continuous", "b", "d"))
    assert alone.kinds == ("continuous",)
    assert alone.nq == 2
    q = hybridyn.assemble(geared, motors={"drive": 2e4})[0]  # more turns than limits allow
    assert q[1] == pytest.approx(3.14 * 2e4 + OFFSET, rel=1e-14)


def test_a_home_by_cosine_and_sine_is_an_angle(tmp_path: Path) -> None:
    gear(tmp_path, 3.14)
    at = np.array([0.5, 3.14 * 0.5 + OFFSET])
    (tmp_path / "geared.model.toml").write_text(
        f"[home]\ndrive = [{np.cos(0.5)}, {np.sin(0.5)}]\nfollower = {at[1]}\n"
    )
    home = hybridyn.load(tmp_path / "geared.urdf", motors=["drive"]).home
    assert home == pytest.approx(at, abs=ROUNDING)


# -------------------------------------------------------------------- positions given


@pytest.mark.parametrize("kind", ["continuous", slow("revolute")])
@pytest.mark.parametrize("ratio", [slow(3.14), slow(-3.0), 0.3333333])
def test_the_driven_joint_follows_at_any_spacing(tmp_path: Path, ratio: float, kind: str) -> None:
    geared = gear(tmp_path, ratio, kind)
    for spacing in (0.01, 1.0, 7.0):
        x = -1.0 + spacing * np.arange(12)
        q, v, a = hybridyn.assemble(geared, motors={"drive": (x, np.ones(12), np.ones(12))})
        wanted = ratio * x + OFFSET
        assert np.abs(folded(position(geared, "follower", q) - wanted)).max() < ROUNDING, spacing
        last = hybridyn.assemble(geared, motors={"drive": x[-1]})[0]
        assert abs(folded(position(geared, "follower", last) - wanted[-1])) < ROUNDING, spacing
        hybridyn.idm(geared, q, v, a)  # and nobody finds the loops open


@pytest.mark.parametrize("motor", ["slide", "crank", "follower"])
@pytest.mark.parametrize("ratio", [3.14, 0.558, 0.3333333])
def test_a_gear_on_a_joint_that_a_loop_moves(tmp_path: Path, ratio: float, motor: str) -> None:
    geared = crank(tmp_path, ratio, motor)
    turn = 0.3 + 0.8 * np.linspace(0, 1, 8)
    reach = 0.3 * np.cos(turn) + np.sqrt(1 - (0.3 * np.sin(turn)) ** 2)
    given = {"slide": reach, "crank": turn, "follower": ratio * turn}[motor]
    start = hybridyn.assemble(geared, motors={"crank": turn[0]})[0]
    q = hybridyn.assemble(geared, motors={motor: given}, guess=start)[0]
    assert position(geared, "crank", q) == pytest.approx(turn, abs=1e-9)
    assert np.abs(folded(position(geared, "follower", q) - ratio * position(geared, "crank", q))).max() < 1e-9


@pytest.mark.parametrize("ratio", [3.14, -3.0])
def test_angles_folded_into_one_turn_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], ratio: float
) -> None:
    gear(tmp_path, ratio)
    time = np.arange(100) / 100
    text = table_text(["time", "drive/position"], np.column_stack([time, folded(20 * time)]))
    path = save(tmp_path, text, "folded.csv")
    said = call(capsys, "idm", tmp_path / "geared.urdf", "--motors", "drive", path, status=1)
    assert "row 17" in said.err
    assert "joint 'drive'" in said.err
    assert "unwrap" in said.err


@pytest.mark.parametrize("rate", [3.0, 25.0])
def test_tables_of_a_simulation_count_the_turns_between_their_rows(tmp_path: Path, rate: float) -> None:
    """A joint that turns by more than half a turn from row to row."""
    from hybridyn.simulation.table import columns_of, rows_of

    geared = gear(tmp_path, 3.14)
    q, v, _ = hybridyn.assemble(geared, motors={"drive": (0.1, 40.0, 0.0)})
    times = np.arange(0, 1 + 1e-9, 1 / rate)
    result = hybridyn.simulate(geared, q, v, times, effects=["inertia", "leg_inertia", "velocity"])
    rows = dict(zip(columns_of(geared), rows_of(geared, result).T, strict=True))
    drive, follower = rows["drive/position"], rows["follower/position"]
    assert drive[-1] - drive[0] > 30
    assert np.abs(np.diff(follower) - 3.14 * np.diff(drive)).max() < 1e-6


def test_a_contradiction_is_an_error(tmp_path: Path) -> None:
    geared = crank(tmp_path, 3.14, "crank")
    refused(lambda: hybridyn.assemble(geared, motors={"slide": 1.25, "crank": 2.0}), AssemblyError, "")
