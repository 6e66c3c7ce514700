"""Guards of the core, each with a robot that is wrong without it; lost rank; solving with inertias."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.compiled.equations.states import moving_states
from hybridyn.description.records import Description, Joint, Link
from hybridyn.dynamics.guards import EPS
from hybridyn.dynamics.inertia_solve import InertiaFactor
from hybridyn.structure.building import build_robot
from tests.assembly.test_assembly import with_aligned_wrist
from tests.oracle import Oracle
from tests.robots.any_mechanism import any_mechanism
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import ROUNDING, SOLVED, close_to, refused
from tests.support.files import save

MASS = """<inertial><origin xyz="0.3 0.1 -0.2"/><mass value="2"/>
  <inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0.01" ixz="0" iyz="0.02"/></inertial>"""
JOINT = """<joint name="{name}" type="{kind}" independent="{driven}"><parent link="{parent}"/>
  <child link="{child}"/><origin xyz="0.3 -0.2 0.5" rpy="0.3 0.5 0.7"/>{axis}</joint>"""
BALL = """<loop name="ball" type="spherical"><predecessor link="a"><origin xyz="0.1 0.2 0.3"/></predecessor>
  <successor link="b"><origin xyz="0.1 0.2 0.3"/></successor></loop>"""


def joint(name: str, kind: str, parent: str, child: str) -> str:
    """Write a joint; one that turns has a motor."""
    turns = kind == "continuous"
    axis = '<axis xyz="1 2 3"/>' if turns else ""
    return JOINT.format(
        name=name, kind=kind, driven=str(turns).lower(), parent=parent, child=child, axis=axis
    )


def on_a_bare_link(folder: Path, *free: str, loop: str = "") -> hybridyn.HybridRobot:
    """Hang bodies of mass, by joints of six freedoms, on a link without mass that a motor turns."""
    parts = ['<robot name="bare"><link name="ground"/><link name="bare"/>']
    parts += [f'<link name="{name}">{MASS}</link>' for name in free]
    parts += [joint("motor", "continuous", "ground", "bare")]
    parts += [joint(f"free_{name}", "floating", "bare", name) for name in free]
    return hybridyn.load(save(folder, "".join(parts) + loop + "</robot>", "bare.urdf"))


def moved_together(robot: hybridyn.HybridRobot, seed: int) -> np.ndarray:
    """Turn the motor, and move the bodies that hang on the link by the same displacement, shape (nq,)."""
    rng = np.random.default_rng(seed)
    bodies = robot.nv // 6
    return pin.integrate(robot.model, robot.home, np.r_[rng.normal(), np.tile(rng.normal(size=6), bodies)])


@pytest.mark.parametrize(("free", "loop"), [(("a",), ""), (("a", "b"), BALL)])
def test_what_hangs_freely_gives_a_bare_link_no_inertia(tmp_path: Path, free: tuple[str], loop: str) -> None:
    """The bodies fall past it, outputs and legs of loops alike: what they hand on is rounding, no inertia."""
    robot = on_a_bare_link(tmp_path, *free, loop=loop)
    for seed in range(4):
        a = hybridyn.ddm(robot, moved_together(robot, seed), np.zeros(robot.nv), np.zeros(1))
        assert a[0] == 0.0


def test_a_thin_rod_on_a_ball_does_not_start_to_spin() -> None:
    """About its own axis nothing acts on it and nothing resists: of all accelerations it takes the least."""
    axis, mass, arm = np.array([1.0, 2.0, 2.0]) / 3, 3.0, 0.5
    across = mass * arm**2 * (np.eye(3) - np.outer(axis, axis))
    links = (Link("ground", 0.0, np.zeros(3), np.zeros((3, 3))), Link("rod", mass, arm * axis, across / 3))
    ball = Joint("ball", "spherical", "ground", "rod", np.eye(4), axis)
    robot = build_robot(Description("rod", links, (ball,)))
    w = np.cross(axis, [0.3, -1.0, 2.0]) + axis
    about = 4 / 3 * across
    moment = np.cross(arm * axis, mass * robot.gravity) - np.cross(w, about @ w)
    found = hybridyn.ddm(robot, robot.home, w, np.zeros(len(robot.motors)))
    close_to(found, np.linalg.pinv(about, rcond=1e-9) @ moment, SOLVED)


@pytest.mark.parametrize(("seed", "largest"), [(53, 1e3), (235, 1e-12), (1263, 10.0), (4520, 0.1)])
def test_rates_of_rounding_in_loops_are_no_inertia_and_no_force(seed: int, largest: float) -> None:
    """Motions that carry no mass, in loops that leave rounding in them: neither refused nor accelerated."""
    description, base = any_mechanism(seed)
    robot = build_robot(description, base=base)
    assert np.abs(hybridyn.ddm(robot, *moving_states(robot, 2, seed))).max() < largest


def test_free_fall_needs_no_effort_of_motors_that_are_not_there() -> None:
    """All terms of the base's wrench cancel; what remains is rounding, however large a part of them."""
    description = shipped("rps3")
    robot = build_robot(description, base="floating")
    q = states_near_home(description, "floating", 0, 2)[0]
    rest, none = np.zeros((2, robot.nv)), np.zeros((2, len(robot.motors)))
    weight = 9.81 * sum(link.mass for link in description.links)
    assert np.abs(hybridyn.idm(robot, q, rest, hybridyn.ddm(robot, q, rest, none))).max() < 1e-12 * weight


def test_rates_of_rounding_are_rest_where_nothing_else_says_what_is_slow() -> None:
    """Without gravity and at rest there is no rate to compare with but one radian a second."""
    robot = hybridyn.load("five_bar", gravity=(0.0, 0.0, 0.0))
    v, zero = 1e-14 * np.arange(1.0, robot.nv + 1), np.zeros(robot.nv)
    assert np.abs(hybridyn.idm(robot, robot.home, v, zero)).max() < 1e-12


def test_loops_of_a_rounded_file_close_as_far_as_it_says(tmp_path: Path) -> None:
    """Hinges of a four-bar that are parallel to four digits: the rows that would tilt it are rounding."""
    tilted = '<axis xyz="5e-5 0 1"/>'
    parts = [
        '<robot name="rounded"><link name="ground"/>',
        *(BAR.format(name=n, half=h) for n, h in (("crank", 0.5), ("coupler", 0.8), ("rocker", 0.6))),
        HINGE.format(name="a", driven="true", parent="ground", child="crank", at=0),
        HINGE.format(name="b", driven="false", parent="crank", child="coupler", at=1).replace(
            '<axis xyz="0 0 1"/>', tilted
        ),
        HINGE.format(name="c", driven="false", parent="ground", child="rocker", at=2),
        """<loop name="l" type="revolute"><predecessor link="coupler"><origin xyz="1.6 0 0"/></predecessor>
        <successor link="rocker"><origin xyz="1.2 0 0"/></successor><axis xyz="0 0 1"/></loop></robot>""",
    ]
    robot = hybridyn.load(save(tmp_path, "".join(parts), "rounded.urdf"))
    q, v, a = hybridyn.assemble(robot, motors={"a": (np.array([0.5, 1.0, 1.5]), 1.0, 2.0)})
    assert hybridyn.closure_residual(robot, q).max() > 1e-6, "a file of more digits would close better"
    assert np.isfinite(hybridyn.idm(robot, q, v, a)).all()


def test_spins_of_rods_may_be_given_any_accelerations() -> None:
    """Six rods between balls, with inertia about their own axes: no motor spins them, and no output moves."""
    thin = random_mechanism(0, kind="sps_thin")
    thick = (replace(link, inertia=link.inertia + 0.01 * link.mass * np.eye(3)) for link in thin.links)
    description = replace(thin, links=tuple(thick))
    robot, oracle = build_robot(description), Oracle(description)
    q, v, _ = (x[0] for x in random_states(description, "fixed", 0, 1))
    tau = np.arange(1.0, len(robot.motors) + 1)
    a = hybridyn.ddm(robot, q, v, tau)
    Z = oracle.motions(q)
    idle = Z @ np.linalg.svd(Z[oracle.motors])[2][len(oracle.motors) :].T
    assert idle.shape[1] == 6
    spun = a + idle @ np.array([1.0, -2.0, 0.5, 1.5, -1.0, 2.0]) / np.abs(idle).max()
    close_to(hybridyn.idm(robot, q, v, spun), tau, SOLVED)


@pytest.mark.parametrize("carries", [False, True])
def test_states_in_gimbal_lock_of_a_wrist_are_accepted(carries: bool) -> None:
    """Its joints cannot follow every motion of the platform, whether a loop closes at its end or not."""
    description = with_aligned_wrist(random_mechanism(1, kind="gough_gimbals"), 0.0, carries)
    robot = build_robot(description)
    platform = robot.modules[0].outputs[0]
    pose = hybridyn.kinematics(robot, robot.home, np.zeros(robot.nv), links=[platform])[platform].pose
    moved = np.array([0.1, -0.2, 0.3, 0.5, -0.4, 0.3])
    q, v, a = hybridyn.assemble(robot, platforms={platform: (pose, moved, 2 * moved)}, guess=robot.home)
    assert np.isfinite(hybridyn.idm(robot, q, v, a)).all()


@pytest.mark.parametrize(("speed", "said"), [(0.0, False), (1e8, True)])
def test_efforts_that_are_rounding_are_reported_where_it_harms(
    speed: float, said: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """Two equal masses balance about a pivot: at rest the rounding of their weights is nothing to a motor."""
    links = [Link(name, 2.0, np.array([x, 0, 0]), 0.01 * np.eye(3)) for name, x in (("a", -0.3), ("b", 0.1))]
    base, out = Link("base", 0.0, np.zeros(3), np.zeros((3, 3))), np.eye(4)
    out[0, 3] = 0.2
    axis = np.array([0.0, 1.0, 0.0])
    joints = [
        Joint("pivot", "revolute", "base", "a", np.eye(4), axis),
        Joint("hinge", "revolute", "a", "b", out, axis),
    ]
    beam = Description("beam", (base, *links), tuple(joints), (), (), ("pivot", "hinge"))
    robot = build_robot(beam)
    q, v = np.array([[0.3, 0.0], [0.7, 0.0]]), np.array([[speed, 0.0]] * 2)
    hybridyn.idm(robot, q, v, np.zeros((2, 2)))
    assert ("its efforts have no correct digit" in caplog.text) is said


TOLERANCE = 1e-13  # rounding of a closed form with terms of order twenty

BAR = """<link name="{name}"><inertial><origin xyz="{half} 0 0"/><mass value="1"/>
  <inertia ixx="0.001" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
HINGE = """<joint name="{name}" type="revolute" independent="{driven}"><parent link="{parent}"/>
  <child link="{child}"/><origin xyz="{at} 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-9" upper="9" effort="99" velocity="9"/></joint>"""


def parallelogram(folder: Path) -> hybridyn.HybridRobot:
    """Crank and rocker of 1 m, coupler and ground of 2 m, bars of 1 kg with 0.1 kg m^2 about the middle."""
    parts = [
        '<robot name="parallelogram"><link name="ground"/>',
        *(
            BAR.format(name=name, half=half)
            for name, half in (("crank", 0.5), ("coupler", 1), ("rocker", 0.5))
        ),
        HINGE.format(name="a", driven="true", parent="ground", child="crank", at=0),
        HINGE.format(name="b", driven="false", parent="crank", child="coupler", at=1),
        HINGE.format(name="c", driven="false", parent="ground", child="rocker", at=2),
        """<loop name="l" type="revolute"><predecessor link="coupler"><origin xyz="2 0 0"/></predecessor>
        <successor link="rocker"><origin xyz="1 0 0"/></successor><axis xyz="0 0 1"/></loop></robot>""",
    ]
    return hybridyn.load(save(folder, "".join(parts), "parallelogram.urdf"), gravity=(0, -9.81, 0))


def effort(angle: float, acceleration: float) -> float:
    """Closed form: inertia 2 (0.1 + 0.25) + 1 about the crank, weight on an arm of (0.5 + 1 + 0.5) cos."""
    return 1.7 * acceleration + 2.0 * 9.81 * np.cos(angle)


@pytest.mark.parametrize("angle", [0.1, 1e-3, 1e-6])
def test_the_way_to_the_change_point(tmp_path: Path, angle: float) -> None:
    """The effort stays right however near; the loss of digits is that of the pivot, eps / angle."""
    robot = parallelogram(tmp_path)
    q, v, a = np.array([angle, -angle, angle]), np.array([1.0, -1.0, 1.0]), np.array([0.5, -0.5, 0.5])
    lost = TOLERANCE + 10 * np.finfo(float).eps / angle
    assert hybridyn.idm(robot, q, v, a) == pytest.approx(effort(angle, 0.5), rel=lost)


def test_the_change_point_itself(tmp_path: Path) -> None:
    """Two motions are possible there; the one that the linkage is on says the effort, or nothing does."""
    robot = parallelogram(tmp_path)
    q, v, a = np.zeros(3), np.array([1.0, -1.0, 1.0]), np.array([0.5, -0.5, 0.5])
    for call in (partial(hybridyn.idm, robot, q, v, a), partial(hybridyn.ddm, robot, q, v, np.zeros(1))):
        refused(call, hybridyn.SingularityError, "closures lose rank at sample 0", what="closures")
    tau = hybridyn.idm(robot, q, v, a, on_singular="least-norm")
    assert tau == pytest.approx(effort(0.0, 0.5), rel=TOLERANCE)


GRADES = [1.0, 1e6, 1e12]  # heaviest over lightest coordinate
SAMPLES, SIZE = 5, 4


def drawn(rank: int, grade: float = 1.0) -> np.ndarray:
    """Return C^T C for C of shape (samples, rank, size), its coordinates graded."""
    C = np.random.default_rng(0).normal(size=(SAMPLES, rank, SIZE)) * grade ** -np.linspace(0, 0.5, SIZE)
    return np.matmul(np.swapaxes(C, 1, 2), C)


@pytest.mark.parametrize("grade", GRADES)
def test_light_coordinates_stay_accurate_beside_heavy_ones(grade: float) -> None:
    A = drawn(7, grade)
    x = np.random.default_rng(1).normal(size=(SAMPLES, SIZE, 2)) * grade ** np.linspace(0, 0.5, SIZE)[:, None]
    factor = InertiaFactor(A, 16 * EPS * np.diagonal(A, axis1=1, axis2=2))
    solved, left = factor.solve(np.matmul(A, x))
    assert not factor.massless.any()
    assert not left.any()
    # Every coordinate by itself: its unit is its own rounding.
    unit = grade ** np.linspace(0, 0.5, SIZE)[:, None]
    close_to(solved / unit, x / unit, 1e3 * ROUNDING)


def test_each_sample_decides_by_itself() -> None:
    A = np.stack([drawn(SIZE)[0], drawn(2)[0], np.zeros((SIZE, SIZE))])
    factor = InertiaFactor(A, np.full((3, SIZE), 1e-13))
    assert factor.massless.sum(axis=1).tolist() == [0, SIZE - 2, SIZE]
    b = np.random.default_rng(2).normal(size=(3, SIZE, 1))
    alone = [InertiaFactor(A[t : t + 1], np.full((1, SIZE), 1e-13)).solve(b[t : t + 1]) for t in range(3)]
    together = factor.solve(b)
    for t in range(3):
        assert np.array_equal(together[0][t], alone[t][0][0])
        assert np.array_equal(together[1][t], alone[t][1][0])


@pytest.mark.parametrize(("samples", "size"), [(0, 3), (2, 0), (0, 0), (1, 1)])
def test_nothing_is_a_matrix_too(samples: int, size: int) -> None:
    factor = InertiaFactor(np.tile(np.eye(size), (samples, 1, 1)), np.full((samples, size), EPS))
    x, left = factor.solve(np.ones((samples, size, 2)))
    assert np.array_equal(x, np.ones((samples, size, 2)))
    assert not left.any()
