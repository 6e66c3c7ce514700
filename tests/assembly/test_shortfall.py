"""Loops that cannot close, proven by polygons, and motions that no motor drives: told where they are."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
import hybridyn.assembly.assemble as assembly
import hybridyn.assembly.follow as following
from hybridyn import ActuationError, AssemblyError, HybridRobot
from hybridyn.assembly.free_motions import FreeMotions, free_motions
from hybridyn.assembly.module_request import module_request
from hybridyn.assembly.requests import gather_requests
from hybridyn.assembly.task import module_task
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.studies.check.remarks import free_motions_of
from tests import ROOT
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.robots.posing import of_joints, of_link
from tests.robots.shipped import ROBOTS, shipped, states_near_home
from tests.studies.test_check import crank_and_slide
from tests.support.comparing import refused
from tests.support.files import save
from tests.support.samples import some

UPPER, LOWER, SPACING = 0.2, 0.3, 0.25  # of a five-bar [m]
ARMS = {"upper_length": str(UPPER), "lower_length": str(LOWER), "spacing": str(SPACING)}
BAND = 1e-3  # residuals of 1e-4 of the module's length are accepted, each with its lever [m]


def test_a_five_bar_lacks_what_its_point_is_outside_of_the_rings_of_its_arms() -> None:
    """The tool is on two arms: its distance r from either shoulder is within LOWER - UPPER, LOWER + UPPER."""
    robot = build_robot(shipped("five_bar", **ARMS))
    x, z = np.random.default_rng(0).uniform(-0.8, 0.8, (2, 400))
    radii = [np.hypot(x - shoulder, z) for shoulder in (-SPACING / 2, SPACING / 2)]
    outside = np.maximum.reduce([np.maximum(r - LOWER - UPPER, LOWER - UPPER - r) for r in radii])
    requests = gather_requests(robot, {}, {"m1_tool": ({"x": x, "z": z},)})
    task = module_task(robot, robot.modules[0], module_request(requests, robot, 0, {}))
    lacking = task.lacking(np.tile(robot.home, (400, 1)), np.arange(400))
    far = outside > 0
    assert not lacking[~far].any()
    assert np.all(lacking[far] <= outside[far])
    upper = np.max(radii, axis=0) > LOWER + UPPER  # for two coordinates nothing bounds the point from below
    assert np.all(lacking[upper] >= (np.max(radii, axis=0) - LOWER - UPPER - BAND)[upper])
    assert upper.sum() > 100


def test_an_angle_that_is_given_first_changes_nothing() -> None:
    """What residuals may hide is a length: an angle has no share in how far a point may be off."""
    robot = build_robot(shipped("five_bar", **ARMS))
    given = {"x": np.array([0.9]), "pitch": np.zeros(1)}
    found = []
    for names in (("x", "pitch"), ("pitch", "x")):
        requests = gather_requests(robot, {}, {"m1_tool": ({name: given[name] for name in names},)})
        task = module_task(robot, robot.modules[0], module_request(requests, robot, 0, {}))
        found.append(float(task.lacking(robot.home[None], np.zeros(1, dtype=int))[0]))
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
        for t in range(3):
            one = [{name: [x[t] for x in given] for name, given in of.items()} for of in (motors, platforms)]
            hybridyn.assemble(robot, motors=one[0], platforms=one[1])


@pytest.mark.parametrize("kind", some([kind for kind in KINDS if KINDS[kind].motors != "few"]))
def test_no_posture_of_a_mechanism_is_proven_out_of_reach(kind: str) -> None:
    description = random_mechanism(3, kind=kind)
    robot, states = build_robot(description), random_states(description, "fixed", 3, 3)
    requests = gather_requests(robot, of_joints(robot, *states), {})
    for k, module in enumerate(robot.modules):
        if module.closures:
            task = module_task(robot, module, module_request(requests, robot, k, {}))
            x = module.mechanism.cut.positions(states[0][:, module.q_index])
            assert not task.lacking(x, np.arange(3)).any()


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


def test_a_motion_out_of_reach_is_refused_at_its_first_such_sample_without_a_step_towards_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """That sample is the first that cannot be reached from any posture; no way to it is walked."""
    robot = build_robot(shipped("five_bar"))
    x = np.linspace(0.0, 0.9, 31)

    def reached(sample: int) -> bool:
        """Whether the sample alone closes."""
        try:
            hybridyn.assemble(robot, platforms={"m1_tool": {"x": x[sample], "z": -0.4}})
        except AssemblyError:
            return False
        return True

    with monkeypatch.context() as patch:
        patch.setattr(following, "_next", None)
        error = refused(
            lambda: hybridyn.assemble(robot, platforms={"m1_tool": {"x": x, "z": np.full(31, -0.4)}}),
            AssemblyError,
            r"m1_tool.* at sample \d+: .* \(a loop lacks 0\.\d+ m in any posture\) .* move it",
        )
    first = error.sample
    assert first % following.STRIDE  # between the few that are solved first
    assert [reached(k) for k in (0, first // 2, first - 1, first)] == [True, True, True, False]
    assert error.iterations <= 60  # of one start


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


NONE = FreeMotions((), (), ())


@pytest.mark.parametrize("name", ROBOTS)
def test_shipped_robots_have_none(name: str) -> None:
    robot = build_robot(shipped(name))
    assert all(free_motions(module) == NONE for module in robot.modules)
    assert free_motions_of(robot) == []
    assert free_motions_of(build_robot(shipped(name), base="floating")) == []  # a free base is no news


def test_a_five_bar_with_one_motor_has_a_passive_motion() -> None:
    robot = hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro", motors=["m1_left_drive"])
    free = free_motions(robot.modules[0])
    assert len(free.uncontrolled) == 1
    assert "m1_left_drive" not in free.uncontrolled[0]
    assert (free.idle, free.massless) == ((), ())
    assert free_motions_of(robot) == [
        f"no motor drives the motion of {free.uncontrolled[0].replace(chr(39), '')}"
    ]


def test_a_link_with_mass_on_a_leg_is_not_idle() -> None:
    """The rods of a governor move no platform, but themselves and their balls."""
    robot = hybridyn.load(ROOT / "urdf/benchmarks/flyball_governor.urdf.xacro")
    free = free_motions(robot.modules[1])
    assert (len(free.uncontrolled), free.idle, free.massless) == (3, (), ())


@pytest.mark.parametrize("kind", some(KINDS))
def test_motions_and_motors_add_up(kind: str) -> None:
    """Motors, the motions they do not drive, and mobility: each module of each random mechanism."""
    robot = build_robot(random_mechanism(0, kind=kind))
    for module in robot.modules:
        free = free_motions(module)
        m = module.mechanism
        Psi = m.basis(m.closures.matrix(m.tree.sweep(m.postures[:1]))).Psi[0]
        motors = Psi[module.motor_columns] / m.reduction.col_scale[module.motor_columns, None]
        driven = np.linalg.matrix_rank(motors) if len(motors) else 0  # older NumPy takes no empty matrix
        assert len(free.uncontrolled) + len(free.idle) == module.mobility - driven
        names = (*free.uncontrolled, *free.idle)
        assert not set(names) & {f"joint '{motor}'" for motor in module.motors}
        assert {*names, *free.massless} <= set(module.freedom_names())
    if KINDS[kind].massless:
        assert any(free_motions(module).massless for module in robot.modules)


def crank_and_rod(folder: Path) -> HybridRobot:
    """Return a crank that pushes a slide by a rod with a ball at either end: one motor, a motion to spare."""
    return hybridyn.load(save(folder, crank_and_slide("drive"), "r.urdf"))


def test_a_rod_that_spins_between_two_balls_is_idle(tmp_path: Path) -> None:
    robot = crank_and_rod(tmp_path)
    assert robot.mobility == 2
    free = free_motions(robot.modules[0])
    assert len(free.uncontrolled) + len(free.idle) == 1
    assert free.idle == ("joint 'ball_x'",)
    assert free.massless == ()
    assert "idle" in free_motions_of(robot)[0]


def swinging(robot: HybridRobot) -> tuple[Array, Array, Array]:
    t = np.linspace(0.0, 1.0, 40)
    swing = 0.4 * np.sin(5 * t), 2.0 * np.cos(5 * t), -10.0 * np.sin(5 * t)
    return hybridyn.assemble(robot, motors={"drive": swing})


def test_an_idle_motion_never_stops_a_model(tmp_path: Path) -> None:
    """The spin that closing leaves on the rod needs a moment that no motor gives: no reason to refuse."""
    robot = crank_and_rod(tmp_path)
    q, v, a = swinging(robot)
    tau = hybridyn.idm(robot, q, v, a)
    free = hybridyn.idm(robot, q, v, a, passive="solved")
    assert np.abs(tau - free).max() < 1e-3 * np.abs(free).max()  # the moment left out, a small one
    moving = hybridyn.ddm(robot, q, v, free)
    assert np.abs(hybridyn.idm(robot, q, v, moving) - free).max() < 1e-12 * np.abs(free).max()


def test_a_motion_that_moves_mass_needs_its_motor(tmp_path: Path) -> None:
    """Beside the idle one: with the slide as motor the crank's motion is told, without any it is refused."""
    robot = crank_and_rod(tmp_path)
    q, v, a = swinging(robot)
    bare = hybridyn.load(tmp_path / "r.urdf", motors=[])
    refused(
        lambda: hybridyn.idm(bare, q, v, a),
        ActuationError,
        r"no motor can produce .* The robot has no motors: name them, motors=",
    )
