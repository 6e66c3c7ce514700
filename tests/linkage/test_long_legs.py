"""Legs of hundreds of freedoms: Pinocchio's numbers, and memory that does not grow with their cube."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.dynamics.forward import forward
from hybridyn.structure.building import build_robot
from hybridyn.structure.leg_model import LegModel, LongLegs
from tests.mechanisms import KINDS, random_mechanism, random_states

CHOSEN = [kind for i, kind in enumerate(KINDS) if i % 5 == 0]
SAME = 1e-13  # of the largest entry
MOST = 400  # MB of a whole process for 200 joints in one loop; Pinocchio's data alone took a thousand


@pytest.mark.parametrize("kind", CHOSEN)
def test_both_models_of_the_legs_agree(kind: str) -> None:
    """On a moving base that turns, every kind of joint."""
    description = random_mechanism(3, kind=kind)
    q, v, a = random_states(description, "moving", 3, 2)
    for state in forward(build_robot(description, base="moving"), q, v, a):
        m = state.mechanism
        ours, theirs = (Legs(m.tree, list(m.spec.leg_bodies)) for Legs in (LongLegs, LegModel))
        at = state.V, state.V_dot, state.q, state.v, state.a
        found, told = ([*legs.rnea(*at), legs.crba(state.q)] for legs in (ours, theirs))
        for mine, wanted in zip(found, told, strict=True):
            assert np.abs(mine - wanted).max(initial=0.0) <= SAME * np.abs(wanted).max(initial=0.0)


def polygon(folder: Path, sides: int) -> Path:
    """Write a regular polygon of links, hinged at every corner, its first link on the ground."""
    side, turn = 1.0 / sides, 2 * np.pi / sides
    mass = (
        f'<inertial><origin xyz="{side / 2} 0 0"/><mass value="0.1"/>'
        '<inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>'
    )
    at = f'<origin xyz="{side} 0 0" rpy="0 0 {turn!r}"/>'
    text = [f'<link name="l{i}">{mass}</link>' for i in range(sides)]
    text += [
        f'<joint name="j{i}" type="revolute">{at}<parent link="l{i - 1}"/><child link="l{i}"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        for i in range(1, sides)
    ]
    text.append(
        f'<loop name="last" type="revolute"><predecessor link="l{sides - 1}">{at}</predecessor>'
        '<successor link="l0"/><axis xyz="0 0 1"/></loop>'
    )
    path = folder / "polygon.urdf"
    path.write_text(f'<robot name="polygon">{"".join(text)}</robot>')
    return path


WEIGH = """
import sys, numpy as np, hybridyn
robot = hybridyn.load(sys.argv[1], motors=[f"j{i}" for i in range(1, 200)])
rest = np.zeros(robot.nv)
tau = hybridyn.idm(robot, robot.home, rest, rest)
assert np.abs(hybridyn.ddm(robot, robot.home, rest, tau)).max() < 1e-9
assert robot.mobility == 197
status = open("/proc/self/status").read()  # ru_maxrss would count the parent's memory too
print(int(status.split("VmHWM:")[1].split()[0]) / 1024)
"""


def test_a_loop_of_two_hundred_joints_takes_little_memory(tmp_path: Path) -> None:
    if not Path("/proc/self/status").exists():
        pytest.skip("this system does not tell a process's largest memory")
    done = subprocess.run(
        [sys.executable, "-c", WEIGH, str(polygon(tmp_path, 200))], capture_output=True, text=True, check=True
    )
    assert float(done.stdout) < MOST


def test_a_long_loop_moves_as_its_energy_says(tmp_path: Path) -> None:
    """Under no load but its weight: the rate of its energy is the power of its motors."""
    robot = hybridyn.load(polygon(tmp_path, 140), motors=["j1"], gravity=(0.0, -9.81, 0.0))
    m = robot.modules[0].mechanism
    assert isinstance(m.legs, LongLegs)
    rng, q = np.random.default_rng(0), m.postures[0]
    Psi = m.basis(m.closures.matrix(m.tree.sweep(q[None]))).Psi[0]
    v, tau = Psi @ rng.normal(size=robot.mobility), np.array([0.3])
    a, h = hybridyn.ddm(robot, q, v, tau), 1e-6
    steps = np.array([[1.0], [-1.0]])
    along = hybridyn.energy(robot, q + steps * h * v + h * h / 2 * a, v + steps * h * a).total
    power = tau[0] * v[robot.joint_index["j1"]]
    assert (along[0] - along[1]) / (2 * h) == pytest.approx(power, rel=1e-6, abs=1e-6)
