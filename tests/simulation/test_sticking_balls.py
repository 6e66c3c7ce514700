"""Balls that stick: rods on cups against statics and hinges, loops, programs over cones, and energy."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import hybridyn
from hybridyn import simulate
from hybridyn.description.records import Description, Joint, Link
from hybridyn.dynamics.holding import Hold
from hybridyn.dynamics.stiction import STARTS, friction_of
from hybridyn.effects import CoulombFriction, LoadFriction
from hybridyn.effects.joints import WIDTH
from hybridyn.errors import ModelError
from hybridyn.joints.kinds import JointKind
from hybridyn.simulation.motion_law import MotionLaw
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.effects.test_friction_statics import WELD, Z, linkage
from tests.simulation.test_stiction import GROWS
from tests.support.comparing import refused

SLOW = pytest.mark.slow
G, LENGTH, RUB = 9.81, 0.5, 0.02
#: Part of a level by which a moment is below or above it.
EDGE = 1e-10
#: A run on a ball against one on a hinge: tolerances of both, over some hundred steps [rad].
SAME = 1e-7
AXIS = np.array([0.6, 0.8, 0.0])
ACROSS = np.cross([0.0, 0.0, 1.0], AXIS)


def rods(slope: float, *kinds: str, up: float = 1.0, center: float = LENGTH / 2) -> hybridyn.HybridRobot:
    """Rods of 2 kg on each other's ends, on ground that falls across `AXIS`; they hang where up is -1."""
    gravity = G * (np.sin(slope) * ACROSS - up * np.array([0.0, 0.0, np.cos(slope)]))
    names = ["ground", *(f"rod{i}" for i in range(len(kinds)))]
    links = [Link("ground", 1.0, np.zeros(3), np.eye(3))]
    links += [Link(n, 2.0, np.array([0, 0, center]), np.diag([0.05, 0.05, 0.04])) for n in names[1:]]
    end = np.eye(4)
    end[2, 3] = LENGTH
    joints = [
        Joint(f"cup{i}", JointKind(kind), names[i], names[i + 1], end if i else np.eye(4), AXIS)
        for i, kind in enumerate(kinds)
    ]
    return build_robot(Description("rods", tuple(links), tuple(joints), gravity=tuple(gravity.tolist())))


@pytest.mark.parametrize("factor", [1 - EDGE, 1 + EDGE])
def test_a_rod_on_a_cup_holds_up_to_the_angle_at_which_its_moment_is_the_level(factor: float) -> None:
    """Where m g (l / 2) sin(angle) = rub m g, about an axis that is none of the joint."""
    robot = rods(float(np.arcsin(factor * RUB / (LENGTH / 2))), "spherical")
    end = 1e6 if factor < 1 else 1e-3
    run = simulate(robot, robot.home, np.zeros(3), (0, end), effects=["default", LoadFriction({"cup0": RUB})],
                   stiction=True, method="rk4", step=end)  # fmt: skip
    assert np.array_equal(run.q[-1], robot.home) == (factor < 1)
    assert run.v[-1].any() == (factor > 1)
    assert factor < 1 or run.v[-1] @ AXIS < -0.999 * np.linalg.norm(run.v[-1])  # it falls across the axis


@pytest.mark.parametrize("end", [0.02, pytest.param(4.0, marks=SLOW)])
def test_a_rod_that_swings_on_a_cup_moves_and_rests_as_on_a_hinge(end: float) -> None:
    """In a plane the load of both is the same; it is larger near rest, where the rod turns back or stays."""
    law = LoadFriction({"cup0": RUB}, static={"cup0": 1.3}, speed={"cup0": 0.1})
    angles = []
    for kind in ("spherical", "revolute"):
        robot = rods(0.3, kind, up=-1.0)
        run = simulate(robot, robot.home, np.zeros(robot.nv), (0, end), effects=["default", law],
                       stiction=True, rtol=1e-9, atol=1e-11)  # fmt: skip
        q = run.q[-1]
        angles.append(q[0] if kind == "revolute" else 2 * np.arctan2(q[:3] @ AXIS, q[3]))
        assert run.v[-1].any() == (end < 4)
    assert abs(angles[0] - angles[1]) < SAME
    assert abs(angles[0]) > 1e-4


def test_a_ball_without_force_turns_as_without_friction() -> None:
    """It holds no moment, and its friction has no direction of its own."""
    robot, turn = rods(0.0, "spherical", up=0.0, center=0.0), {"rod0": np.array([0, 0, 0, 0.3, 0.1, 0])}
    rates = [
        simulate(robot, robot.home, np.zeros(3), (0, 0.1), effects=["default", *law], wrenches=turn,
                 stiction=bool(law)).v[-1]
        for law in ([LoadFriction({"cup0": RUB})], [])
    ]  # fmt: skip
    assert rates[0].any()
    assert np.abs(rates[0] - rates[1]).max() < SAME


def coupled(kind: str) -> hybridyn.HybridRobot:
    """A four-bar whose coupler turns on two joints of a kind."""
    return linkage(
        [("crank", "revolute", "ground", "arm", (0, 0), Z),
         ("first", kind, "arm", "coupler", (0.1, 0.3), Z),
         ("second", kind, "coupler", "ring", (0.7, 0.5), Z),
         ("rocker", "revolute", "ground", "output", (0.8, 0.0), Z)],
        [("ring", "output", (0.7, 0.5), WELD)], ["crank"],
    )  # fmt: skip


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_coupler_between_two_balls_holds_what_the_inverse_model_needs_on_hinges(sign: float) -> None:
    """The coupler could also spin, which needs friction and no load: the motion stays plane."""
    radii, load = {"crank": 0.012, "first": 0.02, "second": 0.015, "rocker": 0.009}, np.zeros(6)
    load[5] = 12.0
    hinged, robot = coupled("revolute"), coupled("spherical")
    q, v, a = hybridyn.assemble(hinged, motors={"crank": (0.0, sign * 1e-9, 0.0)})
    drive = ["inertia", LoadFriction(radial=radii, width=1e-13)]
    needed = hybridyn.idm(hinged, q, v, 0 * a, wrenches={"output": load}, effects=drive)
    law = MotionLaw(robot, needed, {"output": load}, ["inertia", LoadFriction(radial=radii)], stiction=True)
    free = law.free(0.0, robot.home, np.zeros(robot.nv))
    held = friction_of(free, np.zeros(8), held=True).held
    assert held is not None
    assert abs(held.ratio - 1.0) < 1e-9  # the rates of 1e-9 rad/s, and rounding over the margin
    assert held.motion[0] == sign


def test_what_balls_hold_together_is_the_largest_power_of_a_motion_over_what_resists_it() -> None:
    """Two motions of two balls and a hinge, against a search over all their mixtures."""
    rng, balls = np.random.default_rng(4), [np.array([0, 1, 2]), np.array([4, 5, 6])]
    for _ in range(5):
        motions, load, mass = rng.normal(size=(2, 7)), rng.normal(size=2), np.diag(rng.uniform(0.1, 1.0, 2))
        level = np.repeat(rng.uniform(0.5, 2, 3), [3, 1, 3])
        back = np.where(np.arange(7) == 3, 2 * level, level)
        hold = Hold(motions.T @ mass @ motions, balls)
        got = hold.share(-hold.inverse @ motions.T @ mass @ load, level, back)

        def part(angle: float) -> float:
            rates = np.array([np.cos(angle), np.sin(angle)]) @ motions  # noqa: B023
            single = level[3] * max(rates[3], 0) + back[3] * max(-rates[3], 0)  # noqa: B023
            resists = sum(level[at[0]] * np.linalg.norm(rates[at]) for at in balls) + single  # noqa: B023
            return -float(load @ [np.cos(angle), np.sin(angle)]) / resists  # noqa: B023

        coarse = min(np.linspace(0, 2 * np.pi, 400), key=part)
        best = minimize_scalar(part, (coarse - 0.02, coarse, coarse + 0.02), options={"xtol": 1e-12})
        assert abs(got.ratio + best.fun) < EDGE * got.ratio
        begun = hold.begin(motions.T @ mass @ load, level, back)
        a = motions.T @ mass @ (load + motions @ begun)
        for at in balls:  # an effort at its bound opposes the motion of its ball
            assert np.linalg.norm(begun[at]) < level[at[0]] * (1 + 1e-11)
            moved = float(np.linalg.norm(a[at]))
            assert moved < 1e-9 or np.abs(begun[at] + level[at[0]] * a[at] / moved).max() < 1e-6


@pytest.mark.parametrize("least", [1e-4, 0.0])
def test_balls_of_which_one_holds_far_less_hold_what_the_other_lets_them(least: float) -> None:
    """In one motion the part is the power of the load over what resists it."""
    rng, balls = np.random.default_rng(5), [np.array([0, 1, 2]), np.array([3, 4, 5])]
    for _ in range(4):
        way, level = rng.normal(size=6), np.repeat([least, 1.0], 3)
        hold = Hold(np.outer(way, way), balls)
        got = hold.share(10 * way / (way @ way), level, level)
        lengths = np.array([np.linalg.norm(way[at]) for at in balls])
        assert abs(got.ratio * (least * lengths[0] + lengths[1]) - 10.0) < 10 * EDGE
        for at, length in zip(balls, lengths, strict=True):
            assert np.linalg.norm(got.efforts[at]) < got.ratio * level[at[0]] * (1 + EDGE) + EDGE
            turned = np.abs(got.motion[at] + way[at] / length).max()
            assert turned < 1e-3  # rounding of power over the least that a joint is taken to hold
        assert abs(got.efforts @ way - 10.0) < EDGE


@pytest.mark.parametrize("cases", [2, pytest.param(300, marks=SLOW)])
@pytest.mark.parametrize("excess", [-EDGE, EDGE, 1e-6, 0.5])
def test_balls_of_one_loop_begin_to_move_as_gauss_demands_however_near_their_common_edge(
    excess: float, cases: int
) -> None:
    """Several balls and hinges whose levels are up to 10^4 apart; none is refused.

    Efforts are those of Gauss's principle where each is within its bound and has the least power along the
    acceleration that they leave, which no effort within the bounds undercuts: - sum of level |a|.
    """
    for case in range(cases):
        rng = np.random.default_rng([9, case])
        balls = [np.arange(3 * i, 3 * i + 3) for i in range(rng.integers(2, 5))]
        joints = [*balls, *3 * len(balls) + np.arange(rng.integers(0, 3))[:, None]]
        k, many = joints[-1][-1] + 1, int(rng.integers(1, 6))
        motions, load, mass = rng.normal(size=(many, k)), rng.normal(size=many), rng.normal(size=(many, many))
        mass = mass @ mass.T + 0.1 * np.eye(many)
        level = np.repeat(np.exp(rng.uniform(0, np.log(1e4), len(joints))), [len(at) for at in joints])
        back = level * np.where(np.arange(k) < 3 * len(balls), 1.0, rng.uniform(0.5, 2.0, k))
        hold = Hold(motions.T @ mass @ motions, balls)
        part = hold.share(-hold.inverse @ motions.T @ mass @ load, level, back).ratio
        free = (1 + excess) / part * motions.T @ mass @ load
        efforts = hold.begin(free, level, back)
        a = free + motions.T @ mass @ motions @ efforts
        least = 0.0
        for at in joints:
            assert np.linalg.norm(efforts[at] / (level if efforts[at[0]] < 0 else back)[at]) < 1 + 2 * EDGE
            least -= (level if a[at[0]] > 0 else back)[at[0]] * np.linalg.norm(a[at])
        size = np.abs(free).max() * level.max()
        assert abs(efforts @ a - least) < EDGE * size
        assert efforts @ a < EDGE * size  # friction never drives
        if abs(excess) > EDGE or excess < 0:  # else accelerations are about as large as what counts as rest
            assert (np.abs(a).max() > STARTS * np.abs(free).max()) == (excess > 0)


def test_the_direction_of_a_ball_is_that_of_its_rate_and_next_to_rest_in_part_the_earlier_one() -> None:
    """It is a unit vector, never against the rate unless that has passed rest since."""
    law = MotionLaw(rods(0.0, "spherical"), effects=["default", LoadFriction({"cup0": RUB})], stiction=True)
    rng, sticking = np.random.default_rng(6), law.sticking
    assert sticking is not None
    for speed in 10.0 ** np.arange(-12, 3):
        v, before = rng.normal(size=(2, 3))
        v, before = speed * v / np.linalg.norm(v), before / np.linalg.norm(before)
        now = sticking.directions(v, before)
        assert abs(np.linalg.norm(now) - 1) < 1e-15
        assert (now @ v) * (before @ v) >= 0
        nearer = before if speed < WIDTH else np.copysign(1.0, before @ v) * v / speed
        assert np.linalg.norm(now - nearer) < (1e-15 if speed > 10 * WIDTH else 2 * min(speed / WIDTH, 1.0))
    assert not sticking.directions(v, np.zeros(3)).any()


def test_friction_about_the_axes_of_a_ball_holds_each_by_itself() -> None:
    """Coulomb friction of a ball is a box: a moment first turns the axis with the most of it."""
    robot = rods(0.2, "spherical")
    moment = 2.0 * G * LENGTH / 2 * np.sin(0.2)
    for part, moves in ((0.81, [False] * 3), (0.79, [False, True, False])):
        law = CoulombFriction({"cup0": part * moment})
        run = simulate(robot, robot.home, np.zeros(3), (0, 1e-3), effects=["default", law], stiction=True,
                       method="rk4", step=1e-3)  # fmt: skip
        assert (run.v[-1] != 0).tolist() == moves
    both, start = ["default", law, LoadFriction({"cup0": RUB})], (robot.home, np.zeros(3), (0, 1.0))
    refused(lambda: simulate(robot, *start, effects=both, stiction=True), ModelError,
            "of ball joint 'cup0' about its axes and load_friction")  # fmt: skip


@SLOW
def test_energy_never_grows_until_a_rod_that_hangs_rests_and_stays() -> None:
    """It swings in space and spins; friction turns with the rate, and keeps its size."""
    robot = rods(0.0, "spherical", up=-1.0)
    start: Array = np.array([1.0, 0.4, 1.5])
    law = LoadFriction({"cup0": 3 * RUB})
    run = simulate(robot, robot.home, start, (0, 0.6), effects=["default", law], stiction=True,
                   rtol=1e-7, atol=1e-9)  # fmt: skip
    assert np.diff(run.energy).max() <= GROWS * run.kinetic[0]
    assert len(run.t) < 400  # it ends in steps that shorten its rate, each by some part
    rests = ~run.v.any(axis=1)
    assert rests[-1]
    assert np.ptp(run.q[rests], axis=0).max() < 1e-15
