"""The inverse model: against the oracle and a closed form; motors too many, too few; what it refuses."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.description.records import Closure, Coupling, Description, Joint, Link
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.oracle import Base, Oracle
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.posing import position
from tests.support.comparing import SOLVED, close_to, refused
from tests.support.engines import engine_of
from tests.support.samples import slow

ALONE = 1e-13  # of the largest effort: NumPy sums batches of different length in different order


# -------------------------------------------------------------------- a closed form

L1, L2 = 0.4, 0.55  # crank and rod [m], both sides
WIDTH = 0.5  # between the motors
MASS = {"crank": 1.3, "rod": 0.8}
INERTIA = {"crank": 0.02, "rod": 0.05}  # about the centre of mass, in the middle of each bar
GRAVITY = 9.81


def symmetric_five_bar() -> Description:
    """Return a vertical five-bar in the x-z plane: motors at x = 0 and WIDTH, turning from x to z."""
    axis = np.array([0.0, -1.0, 0.0])

    def at(x: float) -> Array:
        M = np.eye(4)
        M[0, 3] = x
        return M

    def bar(name: str, kind: str, length: float) -> Link:
        inertia = np.diag([0.0, INERTIA[kind], INERTIA[kind]])
        return Link(name, MASS[kind], np.array([length / 2, 0, 0]), inertia)

    links = [Link("base", 0.0, np.zeros(3), np.zeros((3, 3)))]
    joints = []
    for side, x in (("left", 0.0), ("right", WIDTH)):
        links += [bar(f"{side}_crank", "crank", L1), bar(f"{side}_rod", "rod", L2)]
        joints.append(Joint(side, "revolute", "base", f"{side}_crank", at(x), axis))
        joints.append(Joint(f"{side}_elbow", "continuous", f"{side}_crank", f"{side}_rod", at(L1), axis))
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # closure axis y
    A = at(L2)
    A[:3, :3] = turn
    closure = Closure("tip", "revolute", "left_rod", A, "right_rod", A, (0, 1, 2), "parallel")
    left, right = 2.0, 1.1
    rods = rod_angles(left, right)
    home = {
        "left": (left,),
        "right": (right,),
        "left_elbow": (rods[0] - left,),
        "right_elbow": (rods[1] - right,),
    }
    return Description("by_hand", tuple(links), tuple(joints), (closure,), (), ("left", "right"), "", home)


def rod_angles(left: float, right: float) -> tuple[float, float]:
    """Return both rods' angles: the tip is above the line between the elbows."""
    B = np.array([L1 * np.cos(left), L1 * np.sin(left)])
    D = np.array([WIDTH + L1 * np.cos(right), L1 * np.sin(right)])
    between = D - B
    half = np.linalg.norm(between) / 2
    up = np.array([-between[1], between[0]]) / (2 * half)
    tip = (B + D) / 2 + np.sqrt(L2**2 - half**2) * up
    return float(np.arctan2(*(tip - B)[::-1])), float(np.arctan2(*(tip - D)[::-1]))


def efforts_by_hand(angle: Array, rate: Array, acceleration: Array) -> Array:
    """Return both motor torques by Lagrange's equation on four bars, angles (left, right) of the cranks.

    Rods: L2 (e(b1) - e(b2)) = r(angles) gives b', b'' by differentiating twice; then, for every bar, virtual
    work of m (acceleration of its middle + g) and of I b'' along d(bar)/d(crank angle).
    """
    b = np.array(rod_angles(*angle))

    def e(t: float) -> Array:
        return np.array([np.cos(t), np.sin(t)])

    def n(t: float) -> Array:
        return np.array([-np.sin(t), np.cos(t)])

    # B + L2 e(b1) = D + L2 e(b2): differentiate, J_b b' = J_a a'
    J_b = L2 * np.column_stack([n(b[0]), -n(b[1])])
    J_a = L1 * np.column_stack([-n(angle[0]), n(angle[1])])
    G = np.linalg.solve(J_b, J_a)  # db/dangle
    b_dot = G @ rate
    swing = L2 * (e(b[0]) * b_dot[0] ** 2 - e(b[1]) * b_dot[1] ** 2)
    swing += L1 * (e(angle[0]) * rate[0] ** 2 - e(angle[1]) * rate[1] ** 2)
    b_ddot = G @ acceleration + np.linalg.solve(J_b, swing)
    g = np.array([0.0, GRAVITY])
    tau = np.zeros(2)
    for i in range(2):
        crank = L1 / 2 * (n(angle[i]) * acceleration[i] - e(angle[i]) * rate[i] ** 2) + g
        tau[i] += MASS["crank"] * crank @ n(angle[i]) * L1 / 2 + INERTIA["crank"] * acceleration[i]
        middle = L1 * (n(angle[i]) * acceleration[i] - e(angle[i]) * rate[i] ** 2)
        middle += L2 / 2 * (n(b[i]) * b_ddot[i] - e(b[i]) * b_dot[i] ** 2)
        moved = np.outer(L2 / 2 * n(b[i]), G[i])
        moved[:, i] += L1 * n(angle[i])
        tau += MASS["rod"] * (middle + g) @ moved + INERTIA["rod"] * b_ddot[i] * G[i]
    return tau


def test_five_bar_agrees_with_a_closed_form() -> None:
    robot = build_robot(symmetric_five_bar())
    rng = np.random.default_rng(0)
    angle = np.array([2.0, 1.1]) + 0.15 * np.sin(np.linspace(0, 6, 60)[:, None] + [0.0, 1.0])
    rate, acceleration = rng.normal(size=(2, 60, 2)) * [[[2.0]], [[9.0]]]
    motors = {m: (angle[:, i], rate[:, i], acceleration[:, i]) for i, m in enumerate(("left", "right"))}
    q, v, a = hybridyn.assemble(robot, motors=motors)
    rods = np.array([rod_angles(*x) for x in angle])
    for i, side in enumerate(("left", "right")):
        elbow = position(robot, f"{side}_elbow", q) + angle[:, i] - rods[:, i]
        assert np.abs(np.sin(elbow / 2)).max() < 1e-12
    expected = np.array([efforts_by_hand(*x) for x in zip(angle, rate, acceleration, strict=True)])
    close_to(hybridyn.idm(robot, q, v, a), expected, SOLVED)


# -------------------------------------------------------------------- more motors than freedoms


def states(
    kind: str, seed: int = 0, count: int = 3, base: Base = "fixed"
) -> tuple[hybridyn.HybridRobot, Array, Array, Array]:
    description = random_mechanism(seed, kind=kind)
    return build_robot(description, base=base), *random_states(description, base, seed, count)


def with_efforts(description: Description, limits: list[float]) -> Description:
    limit = dict(zip(description.motors, limits, strict=True))
    return replace(
        description, joints=tuple(replace(j, effort=limit.get(j.name, np.inf)) for j in description.joints)
    )


@pytest.mark.parametrize(
    "kind", ["four_bar_two_motors", "five_bar_four_motors", "gough_eight_motors", "star_universal"]
)
def test_redundant_motors_share_by_weights(kind: str) -> None:
    robot, q, v, a = states(kind)
    oracle = Oracle(robot.description)
    weights = np.linspace(1.0, 3.0, len(robot.motors))
    expected = np.array([oracle.idm(*s, weights=weights) for s in zip(q, v, a, strict=True)])
    tau = hybridyn.idm(robot, q, v, a, weights=weights)
    close_to(tau, expected, SOLVED)
    by_name = dict(zip(robot.motors, weights, strict=True))
    assert np.array_equal(hybridyn.idm(robot, q, v, a, weights=by_name), tau)
    close_to(hybridyn.idm(robot, q, v, a, weights=1e6 * weights), tau, SOLVED)  # only ratios count
    even = hybridyn.idm(robot, q, v, a, weights=np.ones(len(weights)))
    if kind in ("four_bar_two_motors", "five_bar_four_motors"):  # of one unit
        close_to(hybridyn.idm(robot, q, v, a), even, SOLVED)
    assert np.abs(even - tau).max() > 1e-3 * np.abs(tau).max()
    assert (np.sum(weights * tau**2, axis=1) < np.sum(weights * even**2, axis=1)).all()


def test_effort_limits_share_where_no_weights_are_given() -> None:
    description = random_mechanism(0, kind="gough_eight_motors")
    limits = list(np.linspace(50.0, 400.0, 8))
    robot = build_robot(with_efforts(description, limits))
    q, v, a = random_states(description, "fixed", 0, 2)
    tau = hybridyn.idm(robot, q, v, a)
    close_to(tau, hybridyn.idm(robot, q, v, a, weights=1 / np.square(limits)), SOLVED)


# -------------------------------------------------------------------- fewer motors than freedoms


def test_a_passive_motion_that_needs_an_effort_is_named_and_sized() -> None:
    robot, q, v, a = states("five_bar_one_motor")
    oracle = Oracle(robot.description)
    wrong = np.array([a[0], oracle.consistent_acceleration(q[1], v[1], a[1] + 1.0), a[2]])
    hybridyn.idm(robot, q, v, a)
    words = r"1 motor for 2 freedoms.*N m that the motion of.*passive=\"solved\""
    module = robot.modules[0].name
    error = refused(
        lambda: hybridyn.idm(robot, q, v, wrong), hybridyn.ActuationError, words, sample=1, module=module
    )
    assert error.size > 0
    assert any(f"'{joint}'" in str(error.direction) for joint in robot.joints)


def test_a_missing_force_is_in_newtons_and_a_missing_moment_in_newton_metres() -> None:
    """A body of 3 kg at rest on a floating base, its limbs 4 m apart; only the numbers of the body decide."""
    body = Link("body", 3.0, np.zeros(3), np.diag([1.0, 2.0, 5.0]))
    foot = replace(body, name="foot", mass=0.0, inertia=np.zeros((3, 3)))
    far = np.eye(4)
    far[0, 3] = 4.0
    reach = Joint("reach", "revolute", "body", "foot", far, np.array([1.0, 0, 0]))
    robot = build_robot(Description("body", (body, foot), (reach,), (), (), (), ""), base="floating")
    rest = np.zeros(robot.nv)
    words = r"the 29.4 N that the motion of .*\(z\) needs"
    error = refused(lambda: hybridyn.idm(robot, robot.home, rest, rest), hybridyn.ActuationError, words)
    assert error.size == pytest.approx(3.0 * 9.81)
    turning, words = 30.0 * np.eye(robot.nv)[5], r"the 150 N m that the motion of .*\(rz\) needs"
    spun = partial(hybridyn.idm, robot, robot.home, rest, turning, effects=["inertia"])
    refused(spun, hybridyn.ActuationError, words)


# -------------------------------------------------------------------- singular postures


def flat_five_bar() -> tuple[hybridyn.HybridRobot, Array]:
    """Return the five-bar where both rods stand in one line: the motors cannot hold the tip across it."""
    robot = build_robot(symmetric_five_bar())
    # cranks at angles +-t with elbows 2 L2 apart on a level line
    t = np.arccos((L2 - WIDTH / 2) / L1)
    left, right = np.pi - t, t
    q = np.array(
        [*_angle(robot, "left", left), *_angle(robot, "left_elbow", -left),
         *_angle(robot, "right", right), *_angle(robot, "right_elbow", np.pi - right)]
    )  # fmt: skip
    return robot, q


def _angle(robot: hybridyn.HybridRobot, joint: str, angle: float) -> tuple[float, ...]:
    return (
        (angle,) if robot.kinds[robot.joints.index(joint)] == "revolute" else (np.cos(angle), np.sin(angle))
    )


def test_a_parallel_singularity_raises_and_names_module_and_motor() -> None:
    robot, q = flat_five_bar()
    assert list(robot.joints) == ["left", "left_elbow", "right", "right_elbow"]
    zero = np.zeros(4)
    words = r"motors lose a direction at sample 0.*least-norm"
    asked = partial(hybridyn.idm, robot, q, zero, zero)
    error = refused(
        asked, hybridyn.SingularityError, words, what="motors", sample=0, module=robot.modules[0].name
    )
    assert error.condition > 1e10
    words = r"motors lose a direction at sample 0 .* their accelerations alone do not determine the motion"
    solved = partial(hybridyn.idm, robot, q, zero, zero, passive="solved")
    refused(solved, hybridyn.SingularityError, words, what="motors", sample=0, module=robot.modules[0].name)


def test_least_norm_goes_on_through_a_parallel_singularity() -> None:
    """No motor can hold the rods' common line up; what can be held is held with the least efforts.

    Under gravity alone that is nothing at all, by symmetry: it may not depend on the choice of coordinates.
    """
    robot, q = flat_five_bar()
    zero = np.zeros(4)
    assert np.abs(hybridyn.idm(robot, q, zero, zero, on_singular="least-norm")).max() < ALONE
    load = {"left_rod": np.array([3.0, 0.0, 2.0, 0.0, 1.0, 0.0])}
    tau = hybridyn.idm(robot, q, zero, zero, on_singular="least-norm", wrenches=load)
    assert np.abs(tau).min() > 0.1
    close_to(tau, Oracle(robot.description).idm_and_missing(q, zero, zero, load)[0], SOLVED)
    # The others of its batch are as they are alone.
    good = hybridyn.assemble(robot, motors={"left": 2.0, "right": 1.1})[0]
    both = hybridyn.idm(robot, np.stack([good, q]), *np.zeros((2, 2, 4)), on_singular="least-norm")
    close_to(both[0], hybridyn.idm(robot, good, zero, zero), ALONE)
    raising = partial(hybridyn.idm, robot, np.stack([good, q]), *np.zeros((2, 2, 4)))
    refused(raising, hybridyn.SingularityError, "motors lose", sample=1)


def tilting_five_bar(*motors: str) -> hybridyn.HybridRobot:
    """Return the five-bar with the left crank on a hinge across its plane, `tilt`, that the loop locks."""
    plain = symmetric_five_bar()
    base, *links = plain.links
    joints = [replace(joint, parent="bracket") if joint.name == "left" else joint for joint in plain.joints]
    across = Joint("tilt", "revolute", "base", "bracket", np.eye(4), np.array([1.0, 0.0, 0.0]))
    description = replace(
        plain,
        links=(base, replace(base, name="bracket"), *links),
        joints=(across, *joints),
        motors=motors,
        home={"tilt": (0.0,), **plain.home},
    )
    return build_robot(description)


@pytest.mark.parametrize("engine", ["general", slow("compiled")])
def test_a_motor_that_the_loops_lock_drives_nothing(engine: str) -> None:
    """Two motors for two freedoms, and the loops lock one: least-norm leaves nothing out that is regular."""
    on = engine_of(engine, tilting_five_bar("left", "tilt"))
    rest = np.zeros(on.robot.nv)
    words = r"2 motors \(the closures lock 'tilt'\) for 2 freedoms; no motor can produce"
    for more in ({}, {"on_singular": "least-norm"})[: 2 if engine == "general" else 1]:
        refused(lambda: on.idm(on.robot.home, rest, rest, **more), hybridyn.ActuationError, words)  # noqa: B023


def test_two_motors_on_one_motion_are_one_too_few() -> None:
    """A gear ties two motors of the five-bar together: no count tells it, but the rank of their rows does."""
    plain = symmetric_five_bar()
    base = plain.links[0]
    wheel = Joint("wheel", "revolute", "base", "disc", np.eye(4), np.array([0.0, 1.0, 0.0]))
    disc = Link("disc", 0.1, np.zeros(3), 1e-3 * np.eye(3))
    geared = replace(
        plain,
        links=(base, *plain.links[1:], disc),
        joints=(*plain.joints, wheel),
        couplings=(Coupling("gear", (("wheel", 1.0), ("left", -0.5)), -1.0),),
        motors=("left", "wheel"),
        home=plain.home | {"wheel": (0.0,)},
    )
    robot = build_robot(geared)
    assert robot.mobility == 2
    rest = np.zeros(robot.nv)
    asked = partial(hybridyn.idm, robot, robot.home, rest, rest, on_singular="least-norm")
    refused(asked, hybridyn.ActuationError, "2 motors for 2 freedoms; no motor can produce")


@pytest.mark.parametrize("motors", [("left", "right", "tilt"), ("left", "left_elbow", "right", "tilt")])
def test_a_least_norm_answer_at_a_regular_posture_gives_the_asked_accelerations(motors: Any) -> None:
    """A locked motor beside enough others, and too many motors: `ddm` returns what was asked."""
    robot = tilting_five_bar(*motors)
    given = {"left": (2.0, 0.3, -0.7), "right": (1.1, -0.2, 0.4)}
    q, v, a = hybridyn.assemble(robot, motors=given)
    tau = hybridyn.idm(robot, q, v, a, on_singular="least-norm")
    close_to(hybridyn.ddm(robot, q, v, tau), a, SOLVED)


@pytest.mark.parametrize("off", [1e-2, 1e-4, 1e-6])
def test_efforts_grow_as_they_should_near_a_singularity(off: float) -> None:
    """Still the oracle's, to what the conditioning leaves."""
    robot, q = flat_five_bar()
    description = robot.description
    motors = {m: position(robot, m, q) - s * off for m, s in (("left", 1.0), ("right", -1.0))}
    near = hybridyn.assemble(robot, motors=motors)[0]
    zero = np.zeros(4)
    tau = hybridyn.idm(robot, near, zero, zero)
    close_to(tau, Oracle(description).idm(near, zero, zero), 1e-13 / off)


# -------------------------------------------------------------------- wrenches


@pytest.mark.parametrize("kind", ["stack", "gough_gimbals"])
def test_wrenches_act_on_links_as_the_oracles(kind: str) -> None:
    """On every link at once, fixed, massless and inside wrists alike."""
    description = random_mechanism(3, kind=kind)
    robot, oracle = build_robot(description, base="moving"), Oracle(description, "moving")
    q, v, a = (x[0] for x in random_states(description, "moving", 3, 1))
    rng = np.random.default_rng(0)
    wrenches = {link: rng.normal(size=6) for link in robot.bodies.place}
    expected = oracle.idm(q, v, a, wrenches)
    close_to(hybridyn.idm(robot, q, v, a, wrenches=wrenches), expected, SOLVED)


def test_wrenches_per_sample_or_for_all() -> None:
    robot, q, v, a = states("five_bar", count=3)
    link = robot.description.links[0].name
    w = np.random.default_rng(0).normal(size=(3, 6))
    tau = hybridyn.idm(robot, q, v, a, wrenches={link: w})
    for t in range(3):
        close_to(hybridyn.idm(robot, q, v, a, wrenches={link: w[t]})[t], tau[t], ALONE)


# -------------------------------------------------------------------- refusals

#: A robot, what `idm` is asked, and what it says.
REFUSALS: dict[str, tuple[str, dict[str, Any], type[Exception], str]] = {
    "nobody": (
        "four_bar",
        {"wrenches": {"nobody": np.zeros(6)}},
        hybridyn.TrajectoryError,
        "wrench on unknown link 'nobody'",
    ),
    "nearly": (
        "four_bar",
        {"wrenches": {"bass": np.zeros(6)}},
        hybridyn.TrajectoryError,
        r"link 'bass' \(did you mean 'base'\?\)",
    ),
    "five": (
        "four_bar",
        {"wrenches": {"base": np.zeros(5)}},
        hybridyn.TrajectoryError,
        r"wrench on 'base' has shape \(5,\); wanted \(6,\) or \(T, 6\)",
    ),
    "two samples": (
        "four_bar",
        {"wrenches": {"base": np.zeros((2, 6))}},
        hybridyn.TrajectoryError,
        r"has shape \(2, 6\)",
    ),
    "nan": (
        "four_bar",
        {"wrenches": {"base": np.full(6, np.nan)}},
        hybridyn.TrajectoryError,
        "wrench on 'base' is not finite",
    ),
    "on_singular": ("four_bar", {"on_singular": "ignore"}, hybridyn.TrajectoryError, "on_singular must be"),
    "passive": ("four_bar", {"passive": "guessed"}, hybridyn.TrajectoryError, "passive must be"),
    "few weights": (
        "five_bar_four_motors",
        {"weights": np.ones(3)},
        hybridyn.ActuationError,
        "weights must be 4 positive",
    ),
    "negative": (
        "five_bar_four_motors",
        {"weights": -np.ones(4)},
        hybridyn.ActuationError,
        "weights must be 4 positive",
    ),
    "nan weight": (
        "five_bar_four_motors",
        {"weights": [1, 1, 1, np.nan]},
        hybridyn.ActuationError,
        "weights must be 4 positive",
    ),
    "no weight": (
        "five_bar_four_motors",
        {"weights": np.zeros(4)},
        hybridyn.ActuationError,
        "weights must be 4 positive",
    ),
    "weights by name": (
        "five_bar_four_motors",
        {"weights": {"nobody": 1.0}},
        hybridyn.ActuationError,
        "unknown motors",
    ),
    "units": (
        "gough_eight_motors",
        {},
        hybridyn.ActuationError,
        r"8 motors, some in N and some in N m, share 6 freedoms. Give weights",
    ),
    "one limit": ("one limit", {}, hybridyn.ActuationError, "an effort limit for each motor"),
    "no motors": ("no motors", {}, hybridyn.ActuationError, r"0 motors for 1 freedom; "),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_what_is_refused(what: str) -> None:
    kind, given, error, words = REFUSALS[what]
    drawn = {"one limit": "gough_eight_motors", "no motors": "four_bar"}
    robot, q, v, a = states(drawn.get(kind, kind))
    if kind == "one limit":
        robot = build_robot(with_efforts(robot.description, [100.0] * 7 + [np.inf]))
    elif kind == "no motors":
        robot = build_robot(replace(robot.description, motors=()))
    refused(lambda: hybridyn.idm(robot, q, v, a, **given), error, words)


def test_rates_inside_a_cut_wrist_are_checked_too() -> None:
    """A gimbal's own joints are recovered, not integrated: wrong rates there must not pass in silence."""
    robot, q, v, a = states("gough_gimbals", seed=1)
    module = robot.modules[0]
    inside = next(w for w in module.mechanism.spec.wrists if len(w.joints) == 3 and not w.carries).joints
    column = int(module.v_index[module.mechanism.spanning.v_slices[inside[1]].start])
    wrong = v + np.eye(robot.nv)[column]
    refused(lambda: hybridyn.idm(robot, q, wrong, a), hybridyn.AssemblyError, "rates")
