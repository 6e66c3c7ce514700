"""`hybridyn idm --by-effect`: parts of the efforts against the inverse model, the command."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import effects as fx
from hybridyn.effects.choice import choose
from hybridyn.structure.building import build_robot
from hybridyn.studies.effect_worth import EffectSets, contributions
from tests import ROOT
from tests.robots.effect_cases import every
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import shipped, states_near_home
from tests.support.command_line import call
from tests.support.comparing import close_to, refused
from tests.support.files import save

FIVE_BAR = [str(ROOT / "urdf/five_bar.urdf.xacro"), str(ROOT / "models/five_bar/traj.csv")]
LINEAR = 1e-11  # sums of efforts instead of efforts of sums


def near_home() -> tuple[hybridyn.HybridRobot, np.ndarray, np.ndarray, np.ndarray]:
    """Return the five-bar with five states."""
    description = shipped("five_bar")
    return build_robot(description), *states_near_home(description, "fixed", 0, 5)


def test_contributions_are_differences() -> None:
    robot, q, v, a = near_home()
    on = choose(robot, ["model", *every(robot), fx.Limits(dict.fromkeys(robot.motors, 1e6))])
    time = 0.1 * np.arange(5)
    found = {part.name: part for part in contributions(robot, q, v, a, on, time=time)}
    assert tuple(found) == tuple(
        name for name in on.names if name not in ("limits", "payload", "base_motion")
    )

    def efforts(*left_out: str) -> np.ndarray:
        names = {*on.names} - {*left_out}
        return hybridyn.idm(robot, q, v, a, time=time, effects=on.only(names))

    full = efforts()
    for name in ("gravity", "spring", "wrench"):
        added = full - efforts("limits", name)
        close_to(np.abs(found[name].peak), np.abs(added).max(axis=0), 1e-9)
        rms = np.sqrt(np.trapezoid(added**2, time, axis=0) / time[-1])
        close_to(found[name].rms, rms, 1e-9)
        close_to(found[name].share, rms / np.sqrt(np.trapezoid(full**2, time, axis=0) / time[-1]), 1e-9)
    without = full - efforts("limits", "inertia", "velocity", "rotor_inertia")
    close_to(np.abs(found["inertia"].peak), np.abs(without).max(axis=0), 1e-9)


@pytest.mark.slow
def test_compiled_models_give_the_same() -> None:
    """Each effect is left out once; models without inertia are refused, which the general path computes."""
    robot, q, v, a = near_home()
    on = choose(robot, ["default", fx.Spring(dict.fromkeys(robot.motors, 40.0)), fx.Limits({})])
    sets = EffectSets(hybridyn.compile(robot, on))
    general, compiled = (contributions(robot, q, v, a, on, sets=one) for one in (None, sets))
    whole = np.abs(hybridyn.idm(robot, q, v, a, effects=on)).max()
    for one, other in zip(general, compiled, strict=True):
        assert np.abs(one.peak - other.peak).max() < LINEAR * whole
    assert set(sets.refused) == {("gravity", "leg_inertia", "spring")}
    assert len(sets.models) + len(sets.refused) == 1 + len(general)
    assert not any("sample" in reason for reason in sets.refused.values())


CART_POLE = """<robot name="cart_pole"><link name="rail"/><link name="cart"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="pole"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-9" upper="9" effort="99" velocity="9"/></joint><joint name="swing" type="continuous">
<parent link="cart"/><child link="pole"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.slow
def test_compiled_models_too_say_what_a_passive_motion_needs(tmp_path: Path) -> None:
    """Gravity, inertia and velocity together determine the pole's motion; the robot has no legs."""
    robot = hybridyn.load(save(tmp_path, CART_POLE, "cart_pole.urdf"), motors=["slide"])
    rng = np.random.default_rng(3)
    q, v, tau = (rng.normal(size=(5, n)) for n in (robot.nq, robot.nv, 1))
    q[:, 1:] /= np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    a, on = hybridyn.ddm(robot, q, v, tau), choose(robot, None)
    sets = EffectSets(hybridyn.compile(robot))
    for own in (None, sets):
        parts = {part.name: part.peak for part in contributions(robot, q, v, a, on, sets=own)}
        needed = {name for name, peak in parts.items() if np.isnan(peak).all()}
        assert needed == {"gravity", "inertia", "velocity"}
        assert np.array_equal(parts["leg_inertia"], [0.0])
    assert len(sets.models) + len(sets.refused) > 1


def test_an_effect_that_a_passive_motion_needs_is_told() -> None:
    description = random_mechanism(0, kind="star_few")
    robot = build_robot(description)
    q, v, a = random_states(description, "fixed", 0, 2)
    assert all(np.isnan(part.peak).all() for part in contributions(robot, q, v, a, choose(robot, None)))


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "idm", "--by-effect", *FIVE_BAR)
    lines = [line.split() for line in said.out.splitlines()]
    names = choose(hybridyn.load(FIVE_BAR[0]), "model").names
    assert [row[0] for row in lines[1:]] == [name for name in names for _ in range(2)]
    assert "effects on: gravity, inertia" in said.err


def test_errors_name_the_sample_of_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sample number does not depend on the blocks."""
    robot, q, v, a = near_home()
    weight = np.abs(hybridyn.idm(robot, q, 0 * v, 0 * a, effects=["gravity", "leg_inertia"])).max()
    whole = contributions(robot, q, v, a, choose(robot, None))
    monkeypatch.setattr("hybridyn.streams.one_pass.NUMBERS_AT_ONCE", 2 * robot.nq)
    parts = contributions(robot, q, v, a, choose(robot, None))
    for one, other in zip(parts, whole, strict=True):
        assert np.abs(one.peak - other.peak).max() < LINEAR * weight
    q[3, 1] += 0.5
    again = partial(contributions, robot, q, v, a, choose(robot, None))
    refused(again, hybridyn.AssemblyError, "at sample 3", sample=3)
