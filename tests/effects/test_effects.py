"""effects: each law and all together, by power balance, by the other model, by hand and by limits."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import HybridRobot, ddm, idm
from hybridyn import effects as fx
from hybridyn.description.side_cars.tables import EFFECTS
from hybridyn.dynamics.energy import leg_bodies
from hybridyn.dynamics.link_motion import link_motions
from hybridyn.effects.catalogue import UNITS
from hybridyn.effects.choice import STANDARD, choose, names_on
from hybridyn.effects.words import DEFAULT, FROM_FILES, NAMES
from hybridyn.errors import ActuationError, ModelError, SingularityError, TrajectoryError
from hybridyn.streams.departures import departures
from hybridyn.structure.building import build_robot
from hybridyn.studies.sizing import Sizing, motor_rows
from hybridyn.studies.sweep.measures import of_motors
from hybridyn.view.panel import effort_limits
from tests.robots.effect_cases import CASES, every, rate_of
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import ROBOTS as SHIPPED
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import close_to, refused, same_bits
from tests.support.engines import engine_of
from tests.support.samples import slow

States = tuple[np.ndarray, np.ndarray, np.ndarray]
INERTIA = ["inertia", "leg_inertia", "velocity"]
THERE_AND_BACK = 1e-9  # ddm(idm(a)) = a loses the condition of A_t; measured 4e-12 at worst
BALANCE = 1e-9  # of the largest power: rounding of a difference over 1e-3 s, measured 5e-11
EXACT = 1e-12
ADDED = 1e-11  # sums of parts that are larger than the whole
ROBOTS = {"five_bar": "fixed", "scara_delta": "fixed", "gough_stewart": "floating", "stewart_ur5": "fixed"}


def prepared(name: str) -> tuple[HybridRobot, States]:
    """Return a shipped robot and three states of it."""
    description, base = shipped(name), ROBOTS.get(name, "fixed")
    return build_robot(description, base=base), states_near_home(description, base, 0, 3)


@pytest.fixture(params=list(ROBOTS), scope="module")
def drawn(request: pytest.FixtureRequest) -> tuple[HybridRobot, States]:
    return prepared(request.param)


def moved(robot: HybridRobot, states: States, effects: Any) -> tuple[States, np.ndarray]:
    """Return states and efforts that belong together; a free base accelerates as efforts let it."""
    q, v, a = states
    if robot.base != "floating":
        return states, idm(robot, q, v, a, effects=effects, time=0.7)
    tau = 20 * np.random.default_rng(1).normal(size=(len(q), len(robot.motors)))
    return (q, v, ddm(robot, q, v, tau, effects=effects, time=0.7)), tau


# -------------------------------------------------------------------- every effect, alone and together


@pytest.mark.parametrize("case", [*CASES, "all"])
def test_power_balance_and_there_and_back(drawn: tuple[HybridRobot, States], case: str) -> None:
    robot, states = drawn
    effects = [*INERTIA, *(every(robot) if case == "all" else CASES[case](robot))]
    (q, v, a), tau = moved(robot, states, effects)
    close_to(ddm(robot, q, v, tau, effects=effects, time=0.7), a, THERE_AND_BACK)
    supplied = hybridyn.power(robot, q, v, tau, effects=effects, time=0.7)

    def total(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return hybridyn.energy(robot, q, v, effects=effects).total

    gained = rate_of(robot, total, q, v, a)
    largest = max(np.abs(x).max() for x in (supplied.motors, supplied.wrenches, supplied.lost))
    assert np.abs(supplied.motors + supplied.wrenches - supplied.lost - gained).max() < BALANCE * largest
    assert (supplied.lost >= 0).all()
    if case == "all":
        assert choose(robot, effects).names == tuple(name for name in UNITS if name in (*INERTIA, *CASES))


@pytest.mark.parametrize("kind", ["on_leg", "rps3", "gear_two", "branched", "planar_rpr"])
def test_every_effect_on_random_mechanisms(kind: str) -> None:
    description = random_mechanism(0, kind=kind)
    robot, (q, v, a) = build_robot(description), random_states(description, "fixed", 0, 2)
    acting = {"effects": [*INERTIA, *every(robot)], "time": 0.7}
    close_to(ddm(robot, q, v, idm(robot, q, v, a, **acting), **acting), a, THERE_AND_BACK)


# -------------------------------------------------------------------- an absent effect runs none of its code


class Touched(Exception):  # noqa: N818
    """An effect's code ran."""


def raising(*_: object, **__: object) -> None:
    raise Touched


@pytest.mark.parametrize("name", UNITS)
def test_an_effect_that_is_off_runs_none_of_its_code(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, (q, v, a) = prepared("five_bar")
    units = {unit if isinstance(unit, str) else unit.name: unit for unit in every(robot)}
    units |= dict.fromkeys(INERTIA) | {"limits": fx.Limits(dict.fromkeys(robot.motors, 1e6))}
    on = {key: unit or key for key, unit in units.items() if key != name}
    if name == "leg_inertia":  # which is a part of gravity and inertia
        on["massless_legs"] = "massless_legs"
    if name == "inertia":
        on = {key: unit for key, unit in on.items() if key not in ("velocity", "rotor_inertia")}
    for method in dir(UNITS[name]):
        if callable(getattr(UNITS[name], method)) and not method.startswith("__"):
            monkeypatch.setattr(UNITS[name], method, raising)
    tau = idm(robot, q, v, a, effects=on.values(), time=0.7)
    if name != "inertia":
        ddm(robot, q, v, tau, effects=on.values(), time=0.7)
    if name in units:
        named = {key: unit for key, unit in on.items() if key != "massless_legs"} | {
            name: units[name] or name
        }
        refused(lambda: idm(robot, q, v, a, effects=named.values(), time=0.7), Touched, "")


@pytest.mark.parametrize(
    ("engine", "name"),
    [*(("general", name) for name in SHIPPED), *(slow("compiled", name) for name in SHIPPED)],
)
def test_named_effects_add_up_to_the_whole(engine: str, name: str) -> None:
    """Gravity is the weight of every body, and inertia that of every body; the legs' is a part of both."""
    description = shipped(name)
    robot, (q, v, a) = build_robot(description), states_near_home(description, "fixed", 0, 2)

    def efforts(*names: str) -> np.ndarray:
        if engine == "compiled" and not {"default", "inertia"} & {
            *names
        }:  # without which nothing is compiled
            return efforts("inertia", *names) - efforts("inertia", *names[1:])
        return np.asarray(engine_of(engine, robot, [*names]).idm(q, v, a))

    whole, size = efforts("default"), np.abs(efforts("default")).max()
    close_to(efforts("gravity") + efforts("inertia", "velocity"), whole, ADDED, size)
    close_to(efforts("gravity"), hybridyn.gravity(robot, q), ADDED, size)
    close_to(efforts("gravity"), engine_of(engine, robot).gravity(q), ADDED, size)
    bare = efforts("gravity", "massless_legs") + efforts("inertia", "velocity", "massless_legs")
    close_to(bare, efforts("default", "massless_legs"), ADDED, size)


def test_names_say_whether_legs_have_mass() -> None:
    """What a choice is called chooses the same again, also of what is left of it."""
    robot, _ = prepared("five_bar")
    whole = choose(robot, None)
    every = [
        (["gravity"], ("gravity", "leg_inertia")),
        (["inertia"], ("inertia", "leg_inertia")),
        (["default", "massless_legs"], ("gravity", "inertia", "massless_legs", "velocity")),
        (["default", fx.MasslessLegs()], ("gravity", "inertia", "massless_legs", "velocity")),
        (["leg_inertia"], ("leg_inertia",)),
        (whole.without("leg_inertia"), ("gravity", "inertia", "massless_legs", "velocity")),
        (whole.only(["gravity"]), ("gravity", "massless_legs")),
        (whole.only(["velocity"]), ("velocity",)),
    ]
    for given, names in every:
        on = choose(robot, given)
        assert on.names == names
        if "velocity" not in names or "inertia" in names:
            assert choose(robot, list(on.names)) == on


def test_nothing_named_is_nothing_computed() -> None:
    robot, (q, v, a) = prepared("scara_delta")
    assert not idm(robot, q, v, a, effects="none").any()
    assert choose(robot, None) is STANDARD
    assert tuple(UNITS) == NAMES
    assert set(choose(robot, None).names) < set(UNITS)
    np.testing.assert_array_equal(idm(robot, q, v, a, effects="default"), idm(robot, q, v, a))


# -------------------------------------------------------------------- each law by hand


def change(robot: HybridRobot, states: States, effect: Any) -> np.ndarray:
    """Return what an effect adds to the efforts of a robot."""
    q, v, a = states
    return idm(robot, q, v, a, effects=["default", effect], time=0.7) - idm(robot, q, v, a)


#: For each law the effort that motors must add, from the motors' positions, rates and accelerations.
BY_HAND: dict[str, tuple[Callable[[dict[str, float]], Any], Callable[..., np.ndarray]]] = {
    "rotor_inertia": (fx.RotorInertia, lambda c, q, v, a: c * a),
    "viscous_friction": (fx.ViscousFriction, lambda c, q, v, a: c * v),
    "coulomb_friction": (lambda c: fx.CoulombFriction(c, 0.4), lambda c, q, v, a: c * np.tanh(v / 0.4)),
    "stribeck_friction": (
        lambda c: fx.StribeckFriction(c, {m: 2 * x for m, x in c.items()}, dict.fromkeys(c, 0.5), 0.4),
        lambda c, q, v, a: (c + c * np.exp(-4 * v**2)) * np.tanh(v / 0.4),
    ),
    "directed_friction": (
        lambda c: fx.DirectedFriction(c, {m: 3 * x for m, x in c.items()}, 0.4),
        lambda c, q, v, a: c * (2 - np.tanh(v / 0.4)) * np.tanh(v / 0.4),
    ),
    "spring": (lambda c: fx.Spring(c, dict.fromkeys(c, 0.3)), lambda c, q, v, a: c * (q - 0.3)),
    "damper": (fx.Damper, lambda c, q, v, a: c * v),
    "stop": (
        lambda c: fx.Stop(c, 5.0, dict.fromkeys(c, -0.01), dict.fromkeys(c, 0.01)),
        lambda c, q, v, a: (
            c * np.clip(np.abs(q) - 0.01, 0, None) * np.sign(q) * np.clip(1 + 5.0 * v * np.sign(q), 0, None)
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BY_HAND)
def test_laws_by_hand(name: str) -> None:
    robot, (q, v, a) = prepared("scara_delta")
    numbers = np.linspace(3, 9, len(robot.motors))
    unit, law = BY_HAND[name]
    expected = law(numbers, q[:, robot.motor_q], v[:, robot.motor_v], a[:, robot.motor_v])
    actual = change(robot, (q, v, a), unit(dict(zip(robot.motors, numbers, strict=True))))
    close_to(actual, expected, 1e-11)  # a difference of efforts ten times as large


def test_numbers_of_the_files() -> None:
    robot, (q, v, a) = prepared("scara_delta")
    joints = {joint.name: joint for joint in robot.description.joints}
    records = [joints[motor] for motor in robot.motors]
    J = np.array([joint.rotor_inertia * joint.gear_ratio**2 for joint in records])
    c, f = np.array([(joint.damping, joint.friction) for joint in records]).T
    assert np.all([J, c, f])
    expected = J * a[:, robot.motor_v] + c * v[:, robot.motor_v] + f * np.tanh(v[:, robot.motor_v] / 1e-2)
    actual = idm(robot, q, v, a, effects="model") - idm(robot, q, v, a)
    close_to(actual, expected, 1e-11)


def test_an_endless_joint_is_wound_up_from_the_nearest_side() -> None:
    law = fx.Spring({"j": 2.0}, {"j": 3.0})
    p = np.array([[2.0], [3.0], [1.0]])
    close_to(
        law.effort(p, np.array([[-3.0]]), np.zeros((1, 1))), np.array([[2.0 * (6.0 - 2 * np.pi)]]), EXACT
    )


# -------------------------------------------------------------------- statics, velocity terms, massless legs


def test_statics_is_the_model_at_rest_and_the_direct_model_refuses_it() -> None:
    robot, (q, v, a) = prepared("five_bar")
    effects = ["gravity"]
    close_to(idm(robot, q, v, a, effects=effects), idm(robot, q, 0 * v, 0 * a), EXACT)
    for call, words in (
        (lambda: ddm(robot, q, v, np.zeros((3, 2)), effects=effects), "needs the effect 'inertia'"),
        (lambda: idm(robot, q, v, a, effects=effects, passive="solved"), "needs the effect 'inertia'"),
    ):
        refused(call, ModelError, words)


@pytest.mark.parametrize("name", ["five_bar", "scara_delta"])
def test_velocity_terms_off_keeps_the_drift_of_the_closures(name: str) -> None:
    robot, (q, v, a) = prepared(name)
    off = ["gravity", "inertia"]
    tau = idm(robot, q, v, a, effects=off)
    close_to(ddm(robot, q, v, tau, effects=off), a, THERE_AND_BACK)  # a holds the closures' drift
    assert np.abs(idm(robot, q, v, a) - tau).max() > 1e-3
    # Accelerations that close the loops at rest, the motors' those of a.
    given = [(x[robot.motor_q], None, x_ddot[robot.motor_v]) for x, x_ddot in zip(q, a, strict=True)]
    still = [hybridyn.assemble(robot, motors=m, guess=x)[2] for m, x in zip(given, q, strict=True)]
    at_rest = (q, 0 * v, np.array(still))
    close_to(idm(robot, *at_rest, effects=off), idm(robot, *at_rest), EXACT)


def test_velocity_terms_of_one_platform_by_hand() -> None:
    description = shipped("gough_stewart")
    robot = build_robot(description, base="fixed")
    q, v, a = states_near_home(description, "fixed", 0, 2)
    only = ["inertia", "massless_legs"]  # the platform alone
    gyroscopic = idm(robot, q, v, a, effects=[*only, "velocity"]) - idm(robot, q, v, a, effects=only)
    module = robot.modules[0]
    platform = module.outputs[0]
    body = robot.bodies.bodies[robot.bodies.place[platform][0]]
    motion = hybridyn.kinematics(robot, q, v, a, [platform])[platform]
    for t in range(2):
        pose = pin.XYZQUATToSE3(motion.pose[t])
        R, twist = pose.rotation, motion.twist[t]
        V = np.concatenate([R.T @ twist[:3], R.T @ twist[3:]])
        momentum = pin.Inertia(body.mass, body.com, body.inertia) * pin.Motion(V)
        wrench = pin.Motion(V).cross(momentum)
        # Virtual work: the efforts times the motors' rates are the wrench times the platform's twist.
        assert gyroscopic[t] @ v[t : t + 1][:, robot.motor_v][0] == pytest.approx(
            wrench.linear @ V[:3] + wrench.angular @ V[3:], abs=1e-9
        )
    assert np.abs(gyroscopic).max() > 1e-3


@pytest.mark.parametrize("name", ["gough_stewart", "delta"])
def test_massless_legs_are_the_limit_of_light_legs(name: str) -> None:
    robot, (q, v, a) = build_robot(shipped(name)), states_near_home(shipped(name), "fixed", 0, 3)
    without = ["default", "massless_legs"]
    massless = idm(robot, q, v, a, effects=without)
    legs = {robot.bodies.bodies[b].name for b in leg_bodies(robot)}
    errors = []
    for ratio in (1e-3, 1e-6):
        links = tuple(
            replace(link, mass=link.mass * ratio, inertia=link.inertia * ratio) if link.name in legs else link
            for link in robot.description.links
        )
        light = build_robot(replace(robot.description, links=links))
        errors.append(np.abs(idm(light, q, v, a) - massless).max())
        back = ddm(light, q, v, massless)
        forth = ddm(robot, q, v, massless, effects=without)
        close_to(forth, a, THERE_AND_BACK)
        assert np.abs(back - forth).max() < 100 * ratio * np.abs(forth).max()
    assert errors[1] == pytest.approx(errors[0] * 1e-3, rel=1e-2)


def test_a_robot_that_is_all_legs_has_no_inertia_without_them() -> None:
    robot, (q, v, _) = prepared("five_bar")
    refused(
        lambda: ddm(robot, q, v, np.ones((3, 2)), effects=["default", "massless_legs"]),
        SingularityError,
        "has no inertia",
    )


# -------------------------------------------------------------------- links


def test_wrenches_are_those_that_the_caller_may_give() -> None:
    robot, (q, v, a) = prepared("scara_delta")
    link, W = robot.description.links[-1].name, np.array([1.0, 2, 3, 0.4, 0.5, 0.6])
    expected = idm(robot, q, v, a, wrenches={link: W})
    np.testing.assert_array_equal(idm(robot, q, v, a, effects=["default", fx.Wrench(link, W)]), expected)
    table = fx.Wrench(link, [0 * W, 2 * W], [0.0, 1.0])
    close_to(idm(robot, q, v, a, effects=["default", table], time=0.5), expected, EXACT)
    two = idm(robot, q, v, a, wrenches={link: -W}, effects=["default", table], time=[0.5, 0.5, 0.5])
    close_to(two, idm(robot, q, v, a), EXACT)
    R = [pin.XYZQUATToSE3(x).rotation for x in hybridyn.kinematics(robot, q, v, links=[link])[link].pose]
    turned = np.array([np.concatenate([r.T @ W[:3], r.T @ W[3:]]) for r in R])
    in_world = idm(robot, q, v, a, effects=["default", fx.Wrench(link, W, frame="world")])
    close_to(in_world, idm(robot, q, v, a, wrenches={link: turned}), EXACT)


def test_the_ground_pushes_and_never_pulls() -> None:
    robot = build_robot(shipped("five_bar"), base="floating")
    description = robot.description
    link = description.root
    q, v = np.tile(robot.home, (4, 1)), np.zeros((4, robot.nv))
    q[:, 2] = [0.001, -0.002, -0.002, -0.002]
    v[2, 2], v[3, 2] = -1.0, 10.0  # pressed in, and torn out so fast that a plain damper would hold on
    v[1, 0] = 1.0
    law = fx.GroundContact({link: [[0.0, 0.0, 0.0]]}, stiffness=1e4, damping=0.2, friction=0.5, width=1e-3)
    on = choose(robot, [law])
    (wrenches,) = on.wrenches(link_motions(robot, q, v, on.observed_links), None, len(q))
    expected = np.zeros((4, 6))
    expected[1, [0, 2]] = -10.0, 20.0
    expected[2, 2] = 24.0
    close_to(wrenches[link], expected, EXACT)


# -------------------------------------------------------------------- what changes the robot or its input


def test_a_payload_is_a_heavier_link() -> None:
    robot, (q, v, a) = prepared("scara_delta")
    platform = robot.modules[-1].outputs[0]
    load = fx.Payload(platform, 0.7, (0.01, 0.02, -0.1), np.diag([0.01, 0.02, 0.02]))
    refused(lambda: idm(robot, q, v, a, effects=["default", load]), ModelError, "with_effects")
    heavier = hybridyn.with_effects(robot, ["default", load])
    assert hybridyn.with_effects(heavier, [load]) is heavier
    assert choose(heavier, [load]).names == ("payload",)
    # The same body as a wrench: what its weight and inertia need, on the link.
    expected = []
    motion = hybridyn.kinematics(robot, q, v, a, [platform])[platform]
    body = pin.Inertia(load.mass, np.array(load.com), np.array(load.inertia))
    for t in range(len(q)):
        R = pin.XYZQUATToSE3(motion.pose[t]).rotation
        V = pin.Motion(R.T @ motion.twist[t, :3], R.T @ motion.twist[t, 3:])
        A = motion.acceleration[t]
        linear = R.T @ (A[:3] - robot.gravity) - np.cross(V.angular, V.linear)
        force = body * pin.Motion(linear, R.T @ A[3:]) + V.cross(body * V)
        expected.append(-force.vector)
    close_to(idm(heavier, q, v, a), idm(robot, q, v, a, wrenches={platform: np.array(expected)}), 1e-11)


def test_limits_clip_and_refuse() -> None:
    robot, (q, v, a) = prepared("five_bar")
    tau = idm(robot, q, v, a)
    limits = fx.Limits(dict.fromkeys(robot.motors, 0.9 * np.abs(tau).max()))
    clipped = ddm(robot, q, v, tau, effects=["default", limits])
    bound = 0.9 * np.abs(tau).max()
    np.testing.assert_array_equal(clipped, ddm(robot, q, v, np.clip(tau, -bound, bound)))
    assert np.abs(clipped - ddm(robot, q, v, tau)).max() > 1e-3
    worst, limited = int(np.argmax(np.abs(tau).max(axis=1))), ["default", limits]
    refused(lambda: idm(robot, q, v, a, effects=limited), ActuationError, "would need", sample=worst)
    within = fx.Limits(dict.fromkeys(robot.motors, 1.1 * np.abs(tau).max()))
    np.testing.assert_array_equal(idm(robot, q, v, a, effects=["default", within]), tau)


@pytest.mark.parametrize("engine", ["general", slow("compiled")])
def test_a_limit_of_zero_in_a_file_is_none(engine: str) -> None:
    """URDF demands a number of `effort` and of `velocity`; those who have none write 0."""
    robot, (q, v, a) = prepared("five_bar")
    joints = tuple(replace(joint, effort=0.0, velocity=0.0) for joint in robot.description.joints)
    silent = build_robot(replace(robot.description, joints=joints))
    on = engine_of(engine, silent, ["default", "limits"])
    tau = on.idm(q, v, a)
    close_to(on.ddm(q, v, tau), a, THERE_AND_BACK)
    sizing = Sizing(silent)
    sizing.add(None, 0, *motor_rows(silent, q, v), tau)
    loads = sizing.loads()
    assert departures(silent, q, v, tau) == ()
    assert effort_limits(silent) == [np.inf, np.inf]
    assert [of_motors(f"{name}_margin", loads) for name in ("effort", "speed")] == [np.inf, np.inf]


def test_a_base_that_rolls_and_heaves() -> None:
    fixed, (q, v, a) = prepared("five_bar")
    time = np.linspace(0, 2, 41)
    half = 0.1 * np.sin(time)
    pose = np.column_stack(
        [0 * time, 0.2 * np.sin(2 * time), np.cos(time), np.sin(half), 0 * time, 0 * time, np.cos(half)]
    )
    motion = fx.BaseMotion(time, pose)
    robot = hybridyn.with_effects(fixed, [motion])
    assert robot.base == "moving"
    assert hybridyn.with_effects(robot, [motion]) is robot
    t = np.array([0.3, 1.0, 1.7])
    base_q, base_v, base_a = motion.at(t)
    close_to(base_q[:, 2], np.cos(t), 1e-8)  # the spline's own error
    close_to(base_v[:, 3], 0.2 * np.cos(t), 1e-6)
    close_to(base_a[:, 3], -0.2 * np.sin(t), 1e-4)
    classical = np.column_stack([0 * t, -0.8 * np.sin(2 * t), -np.cos(t)])
    R = np.array([pin.XYZQUATToSE3(x).rotation for x in base_q])
    spatial = base_a[:, :3] + np.cross(base_v[:, 3:], base_v[:, :3])
    close_to(np.einsum("tij,tj->ti", R, spatial), classical, 1e-4)
    zero = [np.concatenate([np.zeros((3, n)), x], axis=1) for n, x in ((7, q), (6, v), (6, a))]
    expected = idm(
        robot, *(np.concatenate([b, x], axis=1) for b, x in ((base_q, q), (base_v, v), (base_a, a)))
    )
    effects = ["default", motion]
    np.testing.assert_array_equal(idm(robot, *zero, effects=effects, time=t), expected)
    back = ddm(robot, zero[0], zero[1], expected, effects=effects, time=t)
    close_to(back[:, 6:], a, THERE_AND_BACK)
    close_to(back[:, :6], base_a, EXACT)
    for call, error, words in (
        (lambda: idm(robot, *zero, effects=effects, time=2.5), TrajectoryError, "outside"),
        (lambda: idm(robot, *zero, effects=effects), TrajectoryError, "pass time="),
        (lambda: idm(fixed, q, v, a, effects=effects, time=t), ModelError, "with_effects"),
    ):
        refused(call, error, words)


# -------------------------------------------------------------------- joints in wrists that were cut


def test_a_joint_with_an_effect_is_not_cut_away() -> None:
    description = shipped("gough_stewart")
    robot = build_robot(description)
    q, v, a = states_near_home(description, "fixed", 0, 2)
    joint = min(robot.cut_joints)
    effects = ["default", fx.Spring({joint: 50.0}, {joint: 0.2}), fx.Damper({joint: 3.0})]
    refused(lambda: idm(robot, q, v, a, effects=effects), ModelError, "held=")
    held = hybridyn.with_effects(robot, effects)
    assert held.held == {joint}
    assert joint not in held.cut_joints
    assert held.joints == robot.joints
    close_to(idm(held, q, v, a), idm(robot, q, v, a), 1e-10)
    tau = idm(held, q, v, a, effects=effects)
    close_to(ddm(held, q, v, tau, effects=effects), a, THERE_AND_BACK)
    at = held.v_slices[held.joint_index[joint]].start
    x = q[:, held.q_slices[held.joint_index[joint]].start]
    # Virtual work: what the motors add is what spring and damper take.
    added = np.sum((tau - idm(held, q, v, a)) * v[:, held.motor_v], axis=1)
    close_to(added, (50.0 * (x - 0.2) + 3.0 * v[:, at]) * v[:, at], 1e-9)


def test_effects_of_the_description_hold_their_joints() -> None:
    description = shipped("gough_stewart")
    joint = min(build_robot(description).cut_joints)
    stated = replace(
        description, effects=(("spring", {"stiffness": {joint: 50.0}}), ("coulomb_friction", {"width": 0.5}))
    )
    robot = build_robot(stated)
    chosen = choose(robot, "model")
    assert chosen.names == (*DEFAULT, "rotor_inertia", "viscous_friction", "coulomb_friction", "spring")
    rotors = replace(description, joints=tuple(replace(j, rotor_inertia=1.0) for j in description.joints))
    assert not build_robot(rotors).cut_joints
    widths = [law.effect.width for law in chosen.joints if isinstance(law.effect, fx.CoulombFriction)]
    assert widths == [0.5]
    refused(
        lambda: build_robot(description, held=["m1_leg1_wrist_w"]),
        ModelError,
        r"held: no such movable joint 'm1_leg1_wrist_w'.*did you mean",
    )


def test_ground_and_stops_of_the_description() -> None:
    description = shipped("five_bar")
    motor, link = description.motors[0], description.links[-1].name
    ground = {"points": {link: [[0.0, 0.0, 0.1]]}, "stiffness": 1e4}
    stop = {"stiffness": {motor: 10.0}, "lower": {motor: 0.1}}
    robot = build_robot(replace(description, effects=(("stop", stop), ("ground_contact", ground))))
    q, v, a = states_near_home(description, "fixed", 0, 2)
    objects = [
        "default",
        "rotor_inertia",
        "viscous_friction",
        "coulomb_friction",
        fx.Stop(**stop),
        fx.GroundContact(**ground),
    ]
    np.testing.assert_array_equal(idm(robot, q, v, a, effects="model"), idm(robot, q, v, a, effects=objects))
    assert choose(robot, ["stop"]).names == ("stop",)


def test_a_payload_of_the_description_is_part_of_the_robot() -> None:
    """Under any effects, once, however often the robot is rebuilt."""
    description = shipped("five_bar")
    load = {"link": "m1_tool", "mass": 0.4, "com": [0.0, 0.01, 0.02]}
    robot = build_robot(replace(description, effects=(("payload", load),)))
    carrying = hybridyn.with_effects(build_robot(description), [fx.Payload(**load)])
    q, v, a = states_near_home(description, "fixed", 0, 2)
    right = idm(carrying, q, v, a)
    for effects in (None, "model", ["default", "payload"]):
        again = hybridyn.with_effects(robot, effects)
        names = [name for name in choose(again, effects).names if "friction" not in name]
        np.testing.assert_array_equal(idm(again, q, v, a, effects=[*DEFAULT]), right)
        assert ("payload" in names) == (effects == ["default", "payload"])
        assert "payload" in names_on(robot, choose(robot, effects))
    lighter = robot.with_parameters({"payload_mass:m1_tool": 0.0})
    close_to(idm(lighter, q, v, a), idm(build_robot(description), q, v, a), EXACT)


@pytest.mark.parametrize("name", [name for name in UNITS if name not in DEFAULT])
def test_what_a_message_advises_is_accepted(name: str) -> None:
    """A table that an error asks for is one that model.toml knows, by its name."""
    robot, unstated = hybridyn.load("five_bar"), "state no numbers"
    if name == "massless_legs":  # it has no numbers
        assert choose(robot, ["default", name]).names == ("gravity", "inertia", name, "velocity")
    elif name in (*FROM_FILES, "limits"):
        assert choose(robot, ["default", name]).names[-1] == name
    else:
        words = refused(lambda: choose(robot, [name]), ModelError, unstated)
        assert (f"[effects.{name}]" in str(words)) == (name in EFFECTS)


# -------------------------------------------------------------------- mistakes


MISTAKES: dict[str, tuple[Callable[[HybridRobot], Any], str]] = {
    "unknown": (lambda r: ["gravty"], r"no effect 'gravty' \(did you mean 'gravity'\?\)"),
    "no effect": (lambda r: [3.0], "is no effect"),
    "no numbers": (lambda r: ["spring"], r"state no numbers for the effect 'spring'"),
    "unknown joint": (lambda r: [fx.Damper({"m1_left_driv": 1.0})], "joint 'm1_left_driv'.*did you mean"),
    "negative": (lambda r: [fx.Damper({r.motors[0]: -1.0})], "not negative"),
    "velocity alone": (lambda r: ["gravity", "velocity"], "'velocity' needs 'inertia'"),
    "rotors alone": (lambda r: [fx.RotorInertia({r.motors[0]: 1.0})], "'rotor_inertia' needs 'inertia'"),
    "width": (lambda r: [fx.CoulombFriction(width=0.0)], "width must be positive"),
    "static": (lambda r: [fx.StribeckFriction(*({r.motors[0]: x} for x in (2, 1, 1)))], "less than level"),
    "rest": (lambda r: [fx.Spring({}, {r.motors[0]: 1.0})], "'stiffness' does not"),
    "odd": (lambda r: [fx.StribeckFriction({r.motors[0]: 1.0})], "lack one of the law's numbers"),
    "stop": (lambda r: [fx.Stop(*({r.motors[0]: x} if x else 0.0 for x in (2, 0, 1, -1)))], "no limits"),
    "wrench link": (lambda r: [fx.Wrench("nowhere", [0.0] * 6)], "no such link 'nowhere'"),
    "ground link": (lambda r: [fx.GroundContact({"nowhere": [[0.0, 0, 0]]}, 1.0)], "no such link 'nowhere'"),
    "limit": (lambda r: [fx.Limits({"motor": 1.0})], "no motor 'motor'"),
    "bare number": (lambda r: [fx.CoulombFriction(3.0)], "level must have the form {'name': 1.0}, not 3.0"),
    "motors' number": (lambda r: [fx.DcMotors(torque_constant=0.1)], "dc_motors: torque_constant must have"),
    "word": (lambda r: [fx.LoadFriction({r.motors[0]: "x"})], "load_friction: radial must have the form"),
    "no name": (lambda r: [fx.Damper({1: 2.0})], "must have the form {'name': 1.0}, not {1: 2.0}"),
    "no number": (lambda r: [fx.CoulombFriction({}, width=None)], "width must be a number, not None"),
    "twice": (lambda r: [fx.Limits(), fx.Limits({})], "named 2 times"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_named(name: str) -> None:
    robot, (q, v, a) = prepared("five_bar")
    make, words = MISTAKES[name]
    refused(lambda: idm(robot, q, v, a, effects=make(robot)), ModelError, words)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fx.Wrench("link", [1.0, 2.0]), "six finite numbers"),
        (lambda: fx.Wrench("link", np.zeros((2, 6)), [1.0, 0.0]), "times grow"),
        (lambda: fx.Wrench("link", [0.0] * 6, frame="base"), "frame must be"),
        (lambda: fx.Payload("link", -1.0), "must not be negative"),
        (lambda: fx.Payload("link", 1.0, inertia=np.diag([1.0, 1.0, 3.0])), "no body has"),
        (lambda: fx.Payload("link", 1.0, com=(0.0, 1.0)), "com has 3 numbers"),
        (lambda: fx.Payload("link", "1 kg"), "payload: mass must be a number, not '1 kg'"),
        (lambda: fx.Wrench("link", "up"), r"wrench: wrench must have the form \[1.0, ...\], not 'up'"),
        (lambda: fx.GroundContact([[0.0, 0, 0]], 1.0), "ground_contact: points must have the form {'name': "),
        (
            lambda: fx.LineSprings({"l": 2}, {}),
            "line_springs: ends must have the form {'name': .'name', ....",
        ),
        (lambda: fx.Bushings({"b": "ab"}), "bushings: ends must have the form"),
        (lambda: fx.BaseMotion("now", {}), "base_motion: time must have the form"),
        (lambda: fx.GroundContact({"link": [[0.0, 0, 0]]}, -1.0), "stiffness must be"),
        *(
            (
                lambda shares=shares: fx.LineSprings(
                    {"l": ["a", "b"]}, {"l": [[0.0, 0, 0]] * 2}, shares={"l": shares}
                ),
                "'shares' of line 'l' needs 1 finite numbers",
            )
            for shares in ([1.0, 2.0], [-1.0], [0.0], [np.inf])
        ),
        (
            lambda: fx.BaseMotion([0.0, 1.0], np.tile([0, 0, 0, 0, 0, 0, 1.0], (2, 1))),
            "quintic spline needs 6",
        ),
        (lambda: fx.BaseMotion(np.arange(6.0), np.zeros((6, 7))), "length 1"),
    ],
)
def test_wrong_numbers_are_refused_at_once(make: Callable[[], Any], message: str) -> None:
    refused(make, ModelError, message)


def test_numbers_of_numpy_are_numbers() -> None:
    """Those of arrays without axes, too."""
    robot = hybridyn.load("five_bar")
    state = hybridyn.assemble(robot, motors=([0.1, 0.2], [0.5, -0.4], [0.0, 0.0]))
    name = robot.motors[0]
    same_bits(
        hybridyn.idm(robot, *state, effects=[fx.CoulombFriction({name: np.array(0.5)})]),
        hybridyn.idm(robot, *state, effects=[fx.CoulombFriction({name: 0.5})]),
    )
