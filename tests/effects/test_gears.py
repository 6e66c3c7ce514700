"""Losses of gears: the screw jack, both models against each other, balances of power, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import GearEfficiency, Limits, LoadFriction
from hybridyn.errors import ActuationError, ModelError
from hybridyn.scenes.controllers import ComputedTorque
from hybridyn.scenes.references import RestPosture, from_points
from hybridyn.structure.building import build_robot
from tests.effects.test_friction_statics import SPEED, X, linkage
from tests.effects.test_load_friction import ANGLE, at_speed, wedge
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import close_to

ROUNDED = 1e-12
WEIGHT, RADIUS, LEAD = 800.0, 0.01, 0.12  # of a jack's screw: load [N], mean radius [m], lead angle [rad]


@pytest.mark.parametrize("phi", [0.05, LEAD * (1 - ANGLE), LEAD, LEAD * (1 + ANGLE), 0.2])
def test_a_screw_jack_lifts_and_lowers_as_its_friction_angle_says(phi: float) -> None:
    """W r tan(lead + phi) up, W r tan(lead - phi) down: from phi = lead on it locks itself."""
    robot = linkage(
        [("screw", "screw", "ground", "nut", (0, 0), X)], [], ["screw"], pitch=RADIUS * np.tan(LEAD)
    )
    up, down = np.tan(LEAD) / np.tan(LEAD + phi), np.tan(LEAD - phi) / np.tan(LEAD)
    gear = GearEfficiency({"screw": up}, back={"screw": down})
    load = {"nut": np.array([-WEIGHT, 0, 0, 0, 0, 0])}
    q, v, a = hybridyn.assemble(robot, motors={"screw": (0.0, SPEED, 0.0)})
    for sign in (1.0, -1.0):
        tau = hybridyn.idm(robot, q, sign * v, a, wrenches=load, effects=[gear])
        assert abs(tau[0] - WEIGHT * RADIUS * np.tan(LEAD + sign * phi)) <= ROUNDED * WEIGHT * RADIUS
        moving = {"effects": ["inertia", gear], "wrenches": load}
        if phi < LEAD:
            least = 1.0 if sign > 0 else 1.0 / down  # the gear divides the effort, which is rounded
            close_to(hybridyn.ddm(robot, q, sign * v, tau, **moving), a, ROUNDED, least)
        else:
            with pytest.raises(ActuationError, match="gear of 'screw' locks itself at sample 0"):
                hybridyn.ddm(robot, q[None], sign * v[None], tau[None], **moving)


def test_the_default_back_is_that_of_the_same_friction_both_ways() -> None:
    robot = build_robot(shipped("five_bar"))
    q, v, a = states_near_home(robot.description, "fixed", 0, 3)
    one, other = (GearEfficiency(dict.fromkeys(robot.motors, 0.8), back) for back in (
        None, dict.fromkeys(robot.motors, 0.75)))  # fmt: skip
    close_to(*(hybridyn.idm(robot, q, v, a, effects=["default", gear]) for gear in (one, other)), ROUNDED)


@pytest.mark.parametrize("kind", ["branched", "five_bar"])
def test_motors_give_what_gears_and_bearings_waste(kind: str) -> None:
    """`ddm` inverts `idm`; `power` tells what motors give more than without; it is never negative."""
    robot = build_robot(random_mechanism(5, kind=kind))
    q, v, a = random_states(robot.description, "fixed", 5, 4)
    kinds = dict(zip(robot.joints, robot.kinds, strict=True))
    rubbing = LoadFriction(radial={j: 2e-3 for j, kind in kinds.items() if kind.hinge and kind.single})
    effects = ["default", rubbing, GearEfficiency(dict.fromkeys(robot.motors, 0.7))]
    tau, plain = (hybridyn.idm(robot, q, v, a, effects=chosen) for chosen in (effects, None))
    close_to(hybridyn.ddm(robot, q, v, tau, effects=effects), a, 1e-10)
    balance = hybridyn.power(robot, q, v, tau, effects=effects)
    more = np.sum((tau - plain) * v[:, robot.motor_v], axis=1)
    assert (balance.lost >= 0).all()
    assert np.abs(balance.lost - more).max() <= 1e-10 * np.abs(balance.motors).max()
    reverse = hybridyn.power(robot, q, -v, hybridyn.idm(robot, q, -v, a, effects=effects), effects=effects)
    assert (reverse.lost >= 0).all()


def test_simulated_energy_changes_by_what_motors_give_and_losses_take() -> None:
    """Trapezoids of the power, against the energy."""
    robot = build_robot(shipped("five_bar"))
    hinges = [j for j, kind in zip(robot.joints, robot.kinds, strict=True) if kind.hinge]
    effects = [
        "default", LoadFriction(radial=dict.fromkeys(hinges, 2e-3), width=0.2),
        GearEfficiency(dict.fromkeys(robot.motors, 0.8), width=0.2),
    ]  # fmt: skip
    q, v, _ = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, (0.0, 1.0, 0.0)))
    times, tau = np.linspace(0, 0.004, 5), np.array([0.3, -0.1])
    run = hybridyn.simulate(robot, q, v, times, effort=tau, effects=effects)
    every = np.tile(tau, (len(times), 1))
    balance = hybridyn.power(robot, run.q, run.v, every, effects=effects)
    stored = hybridyn.energy(robot, run.q, run.v, effects=effects).total
    gained = np.trapezoid(balance.motors - balance.lost, times)
    wasted = np.trapezoid(balance.lost, times)
    assert wasted > 0.02 * abs(stored[-1] - stored[0])
    assert abs(stored[-1] - stored[0] - gained) < 1e-4 * wasted


@pytest.mark.parametrize(
    ("gear", "said"),
    [
        (GearEfficiency({"elbow": 0.9}), "there is no motor 'elbow'"),
        (GearEfficiency({f"odd_{i}": 0.9 for i in range(100)}), "there is no motor 'odd_0'"),  # in order
        (GearEfficiency({"m1_right_drive": 0.0}), "efficiency must be above 0 and at most 1, not 0"),
        (GearEfficiency({"m1_right_drive": 1.2}), "efficiency must be above 0 and at most 1"),
        (GearEfficiency({"m1_right_drive": 0.9}, back={"m1_right_drive": 1.5}), "back must be a number of"),
        (GearEfficiency({"m1_right_drive": 0.9}, back={}), "back must be a number of at most 1, not nan"),
        (GearEfficiency({}, back={"m1_right_drive": 0.9}), "has back and no efficiency"),
        (GearEfficiency({"m1_right_drive": 0.9}, width=0.0), "width must be positive"),
    ],
)  # fmt: skip
def test_bad_numbers_are_refused(gear: GearEfficiency, said: str) -> None:
    robot = build_robot(shipped("five_bar"))
    q, v, a = states_near_home(robot.description, "fixed", 0, 1)
    with pytest.raises(ModelError, match=said):
        hybridyn.idm(robot, q, v, a, effects=["default", gear])


def test_the_robot_s_files_may_state_it_and_limits_are_those_of_motors(tmp_path: Path) -> None:
    lifted = wedge(tmp_path, 0.6, lifted=True)
    stated = "[effects.gear_efficiency]\nefficiency = { drive = 0.5 }\n"
    (tmp_path / "wedge.model.toml").write_text(stated)
    robot = hybridyn.load(tmp_path / "wedge.urdf")
    q, v, a = at_speed(robot, SPEED)
    plain, tau = (hybridyn.idm(one, q, v, a, effects="model") for one in (lifted, robot))
    assert tau == pytest.approx(2 * plain, rel=ROUNDED)
    with pytest.raises(ActuationError, match="motor 'drive' would need"):
        hybridyn.idm(robot, q, v, a, effects=["model", Limits({"drive": 1.5 * float(plain[0])})])


def test_computed_torque_that_knows_the_losses_gives_the_motion_that_it_asks_for() -> None:
    """Without gains that is the reference's acceleration: a quintic from rest to rest, at a quarter."""
    robot = build_robot(shipped("five_bar"))
    effects = [
        "default", LoadFriction(radial=dict.fromkeys(robot.motors, 0.01)),
        GearEfficiency(dict.fromkeys(robot.motors, 0.7)),
    ]  # fmt: skip
    q, v, _ = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, (0.1, 0.3, 0.0)))
    goal = RestPosture(0.2, dict(zip(robot.motors, (0.3, -0.1), strict=True)), {})
    control = ComputedTorque(robot, from_points(robot, [goal], q), 0.0, 0.0, effects)
    a = hybridyn.ddm(robot, q, v, control(0.05, q, v), effects=effects)
    asked = np.array([0.2, -0.2]) / 0.2**2 * (60 * 0.25 - 180 * 0.25**2 + 120 * 0.25**3)
    close_to(a[robot.motor_v], asked, 1e-9)
