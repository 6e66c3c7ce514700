"""Friction that grows with load, against wedges, the balance of every joint, and its own limits."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import BaseMotion, LoadFriction
from hybridyn.errors import ActuationError, ModelError
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import close_to
from tests.support.files import save

DRIVE = {"m1_right_drive": 0.1}
FAST = 40.0  # widths of the smoothed sign: tanh(40) is 1
ROUNDED = 1e-12  # of the largest: differences of loads, and a factor 1 / (1 - ratio) near a limit
ANGLE = 1e-12  # of the self-locking angle, within which a joint begins to jam
G = 9.81

LINK = '<link name="{}"><inertial><mass value="{}"/><inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial></link>'  # noqa: E501
SLIDE = (
    '<joint name="{}" type="prismatic"><parent link="{}"/><child link="{}"/><axis xyz="{}"/>'
    '<limit lower="-9" upper="9" effort="1e9" velocity="99"/></joint>'
)
END = '<transmission name="t"><type>x</type><joint name="{}"/><actuator name="m"/></transmission></robot>'


def wedge(tmp_path: Path, angle: float, *, lifted: bool) -> hybridyn.HybridRobot:
    """A cart on the ground carries a block on its ramp; a guide keeps straight the way of who is not driven.

    Args:
        angle: Slope of the ramp [rad].
        lifted: Whether the motor pushes the cart; else it moves the block.
    """
    ramp = f"{-np.cos(angle):.17g} 0 {np.sin(angle):.17g}"
    first, second, way, row = ("cart", "block", "1 0 0", "tx") if lifted else ("block", "cart", "0 0 1", "tz")
    if not lifted:
        ramp = f"{np.cos(angle):.17g} 0 {-np.sin(angle):.17g}"
    text = (
        f'<robot name="wedge"><link name="ground"/>{LINK.format("cart", 50.0, i=0)}'
        f"{LINK.format('block', 3.0, i=0)}{SLIDE.format('drive', 'ground', first, way)}"
        f"{SLIDE.format('ramp', first, second, ramp)}"
        f'<loop name="guide" type="rows" rows="{row}"><predecessor link="ground"/>'
        f'<successor link="{second}"/>'
        f"</loop>{END.format('drive')}"
    )
    return hybridyn.load(save(tmp_path, text, "wedge.urdf"))


def at_speed(robot: hybridyn.HybridRobot, speed: float) -> tuple[Array, Array, Array]:
    return hybridyn.assemble(robot, motors={"drive": (0.0, speed, 0.0)})


@pytest.mark.parametrize("angle", [0.1, 0.6])
@pytest.mark.parametrize("mu", [0.05, 0.3])
def test_a_wedge_lifts_and_lowers_as_statics_say(tmp_path: Path, angle: float, mu: float) -> None:
    """P = W tan(angle +- phi), with mu = tan(phi)."""
    robot = wedge(tmp_path, angle, lifted=True)
    friction = LoadFriction(normal={"ramp": mu})
    for sign in (1.0, -1.0):
        q, v, a = at_speed(robot, sign * FAST)
        tau = hybridyn.idm(robot, q, v, a, effects=["default", friction])
        expected = 3.0 * G * np.tan(angle + sign * np.arctan(mu))
        assert abs(tau[0] - expected) < ROUNDED * 3.0 * G
        again = hybridyn.ddm(robot, q, v, tau, effects=["default", friction])
        assert np.abs(again - a).max() < ROUNDED * G


def test_the_self_locking_angle_is_the_friction_angle(tmp_path: Path) -> None:
    """Who pushes the block to move the cart needs H / tan(angle - phi): below phi nothing moves."""
    phi, push = np.arctan(0.2), {"cart": np.array([50.0, 0, 0, 0, 0, 0])}
    friction = ["default", LoadFriction(normal={"ramp": 0.2})]
    for angle in (1.001 * phi, 1.5 * phi):
        robot = wedge(tmp_path, angle, lifted=False)
        q, v, a = at_speed(robot, -FAST)
        tau = hybridyn.idm(robot, q, v, a, wrenches=push, effects=friction)
        expected = 3.0 * G - 50.0 / np.tan(angle - phi)
        assert abs(tau[0] - expected) < 1e-9 * abs(expected)  # the angle differs by phi / 1000
    robot = wedge(tmp_path, (1 + ANGLE) * phi, lifted=False)
    q, v, a = at_speed(robot, -FAST)
    tau = hybridyn.idm(robot, q, v, a, wrenches=push, effects=friction)
    assert tau[0] == pytest.approx(-50.0 / np.tan(ANGLE * phi), rel=1e-2)  # the angle's digits that differ
    for angle in (phi, (1 - ANGLE) * phi, 0.9 * phi):
        robot = wedge(tmp_path, angle, lifted=False)
        q, v, a = at_speed(robot, -FAST)
        with pytest.raises(ActuationError, match="joint 'ramp' may jam at sample 0") as error:
            hybridyn.idm(robot, q[None], v[None], a[None], wrenches=push, effects=friction)
        assert error.value.size is not None
        assert abs(error.value.size - 0.2 / np.tan(angle)) < ROUNDED


def test_no_coefficient_is_no_friction() -> None:
    robot = build_robot(shipped("gough_stewart"))
    q, v, a = states_near_home(robot.description, "fixed", 0, 3)
    plain = hybridyn.idm(robot, q, v, a)
    for none in (LoadFriction(), LoadFriction(normal=dict.fromkeys(robot.motors, 0.0))):
        assert np.array_equal(hybridyn.idm(robot, q, v, a, effects=["default", none]), plain)
    slight = LoadFriction(normal=dict.fromkeys(robot.motors, 1e-14))
    close_to(hybridyn.idm(robot, q, v, a, effects=["default", slight]), plain, 1e-12)


@pytest.mark.parametrize(("kind", "base"), [("stack", "fixed"), ("gough", "floating"), ("rssr", "moving")])
def test_efforts_under_friction_cause_the_motion_and_balance_every_joint(kind: str, base: str) -> None:
    """`ddm` inverts `idm`; a joint transmits its motor's effort less friction, which takes power from all."""
    description = random_mechanism(3, kind=kind)
    robot = build_robot(description, base=base)
    q, v, a = random_states(description, base, 3, 2)
    kinds = {j: robot.kinds[robot.joint_index[j]] for m in robot.modules for j in m.joints}
    hinges = [j for j, kind in kinds.items() if kind.hinge and j not in robot.cut_joints]
    slides = [j for j, kind in kinds.items() if kind.slides]
    law = LoadFriction(
        radial=dict.fromkeys(hinges, 2e-3),
        axial=dict.fromkeys(hinges, 1e-3),
        normal=dict.fromkeys(slides, 0.02),
    )
    effects = ["default", law]
    weights = np.ones(len(robot.motors))
    tau, reactions = hybridyn.idm(robot, q, v, a, effects=effects, weights=weights, reactions=True)
    plain = hybridyn.idm(robot, q, v, a, weights=weights)
    assert np.abs(tau - plain).max() > 1e-4 * np.abs(plain).max()
    prescribed = a[:, :6] if base == "moving" else None
    close_to(hybridyn.ddm(robot, q, v, tau, base_acceleration=prescribed, effects=effects), a, 1e-9)
    effort, taken = dict(zip(robot.motors, tau.T, strict=True)), np.zeros(len(q))
    for name in (*hinges, *slides):
        module = next(m for m in robot.modules if name in m.joints)
        axis = module.mechanism.spanning.joints[module.joints.index(name)].axis
        force, moment = np.split(reactions.joints[name], 2, axis=1)
        rate = v[:, robot.v_slices[robot.joint_index[name]]][:, 0]
        along, across = force @ axis, np.linalg.norm(force - np.outer(force @ axis, axis), axis=1)
        load = 0.02 * across if name in slides else 2e-3 * across + 1e-3 * np.abs(along)
        expected = effort.get(name, 0.0) - load * np.tanh(rate / law.width)
        got = along if name in slides else moment @ axis
        assert np.abs(got - expected).max() < 1e-10 * np.abs(np.concatenate([force, moment])).max()
        taken += load * np.tanh(rate / law.width) * rate
    assert (taken > 0).all()
    if base != "moving":
        close_to(hybridyn.power(robot, q, v, tau, effects=effects).lost, taken, 1e-9)


def test_a_rod_that_no_motor_spins_may_need_the_friction_of_its_ball() -> None:
    """`ddm` gives the acceleration of its spin; a motion beside that one needs an effort."""
    description = random_mechanism(8, kind="rssr")
    robot = build_robot(description)
    (ball,) = [name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind == "spherical"]
    effects = ["default", LoadFriction(radial={ball: 1e-3})]
    (q,), (v,), _ = random_states(description, "fixed", 8, 1)
    a = hybridyn.ddm(robot, q, v, [100.0], effects=effects)
    close_to(hybridyn.idm(robot, q, v, a, effects=effects), [100.0], 1e-11)
    with pytest.raises(ActuationError, match="1 motor for 2 freedoms"):
        hybridyn.idm(robot, q, v, hybridyn.ddm(robot, q, v, [100.0]), effects=effects)


def test_bearings_that_share_their_load_are_refused() -> None:
    """The hinges of a planar loop tilt one another; what they carry in the plane is determined."""
    robot = build_robot(shipped("five_bar"))
    q, v, a = states_near_home(robot.description, "fixed", 0, 2)
    joints = [j for m in robot.modules for j in m.joints]
    hybridyn.idm(robot, q, v, a, effects=["default", LoadFriction(radial=dict.fromkeys(joints, 1e-3))])
    with pytest.raises(ModelError, match=f"tilt of '{joints[0]}'.*Leave these out"):
        hybridyn.idm(robot, q, v, a, effects=["default", LoadFriction(tilt={joints[0]: 1e-3})])


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (LoadFriction(radial={"elbow": 1e-3}), "no such movable joint 'elbow'"),
        (LoadFriction(normal={"m1_right_drive": 0.1}), "it has no 'normal'"),
        (LoadFriction(radial={"m1_right_drive": -0.1}), "has -0.1; .* at most 1e\\+50 and not negative"),
        (LoadFriction(radial={"m1_right_drive": 1e60}), "has 1e\\+60; .* at most 1e\\+50"),
        (LoadFriction(radial={"m1_right_drive": 0.1}, width=0.0), "width must be positive"),
        (LoadFriction(radial=DRIVE, static={"m1_right_drive": 2.0}), "lack one of the law's numbers"),
        (LoadFriction(radial=DRIVE, static={"m1_right_drive": 0.5}, speed=DRIVE), "0.5 is below 1"),
        (LoadFriction(static={"m1_right_drive": 2.0}, speed=DRIVE), "has a static part and no friction"),
    ],
)
def test_bad_coefficients_are_refused(law: LoadFriction, said: str) -> None:
    robot = build_robot(shipped("five_bar"))
    q, v, a = states_near_home(robot.description, "fixed", 0, 1)
    with pytest.raises(ModelError, match=said):
        hybridyn.idm(robot, q, v, a, effects=["default", law])


@pytest.mark.parametrize("base", ["moving", "floating"])
def test_the_joint_of_a_base_has_no_friction(base: str) -> None:
    robot = build_robot(shipped("five_bar"), base=base)
    with pytest.raises(ModelError, match="joint 'root_joint' is floating; it has no 'radial'"):
        hybridyn.effects.choose(robot, ["default", LoadFriction(radial={"root_joint": 1e-3})])


def test_the_robot_s_files_may_state_it(tmp_path: Path) -> None:
    robot = wedge(tmp_path, 0.6, lifted=True)
    (tmp_path / "wedge.model.toml").write_text("[effects.load_friction]\nnormal = { ramp = 0.1 }\n")
    stated = hybridyn.load(tmp_path / "wedge.urdf")
    q, v, a = at_speed(robot, FAST)
    expected = hybridyn.idm(robot, q, v, a, effects=["default", LoadFriction(normal={"ramp": 0.1})])
    assert np.array_equal(hybridyn.idm(stated, q, v, a, effects="model"), expected)


def test_who_cannot_compute_it_says_so() -> None:
    robot = build_robot(shipped("five_bar"))
    law = ["default", LoadFriction(radial={robot.motors[0]: 1e-3})]
    q, v, a = states_near_home(robot.description, "fixed", 0, 1)
    for call in (
        lambda: hybridyn.compiled.Derivatives(robot, "idm", effects=law),
        lambda: hybridyn.idm_jacobian(robot, q, v, a, effects=law),
        lambda: hybridyn.bias(robot, q, v, effects=law),
        lambda: hybridyn.mass_matrix(robot, q, effects=law),
        lambda: hybridyn.regressor(robot, q, v, a, effects=law),
    ):
        with pytest.raises(ModelError, match="the effect 'load_friction'"):
            call()
    moving = build_robot(robot.description, base="moving")
    q, v, _ = states_near_home(robot.description, "moving", 0, 1)
    with pytest.raises(ModelError, match="needs the acceleration of the moving base"):
        hybridyn.power(moving, q, v, np.zeros((1, 2)), effects=law)


def test_power_refuses_the_motion_of_a_base_that_does_not_move() -> None:
    robot = build_robot(shipped("five_bar"))
    time, pose = np.linspace(0.0, 1.0, 6), np.tile([0.0, 0, 0, 0, 0, 0, 1], (6, 1))
    on = ["default", LoadFriction(radial={robot.motors[0]: 1e-3}), BaseMotion(time, pose)]
    q, v, _ = states_near_home(robot.description, "fixed", 0, 1)
    with pytest.raises(ModelError, match="base_motion: the robot's base is 'fixed'"):
        hybridyn.power(robot, q, v, np.zeros((1, 2)), effects=on, time=0.5)
