"""Loops that cannot close: polygons prove it, slips of the pen are refused at once, freedoms left told."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
import hybridyn.assembly.assemble as assembly
from hybridyn import AssemblyError
from hybridyn.assembly.module_request import module_request
from hybridyn.assembly.reach import closed_postures
from hybridyn.assembly.requests import gather_requests
from hybridyn.assembly.shortfall import shortfall
from hybridyn.assembly.task import module_task
from hybridyn.structure.building import build_robot
from tests import ROOT
from tests.comparing import refused
from tests.files import save
from tests.mechanisms import KINDS, random_mechanism, random_states
from tests.posing import of_joints, of_link
from tests.samples import some
from tests.shipped import ROBOTS, shipped, states_near_home

UPPER, LOWER, SPACING = 0.2, 0.3, 0.25  # of a five-bar [m]
BAND = 1e-3  # residuals of 1e-4 of the module's length are accepted, each with its lever [m]


def test_a_five_bar_lacks_what_its_point_is_outside_of_the_rings_of_its_arms() -> None:
    """The tool is on two arms: its distance r from either shoulder is within LOWER - UPPER, LOWER + UPPER."""
    arms = {"upper_length": str(UPPER), "lower_length": str(LOWER), "spacing": str(SPACING)}
    robot = build_robot(shipped("five_bar", **arms))
    x, z = np.random.default_rng(0).uniform(-0.8, 0.8, (2, 400))
    radii = [np.hypot(x - shoulder, z) for shoulder in (-SPACING / 2, SPACING / 2)]
    outside = np.maximum.reduce([np.maximum(r - LOWER - UPPER, LOWER - UPPER - r) for r in radii])
    requests = gather_requests(robot, {}, {"m1_tool": ({"x": x, "z": z},)})
    task = module_task(robot, robot.modules[0], module_request(requests, robot, 0, {}))
    lacking = shortfall(task, np.tile(robot.home, (400, 1)), np.arange(400))
    far = outside > 0
    assert not lacking[~far].any()
    assert np.all(lacking[far] <= outside[far])
    upper = np.max(radii, axis=0) > LOWER + UPPER  # for two coordinates nothing bounds the point from below
    assert np.all(lacking[upper] >= (np.max(radii, axis=0) - LOWER - UPPER - BAND)[upper])
    assert upper.sum() > 100


def test_an_angle_that_is_given_first_changes_nothing() -> None:
    """What residuals may hide is a length: an angle has no share in how far a point may be off."""
    arms = {"upper_length": str(UPPER), "lower_length": str(LOWER), "spacing": str(SPACING)}
    robot = build_robot(shipped("five_bar", **arms))
    given = {"x": np.array([0.9]), "pitch": np.zeros(1)}
    found = []
    for names in (("x", "pitch"), ("pitch", "x")):
        requests = gather_requests(robot, {}, {"m1_tool": ({name: given[name] for name in names},)})
        task = module_task(robot, robot.modules[0], module_request(requests, robot, 0, {}))
        found.append(float(shortfall(task, robot.home[None], np.zeros(1, dtype=int))[0]))
    assert found[0] == found[1] > 0


@pytest.mark.parametrize("name", some([*ROBOTS]))
def test_no_posture_of_a_shipped_robot_is_proven_out_of_reach(name: str) -> None:
    robot = build_robot(shipped(name))
    states = states_near_home(robot.description, "fixed", 1, 3)
    poses = {
        f"{module.outputs[0]}@{module.base}": of_link(robot, *states, module.outputs[0], module.base)
        for module in robot.modules
        if module.mobility == 6
    }
    left = [motor for module in robot.modules if module.mobility != 6 for motor in module.motors]
    for joints, platforms in ((robot.motors, {}), (left, poses)):
        motors = of_joints(robot, *states, joints)
        assert closed_postures(robot, motors=motors, platforms=platforms)[1].all()


@pytest.mark.parametrize("kind", some([kind for kind in KINDS if KINDS[kind].motors != "few"]))
def test_no_posture_of_a_mechanism_is_proven_out_of_reach(kind: str) -> None:
    description = random_mechanism(3, kind=kind)
    robot, states = build_robot(description), random_states(description, "fixed", 3, 3)
    requests = gather_requests(robot, of_joints(robot, *states), {})
    for k, module in enumerate(robot.modules):
        if module.closures:
            task = module_task(robot, module, module_request(requests, robot, k, {}))
            x = module.mechanism.cut.positions(states[0][:, module.q_index])
            assert not shortfall(task, x, np.arange(3)).any()


@pytest.mark.parametrize(
    ("name", "pose"),
    [("five_bar", {"m1_tool": {"x": 0.9, "z": -0.1}}), ("delta", {"m1_platform": {"x": 2, "y": 0, "z": 0}})],
)
def test_what_is_proven_out_of_reach_is_refused_without_further_starts(name: str, pose: dict) -> None:
    robot = build_robot(shipped(name))
    platforms = {link: (point,) for link, point in pose.items()}
    error = refused(
        lambda: hybridyn.assemble(robot, platforms=platforms), AssemblyError, "lacks .* in any posture"
    )
    assert error.iterations <= 60  # of one start


def test_where_no_sample_is_in_reach_none_is_closed() -> None:
    """There is then nothing to solve, which was an error of its own."""
    robot = hybridyn.load("five_bar")
    far = {"m1_tool": {"x": np.zeros(3), "z": np.full(3, -40.0)}}
    assert not closed_postures(robot, motors={}, platforms=far)[1].any()


URDF = ROOT / "urdf"
WHEEL = """<robot name="r"><link name="a"/><link name="b"/>
  <joint name="spin" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
  <link name="c"/><joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize("name", ["five_bar", "rps3", "gough_stewart", "delta"])
@pytest.mark.parametrize("size", [1e5, -1e5, 1e300])
def test_absurd_positions_are_refused_at_once(
    name: str, size: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No posture is searched for."""
    monkeypatch.setattr(assembly, "follow", None)
    robot = hybridyn.load(URDF / f"{name}.urdf.xacro")
    motors = {motor: (np.zeros(5),) for motor in robot.motors}
    motors[robot.motors[1]] = (np.array([0.0, 0.0, 0.0, size, 0.0]),)
    words = f"joint '{robot.motors[1]}' is out of reach at sample 3"
    refused(lambda: hybridyn.assemble(robot, motors=motors), AssemblyError, words, sample=3)


def test_wheels_turn_far_and_rails_are_long(tmp_path: Path) -> None:
    robot = hybridyn.load(save(tmp_path, WHEEL, "r.urdf"))
    q, _, _ = hybridyn.assemble(robot, motors={"spin": (1e6,), "slide": (1e6,)})
    assert q == pytest.approx([np.cos(1e6), np.sin(1e6), 1e6])
    far = {"spin": (1e9,), "slide": (0.0,)}
    refused(lambda: hybridyn.assemble(robot, motors=far), AssemblyError, "spin")


def test_what_is_left_open_is_counted() -> None:
    robot = hybridyn.load(URDF / "five_bar.urdf.xacro")
    one = {"m1_left_drive": (0.0,)}
    refused(lambda: hybridyn.assemble(robot, motors=one), AssemblyError, "open", open_freedoms=1)
