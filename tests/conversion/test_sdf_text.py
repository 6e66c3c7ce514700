"""What stands in an SDF file that `convert` writes, and what comes back from it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import hybridyn
from hybridyn.conversion.convert import write
from hybridyn.conversion.request import ConversionRequest, Losses
from hybridyn.description import Closure, Description, Joint, Link, read
from hybridyn.description.closure_forms import FORMS
from hybridyn.description.placement import inverse, placement_from, poses_at
from hybridyn.description.shape_files import Shape
from hybridyn.structure.building import build_robot
from tests.conversion.judge import SAME, read_back, states
from tests.robots.mechanisms import random_mechanism
from tests.support.comparing import close_to

TURN = placement_from(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.1, 0.2, 0.3]))
INERTIA = np.array([[0.02, 0.001, 0.002], [0.001, 0.03, 0.003], [0.002, 0.003, 0.04]])


def arm() -> Description:
    """Return an arm of three links."""
    axis = np.array([0.0, 0.6, 0.8])
    links = tuple(Link(name, 1.5, np.array([0.1, 0, 0.2]), INERTIA) for name in ("base", "upper", "hand"))
    joints = (
        Joint("shoulder", "revolute", "base", "upper", TURN, axis),
        Joint("wrist", "continuous", "upper", "hand", TURN, axis),
    )
    return Description("arm", links, joints, motors=("wrist",))


def test_positions_count_from_home(tmp_path: Path) -> None:
    """Limits, springs, stops and couplings move with the zero of their joints: efforts are the same."""
    before = random_mechanism(3, kind="four_bar")
    name, (x,) = next((name, x) for name, x in before.home.items() if x[0] and len(x) == 1)
    joints = tuple(replace(one, lower=-1.0, upper=2.0) if one.name == name else one for one in before.joints)
    effects = (
        ("spring", {"stiffness": {name: 7.0}}),
        ("stop", {"stiffness": {name: 90.0}, "lower": {name: x - 0.1}, "upper": {name: x - 0.01}}),
    )
    before = replace(before, joints=joints, effects=effects)
    after, out = read_back(before, tmp_path / "robot.sdf")
    assert [line.split(":")[0] for line in out.losses] == [
        "positions of joints count from home, where the loops are closed"
    ]
    assert etree.parse(tmp_path / "robot.sdf").getroot().get("version") == "1.11"
    (found,) = (one for one in after.joints if one.name == name)
    np.testing.assert_allclose((found.lower, found.upper), (-1.0 - x, 2.0 - x), rtol=0, atol=1e-15)
    one, two = build_robot(before), build_robot(after)
    q, v, a = states(before)
    moved = q.copy()
    for joint, at in zip(one.joints, one.q_slices, strict=True):
        home = one.home[at]
        moved[:, at] -= home if len(home) == 1 else 0
        if len(home) == 2:
            turn = np.array([[home[0], home[1]], [-home[1], home[0]]])
            moved[:, at] = q[:, at] @ turn.T
        assert two.kinds[two.joints.index(joint)] == one.kinds[one.joints.index(joint)]
    tau = hybridyn.idm(one, q, v, a, effects=["spring", "stop"])
    assert np.abs(tau - hybridyn.idm(one, q, v, a)).max() > 0.1
    close_to(hybridyn.idm(two, moved, v, a, effects=["spring", "stop"]), tau, SAME)


def test_a_screw_stands_where_home_has_it(tmp_path: Path) -> None:
    """A nut 1.5 rad up its thread is there in the file, and its loop is closed; efforts are the same."""
    z, pitch, turn = np.array([0.0, 0.0, 1.0]), 0.08, 1.5
    links = tuple(Link(name, 1.5, np.array([0.1, 0, 0.2]), INERTIA) for name in ("base", "nut", "slider"))
    joints = (
        Joint("thread", "screw", "base", "nut", np.eye(4), z, pitch=pitch),
        Joint("guide", "prismatic", "base", "slider", np.eye(4), z),
    )
    pin = Closure("pin", "revolute", "nut", np.eye(4), "slider", np.eye(4), *FORMS["revolute"][:2])
    home = {"thread": (turn,), "guide": (pitch * turn,)}
    before = Description("nut", links, joints, (pin,), motors=("thread",), home=home)
    after, out = read_back(before, tmp_path / "nut.sdf")
    assert [line.split(":")[0] for line in out.losses] == [
        "positions of joints count from home, where the loops are closed"
    ]
    nut = next(joint for joint in after.joints if joint.name == "thread")
    np.testing.assert_allclose(nut.placement[:3, 3], (0, 0, pitch * turn), rtol=0, atol=1e-15)
    one, two = build_robot(before), build_robot(after)
    q, v, a = states(before)
    close_to(hybridyn.idm(two, q - one.home, v, a), hybridyn.idm(one, q, v, a), SAME)


def test_shapes_are_visuals(tmp_path: Path) -> None:
    shapes = (
        Shape("hand", "box", TURN, (1.0, 2.0, 3.0), colour=(0.1, 0.2, 0.3, 1.0)),
        Shape("hand", "cylinder", np.eye(4), (0.5, 2.0)), Shape("base", "sphere", np.eye(4), (0.5,)),
        Shape("upper", "mesh", np.eye(4), (1.0, 1.0, 2.0), "part.stl"),
    )  # fmt: skip
    text = write(ConversionRequest(arm(), tmp_path / "arm.sdf", shapes), Losses()).text
    root = etree.fromstring(text.encode())
    found = {
        visual.get("name"): "".join(visual.find("geometry").itertext()).split()
        for visual in root.iter("visual")
    }
    assert found == {
        "hand_0": ["1", "2", "3"], "hand_1": ["0.5", "2"], "base_0": ["0.5"],
        "upper_0": ["part.stl", "1", "1", "2"],
    }  # fmt: skip
    (tmp_path / "arm.sdf").write_text(text)
    assert len(read(tmp_path / "arm.sdf").links) == 3


def test_the_home_of_a_planar_joint_comes_back(tmp_path: Path) -> None:
    """It stands where it stood, in a tree; in a robot with a loop its position counts from there."""
    links = tuple(Link(name, 1.5, np.array([0.1, 0, 0.2]), INERTIA) for name in ("base", "cart", "rod"))
    cart = Joint("roll", "planar", "base", "cart", TURN, np.array([0.0, 0.0, 1.0]))
    hinge = Joint("hinge", "revolute", "cart", "rod", TURN, np.array([0.0, 1.0, 0.0]))
    angle = 0.7
    x = (0.5, -0.4, float(np.cos(angle)), float(np.sin(angle)))
    tree = Description("cart", links, (cart, hinge), motors=("hinge",), home={"roll": x, "hinge": (0.2,)})
    at = poses_at(tree, tree.home)
    there = inverse(at["base"]) @ at["rod"]
    pin = Closure(
        "pin", "spherical", "base", there, "rod", np.eye(4), FORMS["spherical"].translations,
        FORMS["spherical"].rotation, None, np.eye(3),
    )  # fmt: skip
    for before in (tree, replace(tree, closures=(pin,))):
        after, _ = read_back(before, tmp_path / "cart.sdf")
        found = {name: after.home.get(name, (0.0,))[0] for name in ("roll_x", "roll_y", "roll_turn", "hinge")}
        expected = {"roll_x": 0.5, "roll_y": -0.4, "roll_turn": angle, "hinge": 0.2}
        assert found == pytest.approx(dict.fromkeys(found, 0.0) if before.closures else expected, abs=1e-15)
        theirs = poses_at(after, after.home)
        for name in ("cart", "rod"):
            np.testing.assert_allclose(theirs[name], at[name], rtol=0, atol=1e-15)


def test_a_closure_that_is_hardly_open_at_home_is_listed(tmp_path: Path) -> None:
    """SDF closes it where its links stand, which moves its frame; hybridyn kept the frame."""
    before = random_mechanism(3, kind="four_bar_two_motors")
    name = before.motors[0]
    ajar = before.home | {name: (before.home[name][0] + 1e-6,)}
    line = "closures that are open at home are closed there: 'd5_closure'"
    for home, listed in ((before.home, False), (ajar, True)):
        _, out = read_back(replace(before, home=home), tmp_path / "robot.sdf")
        assert (line in out.losses) == listed
