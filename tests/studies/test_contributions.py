"""`hybridyn idm --by-effect`: parts of the efforts against the inverse model, a smaller set, the command."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import effects as fx
from hybridyn.effects.choice import choose
from hybridyn.structure.building import build_robot
from hybridyn.studies import effect_worth
from hybridyn.studies.effect_worth import EffectSets, Selection, Worth
from tests import ROOT
from tests.clocks import Clock
from tests.command_line import call, read_table, table_text, without_remarks
from tests.comparing import close_to, refused
from tests.effect_cases import every
from tests.files import save
from tests.mechanisms import random_mechanism, random_states
from tests.shipped import shipped, states_near_home

FIVE_BAR = [str(ROOT / "urdf/five_bar.urdf.xacro"), str(ROOT / "models/five_bar/traj.csv")]
LINEAR = 1e-11  # sums of efforts instead of efforts of sums


def near_home() -> tuple[hybridyn.HybridRobot, np.ndarray, np.ndarray, np.ndarray]:
    """Return the five-bar with five states."""
    description = shipped("five_bar")
    return build_robot(description), *states_near_home(description, "fixed", 0, 5)


@pytest.fixture(scope="module")
def worth() -> Worth:
    robot, q, v, a = near_home()
    on = choose(robot, ["model", *every(robot), fx.Limits(dict.fromkeys(robot.motors, 1e6))])
    return Worth(robot, q, v, a, on, time=np.full(5, 0.7))


def test_contributions_are_differences(worth: Worth) -> None:
    found = {part.name: part for part in worth.contributions()[0]}
    assert tuple(found) == worth.names
    assert "limits" not in found
    for name in ("gravity", "spring", "wrench"):
        added = worth.full - worth.run(frozenset(worth.names) - {name})
        close_to(np.abs(found[name].peak), np.abs(added).max(axis=0), 1e-9)
        close_to(found[name].rms, np.sqrt(np.mean(added**2, axis=0)), 1e-9)
        close_to(found[name].share, found[name].rms / np.sqrt(np.mean(worth.full**2, axis=0)), 1e-9)
    without = worth.full - worth.run(frozenset(worth.names) - {"inertia", "velocity", "rotor_inertia"})
    close_to(np.abs(found["inertia"].peak), np.abs(without).max(axis=0), 1e-9)


def test_a_sufficient_set_stays_within(worth: Worth) -> None:
    peaks = np.abs(worth.full).max(axis=0)
    for within in (0.0, 0.05, 0.5, 1e9):
        chosen = worth.sufficient(within)
        error = np.abs(worth.run(frozenset(chosen.names)) - worth.full).max(axis=0) / peaks
        assert chosen.deviation <= within * (1 + LINEAR) + LINEAR
        assert chosen.deviation == pytest.approx(error.max(), abs=LINEAR)
    assert set(worth.sufficient(0.0).names) == set(worth.names)
    assert len(worth.sufficient(1e9).names) < len(worth.names) / 2


@pytest.mark.slow
def test_compiled_models_give_the_same() -> None:
    """Each effect is left out once; models without inertia are refused, which the general path computes."""
    robot, q, v, a = near_home()
    on = choose(robot, ["default", fx.Spring(dict.fromkeys(robot.motors, 40.0)), fx.Limits({})])
    sets = EffectSets(hybridyn.compile(robot, on))
    general, compiled = Worth(robot, q, v, a, on), Worth(robot, q, v, a, on, compiled=sets)
    for one, other in zip(general.contributions()[0], compiled.contributions()[0], strict=True):
        assert np.abs(one.peak - other.peak).max() < LINEAR * np.abs(general.full).max()
    assert set(sets.refused) == {("gravity", "leg_inertia", "spring")}
    assert len(sets.models) + len(sets.refused) == 1 + len(general.names)
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
    general, compiled = Worth(robot, q, v, a, on), Worth(robot, q, v, a, on, compiled=sets)
    for found in (general, compiled):
        parts = {part.name: part.peak for part in found.contributions()[0]}
        needed = {name for name, peak in parts.items() if np.isnan(peak).all()}
        assert needed == {"gravity", "inertia", "velocity"}
        assert np.array_equal(parts["leg_inertia"], [0.0])
    assert len(sets.models) + len(sets.refused) > 1


def test_an_effect_that_a_passive_motion_needs_is_kept() -> None:
    description = random_mechanism(0, kind="star_few")
    robot = build_robot(description)
    q, v, a = random_states(description, "fixed", 0, 2)
    found = Worth(robot, q, v, a, choose(robot, None))
    assert set(found.sufficient(0.9).names) == set(found.names)
    assert all(np.isnan(part.peak).all() for part in found.contributions()[0])


def test_the_command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    said = call(capsys, "idm", "--by-effect", *FIVE_BAR, "--within", "100%")
    lines = [line.split() for line in said.out.splitlines()]
    names = choose(hybridyn.load(FIVE_BAR[0]), "model").names
    assert [row[0] for row in lines[1 : 1 + 2 * len(names)]] == [name for name in names for _ in range(2)]
    assert "sufficient within 1 of the peak efforts: --effects" in said.out
    assert "effects on: gravity, inertia" in said.err
    selection = Selection(("gravity",), 0.25, 1, 1e-6, 2e-6)
    monkeypatch.setattr(Worth, "sufficient", lambda self, within: selection)
    monkeypatch.setattr(effect_worth, "clock", Clock())  # it stands still, as coarse ones do
    said = call(capsys, "idm", "--by-effect", *FIVE_BAR, "--effects", "default", "--within", "0.3")
    told = "--effects gravity; largest departure 0.25 (motor m1_right_drive); 1.0 us"
    assert told in said.out.splitlines()[-1]


def test_errors_name_the_sample_of_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sample number does not depend on the blocks."""
    robot, q, v, a = near_home()
    weight = np.abs(hybridyn.idm(robot, q, 0 * v, 0 * a, effects=["gravity", "leg_inertia"])).max()
    whole = Worth(robot, q, v, a, choose(robot, None))
    monkeypatch.setattr("hybridyn.streams.one_pass.NUMBERS_AT_ONCE", 2 * robot.nq)
    parts = Worth(robot, q, v, a, choose(robot, None))
    assert np.abs(parts.full - whole.full).max() < LINEAR * weight
    q[3, 1] += 0.5
    refused(
        lambda: Worth(robot, q, v, a, choose(robot, None)), hybridyn.AssemblyError, "at sample 3", sample=3
    )


@pytest.mark.slow
def test_effects_of_idm_and_ddm(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    efforts = call(capsys, "idm", *FIVE_BAR, "--effects", "model")
    assert "effects on: gravity, inertia, leg_inertia, velocity, rotor_inertia, v" in efforts.err
    robot, tau = hybridyn.load(FIVE_BAR[0]), read_table(efforts.out)
    motion = read_table(without_remarks(FIVE_BAR[1]))
    rates = ("position", "velocity", "acceleration")
    motors = {m: tuple(motion[f"{m}/{rate}"][:20] for rate in rates) for m in robot.motors}
    tau = {m: tau[f"{m}/effort"][:20] for m in robot.motors}
    q, v, a = hybridyn.assemble(robot, motors=motors)
    wanted = hybridyn.idm(robot, q, v, a, effects="model")
    close_to(np.column_stack([*tau.values()]), wanted, 1e-9)
    columns = [f"{m}/{rate}" for m in robot.motors for rate in ("position", "velocity", "effort")]
    rows = np.column_stack([x for m in robot.motors for x in (*motors[m][:2], tau[m])])
    states = save(tmp_path, table_text(columns, rows), "states.csv")
    back = call(capsys, "ddm", FIVE_BAR[0], states, "--effects", "model")
    assert "effects on: gravity" in back.err
    found = np.column_stack([read_table(back.out)[f"{m}/acceleration"] for m in robot.motors])
    close_to(found, np.column_stack([motors[m][2] for m in robot.motors]), 1e-8)
    said = call(capsys, "ddm", FIVE_BAR[0], states, "--effects", "gravity", status=1)
    assert "needs the effect 'inertia'" in said.err
