"""DC motors: stall, no-load and steady speed of a wheel in closed form, powers, reports, refusals."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import CoulombFriction, DcMotors, GearEfficiency, ViscousFriction
from hybridyn.errors import ActuationError, ModelError
from hybridyn.structure.building import build_robot
from tests.effects.test_friction_statics import Z, linkage
from tests.robots.shipped import shipped, states_near_home
from tests.studies.test_motor_sizing import HEADER, MASS, RATIO, robot_text, swing
from tests.support.command_line import call, table_text
from tests.support.files import save

ROUNDED = 1e-12
INTEGRATED = 1e-6  # of the default method of `simulate`
K, R, U, N = 0.05, 0.8, 24.0, -30.0  # N m/A, Ohm, V, and a gear that turns the other way
STALL, FASTEST, DRAG = abs(N) * K * U / R, U / (abs(N) * K), (N * K) ** 2 / R
FULL = 1e4  # more than the motor gives


def wheel() -> hybridyn.HybridRobot:
    """Return a wheel of inertia 1 about the axis of its motor."""
    robot = linkage([("axle", "revolute", "ground", "wheel", (0, 0), Z)], [], ["axle"])
    joints = tuple(replace(joint, gear_ratio=N) for joint in robot.description.joints)
    return build_robot(replace(robot.description, joints=joints))


def motor(**limits: float) -> DcMotors:
    return DcMotors({"axle": K}, {"axle": R}, **{word: {"axle": x} for word, x in limits.items()})


def accelerations(effort: float, speeds: list[float], *effects: Any) -> np.ndarray:
    """Return the accelerations of the wheel, which are its torques."""
    v = np.array(speeds)[:, None]
    tau = np.full_like(v, effort)
    return hybridyn.ddm(wheel(), np.zeros_like(v), v, tau, effects=["inertia", *effects])[:, 0]


def test_torque_falls_from_stall_to_no_load_speed_and_brakes_beyond() -> None:
    speeds = [0.0, FASTEST / 3, FASTEST, 2 * FASTEST, -FASTEST]
    parts = np.array([1, 2 / 3, 0, -1, 2])
    got = accelerations(FULL, speeds, motor(voltage=U))
    assert got == pytest.approx(STALL * parts, abs=ROUNDED * STALL)
    assert accelerations(-FULL, [-x for x in speeds], motor(voltage=U)) == pytest.approx(-got, abs=0)
    assert accelerations(0.3 * STALL, speeds, motor(voltage=U))[:2] == pytest.approx(0.3 * STALL, abs=ROUNDED)


def test_the_current_limit_is_a_flat_part_which_the_supply_overrules() -> None:
    limit = 0.4 * U / R
    got = accelerations(
        FULL, [0.0, 0.5 * FASTEST, 0.9 * FASTEST, 2 * FASTEST], motor(voltage=U, current=limit)
    )
    assert got == pytest.approx(STALL * np.array([0.4, 0.4, 0.1, -1.0]), abs=ROUNDED * STALL)
    held = accelerations(-FULL, [0.9 * FASTEST], motor(current=limit))  # a supply without a limit
    assert held == pytest.approx(-0.4 * STALL, abs=ROUNDED * STALL)


def test_the_no_load_speed_of_a_datasheet_is_that_with_the_friction_of_its_no_load_current() -> None:
    idle = 0.5
    rubbing = CoulombFriction({"axle": abs(N) * K * idle}, width=1e-6)
    reached = (U - R * idle) / (abs(N) * K)
    assert abs(accelerations(FULL, [reached], motor(voltage=U), rubbing)[0]) < ROUNDED * STALL


def test_a_wheel_runs_up_to_its_steady_speed_and_the_powers_balance() -> None:
    """Its speed is w_steady (1 - exp(-t / T)) with T = J / (c + (n k)^2 / R), against a load c w + L."""
    robot, c, load = wheel(), 0.7, 0.2 * STALL
    effects = ["inertia", motor(voltage=U), ViscousFriction({"axle": c})]
    steady, T = (STALL - load) / (c + DRAG), 1 / (c + DRAG)
    push = {"wheel": np.array([0, 0, 0, 0, 0, -load])}
    times = np.linspace(0, 20 * T, 21)
    run = hybridyn.simulate(
        robot, np.zeros(1), np.zeros(1), times, effort=np.array([FULL]), effects=effects, wrenches=push
    )
    speed = steady * (1 - np.exp(-times / T))
    assert run.v[:, 0] == pytest.approx(speed, abs=INTEGRATED * steady)
    assert run.tau[:, 0] == pytest.approx(STALL - DRAG * speed, abs=INTEGRATED * STALL)
    took = hybridyn.motor_currents(robot, run.v, run.tau, effects=effects)
    assert took.motors == ("axle",)
    assert took.voltage == pytest.approx(-U, abs=INTEGRATED * U)  # the gear turns the rotor backwards
    assert took.current[:, 0] == pytest.approx(-(U - abs(N) * K * speed) / R, abs=INTEGRATED * U / R)
    given = hybridyn.power(robot, run.q, run.v, run.tau, effects=effects, wrenches=push)
    assert took.supplied[:, 0] == pytest.approx(given.motors + took.heat[:, 0], abs=ROUNDED * U * U / R)
    end = [took.supplied[-1, 0], took.heat[-1, 0] + given.lost[-1] + load * run.v[-1, 0]]
    assert end[0] == pytest.approx(end[1], rel=10 * INTEGRATED)


def test_efforts_are_those_before_the_gear_and_a_motion_that_needs_too_much_is_named() -> None:
    robot = build_robot(shipped("five_bar"))
    q, v, a = states_near_home(robot.description, "fixed", 0, 5)
    (ratio,) = {robot.records[motor].gear_ratio for motor in robot.motors}
    assert ratio == 10
    every = {
        word: dict.fromkeys(robot.motors, x) for word, x in (("torque_constant", 0.2), ("resistance", 1.5))
    }
    gear = GearEfficiency(dict.fromkeys(robot.motors, 0.8))
    effects = ["default", gear, DcMotors(**every)]
    tau = hybridyn.idm(robot, q, v, a, effects=effects)
    assert (tau == hybridyn.idm(robot, q, v, a, effects=["default", gear])).all()
    need = hybridyn.motor_currents(robot, v, tau, effects=effects)
    assert need.current == pytest.approx(tau / (0.2 * ratio), rel=ROUNDED)
    assert need.voltage == pytest.approx(
        1.5 * tau / (0.2 * ratio) + 0.2 * ratio * v[:, robot.motor_v], rel=ROUNDED
    )
    for word, unit, needed in (("voltage", "V", need.voltage), ("current", "A", need.current)):
        t, i = np.unravel_index(int(np.abs(needed).argmax()), needed.shape)
        for share in (1 + 1e-9, 0.9):
            limits = {word: dict.fromkeys(robot.motors, share * abs(needed[t, i]))}
            bound = ["default", gear, DcMotors(**every, **limits)]
            if share > 1:  # within its limits both models invert one another
                hybridyn.idm(robot, q, v, a, effects=bound)
                back = hybridyn.ddm(robot, q, v, tau, effects=bound)
                assert back == pytest.approx(a, abs=1e-9 * np.abs(a).max())
                continue
            said = rf"motor '{robot.motors[i]}' would need {needed[t, i]:.6g} {unit} at sample {t}"
            with pytest.raises(ActuationError, match=said):
                hybridyn.idm(robot, q, v, a, effects=bound)


@pytest.mark.parametrize(
    ("dc", "said"),
    [
        (DcMotors({"elbow": 0.1}, {"elbow": 1.0}), "there is no motor 'elbow'"),
        (DcMotors({"axle": 0.0}, {"axle": 1.0}), "torque_constant of 'axle' must be positive, not 0"),
        (DcMotors({"axle": 0.1}), "'axle' lack one of the law's numbers"),
        (DcMotors({}, {}, {"axle": 24.0}), "motor 'axle' has no torque_constant"),
        (motor(voltage=np.nan), "voltage of 'axle' must be positive, not nan"),
        (motor(current=-1.0), "current of 'axle' must be positive, not -1"),
    ],
)
def test_bad_numbers_are_refused(dc: DcMotors, said: str) -> None:
    with pytest.raises(ModelError, match=said):
        accelerations(0.0, [0.0], dc)


def test_who_has_no_use_for_motors_leaves_them_out_and_compiled_models_refuse_them() -> None:
    robot, effects = wheel(), ["inertia", motor(voltage=U)]
    assert hybridyn.mass_matrix(robot, np.zeros(1), effects=effects) == pytest.approx(1.0)
    with pytest.raises(ModelError, match="compiled models do not take the effect 'dc_motors'"):
        hybridyn.compile(robot, effects=effects)
    with pytest.raises(ModelError, match="motor_currents needs the effect 'dc_motors'"):
        hybridyn.motor_currents(robot, np.zeros(1), np.zeros(1))


def test_commands_write_currents_and_voltages_and_tell_what_is_beyond(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mass on a slide, x = A sin w t: peaks of current and voltage in closed form."""
    A, w, k, R = 0.05, 7.0, 0.04, 0.5
    robot = save(tmp_path, robot_text("prismatic"), "single.urdf")
    motion = save(tmp_path, table_text(HEADER, swing(A, w, 1, 2401)), "motion.csv")
    stated = "[effects.dc_motors]\ntorque_constant = {{ drive = {} }}\nresistance = {{ drive = {} }}\n{}"
    side_car = tmp_path / "single.model.toml"
    side_car.write_text(stated.format(k, R, ""))
    call(capsys, "idm", robot, motion, "--effects", "model", "-o", tmp_path / "efforts.csv")
    with (tmp_path / "efforts.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [*rows[0]] == ["time", "drive/effort", "drive/current", "drive/voltage"]
    both = save(tmp_path, _joined(motion.read_text(), (tmp_path / "efforts.csv").read_text()), "both.csv")
    call(capsys, "ddm", robot, both, "-o", tmp_path / "back.csv")  # what idm wrote beside efforts is skipped
    call(capsys, "idm", robot, motion, "--map", "drive", "--effects", "model", "-o", tmp_path / "map.csv")
    with (tmp_path / "map.csv").open() as file:
        mapped = list(csv.DictReader(file))
    for name in ("drive/current", "drive/voltage"):
        assert [row[name] for row in mapped] == [row[name] for row in rows]
    current, back = MASS * A * w**2 / (k * RATIO), k * RATIO * A * w
    assert max(float(row["drive/current"]) for row in rows) == pytest.approx(current, rel=ROUNDED)
    peak = np.hypot(R * current, back)
    side_car.write_text(stated.format(k, R, f"voltage = {{ drive = {0.9 * peak} }}"))
    refused = call(capsys, "idm", robot, motion, "--effects", "model", status=1)
    assert "motor 'drive' would need" in refused.err
    said = call(capsys, "idm", robot, motion, "--loads", "-o", tmp_path / "loads.json", status=1)
    assert "joint 'drive' leaves its limits: voltage of" in said.out
    (found,) = json.loads((tmp_path / "loads.json").read_text())
    assert abs(found["peak_voltage"]) == pytest.approx(peak, rel=1e-6)  # 2,400 samples: (pi / 2400)^2 / 2
    assert found["rms_current"] == pytest.approx(current / np.sqrt(2), rel=ROUNDED)
    assert found["heat"] == pytest.approx(R * current**2 / 2, rel=ROUNDED)
    assert found["over_voltage"] > 0 == found["over_current"]


def _joined(one: str, other: str) -> str:
    """Put the columns of two tables of the same times beside each other."""
    pairs = zip(one.splitlines(), other.splitlines(), strict=True)
    return "\n".join(f"{a},{b.partition(',')[2]}" for a, b in pairs) + "\n"


def test_a_dc_motor_without_a_gear_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = save(tmp_path, robot_text("revolute").replace(f">{RATIO}<", ">1<"), "single.urdf")
    assert hybridyn.load(robot).records["drive"].gear_ratio == 1
    motion = save(tmp_path, table_text(HEADER, swing(0.1, 1.0, 1, 41)), "motion.csv")
    stated = "[effects.dc_motors]\ntorque_constant = { drive = 0.1 }\nresistance = { drive = 1.0 }\n"
    (tmp_path / "single.model.toml").write_text(stated)
    said = call(capsys, "idm", robot, motion, "--effects", "model", "-o", tmp_path / "efforts.csv")
    assert "no gear ratio is stated for 'drive'" in said.err
