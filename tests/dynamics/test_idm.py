"""The inverse model: against the oracle and a closed form; motors too many, too few; what it refuses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import ActuationError, AssemblyError, HybridRobot, SingularityError, TrajectoryError
from hybridyn.description.records import Closure, Coupling, Description, Joint, Link
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.comparing import SOLVED, close_to
from tests.mechanisms import KINDS, random_mechanism, random_states, random_wrenches
from tests.oracle import Base, Oracle
from tests.posing import of_joints, position
from tests.samples import in_turn, slow
from tests.shipped import ROBOTS, shipped, states_near_home

BASES: tuple[Base, ...] = ("fixed", "moving", "floating")
STATES = {"lx4": 3, "snake": 2}  # per robot by default; 10 for the others
PER_KIND = 2
ALONE = 1e-13  # of the largest effort: NumPy sums batches of different length in different order


def weights_of(robot: HybridRobot) -> Array:
    return np.linspace(1.0, 3.0, len(robot.motors))


def judged(description: Description, base: Base, seed: int, count: int) -> None:
    """Compare with the oracle at random states under random wrenches, all of them in one batch."""
    wrenches = random_wrenches(description, seed)
    q, v, a = random_states(description, base, seed, count, wrenches=wrenches)
    robot, oracle = build_robot(description, base=base), Oracle(description, base)
    weights = weights_of(robot)
    tau = hybridyn.idm(robot, q, v, a, wrenches=wrenches, weights=weights)
    expected = [oracle.idm(*state, wrenches=wrenches, weights=weights) for state in zip(q, v, a, strict=True)]
    assert tau.shape == (count, len(description.motors))
    close_to(tau, np.array(expected), SOLVED)
    if description.motors:
        assert np.abs(tau).max() > 0


# -------------------------------------------------------------------- against the oracle


def shipped_judged(name: str, base: Base, seed: int, count: int) -> None:
    description = shipped(name)
    robot, oracle = build_robot(description, base=base), Oracle(description, base)
    q, v, a = states_near_home(description, base, seed, count)
    rng = np.random.default_rng(seed)
    chosen = rng.choice([x.name for x in description.links if x.mass > 0], size=3, replace=False)
    wrenches = {str(link): rng.normal(size=(count, 6)) for link in chosen}
    states = [
        (*s, {link: w[t] for link, w in wrenches.items()}) for t, s in enumerate(zip(q, v, a, strict=True))
    ]
    if base == "floating":
        a = np.array([oracle.solve_passive(*s) for s in states])
        states = [(s[0], s[1], a[t], s[3]) for t, s in enumerate(states)]
    tau = hybridyn.idm(robot, q, v, a, wrenches=wrenches)
    close_to(tau, np.array([oracle.idm(*s) for s in states]), SOLVED)


@pytest.mark.parametrize("name", [slow(name) if name == "snake" else name for name in ROBOTS])
def test_shipped_robots_agree_with_the_oracle(name: str) -> None:
    shipped_judged(name, "floating" if name == "snake" else "fixed", 0, STATES.get(name, 10))


@pytest.mark.parametrize(("name", "base"), in_turn(ROBOTS, BASES, None))
def test_shipped_robots_agree_with_the_oracle_on_every_base(name: str, base: Base) -> None:
    shipped_judged(name, base, 1, 2)


@pytest.mark.parametrize(("kind", "base"), in_turn(KINDS, BASES))
def test_every_kind_agrees_with_the_oracle(kind: str, base: Base) -> None:
    judged(random_mechanism(10, kind=kind), base, 10, PER_KIND)


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", ROBOTS)
def test_shipped_robots_agree_with_the_oracle_at_length(name: str, base: Base) -> None:
    shipped_judged(name, base, 2, 4 * STATES.get(name, 10))


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_agrees_with_the_oracle_at_length(kind: str, base: Base) -> None:
    for seed in range(4):
        judged(random_mechanism(seed, kind=kind), base, seed, PER_KIND)


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
) -> tuple[HybridRobot, Array, Array, Array]:
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
    weights = weights_of(robot)
    expected = np.array([oracle.idm(*s, weights=weights) for s in zip(q, v, a, strict=True)])
    tau = hybridyn.idm(robot, q, v, a, weights=weights)
    close_to(tau, expected, SOLVED)
    by_name = dict(zip(robot.motors, weights, strict=True))
    assert np.array_equal(hybridyn.idm(robot, q, v, a, weights=by_name), tau)
    close_to(hybridyn.idm(robot, q, v, a, weights=1e6 * weights), tau, SOLVED)  # only ratios count
    even = hybridyn.idm(robot, q, v, a, weights=np.ones(len(weights)))
    assert np.abs(even - tau).max() > 1e-3 * np.abs(tau).max()
    assert (np.sum(weights * tau**2, axis=1) < np.sum(weights * even**2, axis=1)).all()
    # What both do along the motions is the same.
    for t in range(len(q)):
        B = oracle.motor_map(oracle.posture(q[t]))
        close_to(B @ tau[t], B @ even[t], SOLVED)


def test_effort_limits_share_where_no_weights_are_given() -> None:
    description = random_mechanism(0, kind="gough_eight_motors")
    limits = list(np.linspace(50.0, 400.0, 8))
    robot = build_robot(with_efforts(description, limits))
    q, v, a = random_states(description, "fixed", 0, 2)
    tau = hybridyn.idm(robot, q, v, a)
    close_to(tau, hybridyn.idm(robot, q, v, a, weights=1 / np.square(limits)), SOLVED)


def test_mixed_units_without_weights_are_refused() -> None:
    robot, q, v, a = states("gough_eight_motors")
    with pytest.raises(
        ActuationError, match=r"8 motors, some in N and some in N m, share 6 freedoms. Give weights"
    ) as e:
        hybridyn.idm(robot, q, v, a)
    assert e.value.module == robot.modules[0].name
    one_limit = build_robot(with_efforts(robot.description, [100.0] * 7 + [np.inf]))
    with pytest.raises(ActuationError, match="an effort limit for each motor"):
        hybridyn.idm(one_limit, q, v, a)


def test_motors_of_one_unit_share_alike_without_weights() -> None:
    robot, q, v, a = states("five_bar_four_motors")
    close_to(hybridyn.idm(robot, q, v, a), hybridyn.idm(robot, q, v, a, weights=np.ones(4)), SOLVED)


@pytest.mark.parametrize(
    "bad", [np.ones(3), -np.ones(4), np.array([1, 1, 1, np.nan]), np.zeros(4), {"nobody": 1.0}]
)
def test_bad_weights_are_refused(bad: Array) -> None:
    robot, q, v, a = states("five_bar_four_motors")
    with pytest.raises(ActuationError, match="weights"):
        hybridyn.idm(robot, q, v, a, weights=bad)


# -------------------------------------------------------------------- fewer motors than freedoms


def test_a_passive_motion_that_needs_an_effort_is_named_and_sized() -> None:
    robot, q, v, a = states("five_bar_one_motor")
    oracle = Oracle(robot.description)
    wrong = np.array(
        [
            oracle.consistent_acceleration(x, x_dot, x_ddot + 1.0)
            for x, x_dot, x_ddot in zip(q, v, a, strict=True)
        ]
    )
    wrong[0] = a[0]
    wrong[2] = a[2]
    hybridyn.idm(robot, q, v, a)
    with pytest.raises(
        ActuationError, match=r"1 motors for 2 freedoms.*N m that the motion of.*passive=\"solved\""
    ) as e:
        hybridyn.idm(robot, q, v, wrong)
    assert e.value.sample == 1
    assert e.value.size is not None
    assert e.value.size > 0
    assert any(f"'{joint}'" in str(e.value.direction) for joint in robot.joints)
    assert e.value.module == robot.modules[0].name


@pytest.mark.parametrize(
    ("kind", "base"), in_turn(["five_bar_one_motor", "rssr", "star_few", "sps", "serial_all"], BASES, None)
)
def test_solved_passive_motion_needs_only_the_motors(kind: str, base: Base) -> None:
    """Passive accelerations are ignored: wrong ones give the same efforts, those of the oracle."""
    description = random_mechanism(6, kind=kind)
    wrenches = random_wrenches(description, 6)
    robot, oracle = build_robot(description, base=base), Oracle(description, base)
    q, v, a = random_states(description, base, 6, 2, wrenches=wrenches)
    rubbish = a + np.random.default_rng(0).normal(size=a.shape)
    kept = [robot.v_slices[robot.joints.index(m)].start for m in robot.motors]
    kept += list(range(6)) if base == "moving" else []
    rubbish[:, kept] = a[:, kept]
    tau = hybridyn.idm(robot, q, v, rubbish, wrenches=wrenches, passive="solved")
    expected = [oracle.idm(*s, wrenches, passive="solved") for s in zip(q, v, rubbish, strict=True)]
    close_to(
        tau, np.array(expected), 100 * SOLVED
    )  # solving for the passive motion adds the inertia's condition


def test_solved_and_given_agree_where_every_motion_is_driven() -> None:
    robot, q, v, a = states("stack")
    close_to(hybridyn.idm(robot, q, v, a, passive="solved"), hybridyn.idm(robot, q, v, a), SOLVED)


def test_a_robot_without_motors_that_rests_on_nothing_is_refused() -> None:
    robot, q, v, a = states("four_bar")
    passive = build_robot(replace(robot.description, motors=()))
    with pytest.raises(ActuationError, match=r"0 motors for 1 freedoms"):
        hybridyn.idm(passive, q, v, a)


def test_a_missing_force_is_in_newtons_and_a_missing_moment_in_newton_metres() -> None:
    """A body of 3 kg at rest on a floating base, its limbs 4 m apart; only the numbers of the body decide."""
    body = Link("body", 3.0, np.zeros(3), np.diag([1.0, 2.0, 5.0]))
    foot = replace(body, name="foot", mass=0.0, inertia=np.zeros((3, 3)))
    far = np.eye(4)
    far[0, 3] = 4.0
    reach = Joint("reach", "revolute", "body", "foot", far, np.array([1.0, 0, 0]))
    robot = build_robot(Description("body", (body, foot), (reach,), (), (), (), ""), base="floating")
    rest = np.zeros(robot.nv)
    with pytest.raises(ActuationError, match=r"the 29.4 N that the motion of .*\(z\) needs") as e:
        hybridyn.idm(robot, robot.home, rest, rest)
    assert e.value.size == pytest.approx(3.0 * 9.81)
    turning = rest.copy()
    turning[5] = 30.0
    moment = r"the 150 N m that the motion of .*\(rz\) needs"
    with pytest.raises(ActuationError, match=moment):
        hybridyn.idm(robot, robot.home, rest, turning, effects=["inertia"])


# -------------------------------------------------------------------- singular postures


def flat_five_bar() -> tuple[HybridRobot, Array]:
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


def _angle(robot: HybridRobot, joint: str, angle: float) -> tuple[float, ...]:
    return (
        (angle,) if robot.kinds[robot.joints.index(joint)] == "revolute" else (np.cos(angle), np.sin(angle))
    )


def test_a_parallel_singularity_raises_and_names_module_and_motor() -> None:
    robot, q = flat_five_bar()
    assert list(robot.joints) == ["left", "left_elbow", "right", "right_elbow"]
    zero = np.zeros(4)
    with pytest.raises(SingularityError, match=r"motors lose a direction at sample 0.*least-norm") as e:
        hybridyn.idm(robot, q, zero, zero)
    assert e.value.what == "motors"
    assert e.value.sample == 0
    assert e.value.condition is not None
    assert e.value.condition > 1e10
    assert e.value.module


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
    with pytest.raises(SingularityError) as e:
        hybridyn.idm(robot, np.stack([good, q]), *np.zeros((2, 2, 4)))
    assert e.value.sample == 1


def tilting_five_bar(*motors: str) -> HybridRobot:
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


def test_a_motor_that_the_loops_lock_drives_nothing() -> None:
    """Two motors for two freedoms, and the loops lock one: least-norm leaves nothing out that is regular."""
    robot = tilting_five_bar("left", "tilt")
    at_rest = (robot.home, np.zeros(robot.nv), np.zeros(robot.nv))
    words = r"2 motors \(the closures lock 'tilt'\) for 2 freedoms; no motor can produce"
    for answer in ("raise", "least-norm"):
        with pytest.raises(ActuationError, match=words):
            hybridyn.idm(robot, *at_rest, on_singular=answer)


@pytest.mark.slow
def test_a_compiled_model_refuses_motors_that_the_loops_lock() -> None:
    robot = tilting_five_bar("left", "tilt")
    with pytest.raises(ActuationError, match=r"the closures lock 'tilt'"):
        hybridyn.compile(robot).idm(robot.home, np.zeros(robot.nv), np.zeros(robot.nv))


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
    with pytest.raises(ActuationError, match="2 motors for 2 freedoms; no motor can produce"):
        hybridyn.idm(robot, robot.home, rest, rest, on_singular="least-norm")


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


# -------------------------------------------------------------------- batches


@pytest.mark.parametrize("kind", ["gough_gimbals", "stack", "five_bar_four_motors", "on_leg"])
def test_one_sample_is_a_batch_of_one(kind: str) -> None:
    robot, q, v, a = states(kind, count=5)
    weights = weights_of(robot)
    tau = hybridyn.idm(robot, q, v, a, weights=weights)
    for t in range(5):
        one = hybridyn.idm(robot, q[t], v[t], a[t], weights=weights)
        assert one.shape == (len(robot.motors),)
        close_to(one, tau[t], ALONE)
        close_to(
            hybridyn.idm(robot, q[t : t + 1], v[t : t + 1], a[t : t + 1], weights=weights), one[None], ALONE
        )


def test_a_sample_does_not_feel_its_batch() -> None:
    """Fast, slow, heavy and light samples side by side, in any order."""
    robot, q, v, a = states("stack", count=6)
    scale = np.array([1.0, 1e-6, 1e3, 1.0, 0.0, 1.0])[:, None]
    oracle = Oracle(robot.description)
    v = v * scale
    a = np.array([oracle.consistent_acceleration(*s) for s in zip(q, v, a, strict=True)])
    tau = hybridyn.idm(robot, q, v, a)
    order = np.array([5, 2, 0, 4, 3, 1, 2, 2])
    other = hybridyn.idm(robot, q[order], v[order], a[order])
    for t, source in enumerate(order):
        close_to(other[t], tau[source], ALONE)


def test_no_samples_give_no_efforts() -> None:
    robot, q, v, a = states("stack", count=1)
    assert hybridyn.idm(robot, q[:0], v[:0], a[:0]).shape == (0, len(robot.motors))


def test_inputs_are_left_alone() -> None:
    robot, q, v, a = states("stack")
    wrenches = random_wrenches(robot.description, 0)
    before = [x.copy() for x in (q, v, a, *wrenches.values())]
    hybridyn.idm(robot, q, v, a, wrenches=wrenches)
    assert all(np.array_equal(x, y) for x, y in zip(before, (q, v, a, *wrenches.values()), strict=True))


# -------------------------------------------------------------------- wrenches


@pytest.mark.parametrize("kind", ["stack", "gough_gimbals"])
def test_wrenches_act_on_links_as_the_oracles(kind: str) -> None:
    """One at a time on every link, fixed, massless and inside wrists alike."""
    description = random_mechanism(3, kind=kind)
    robot, oracle = build_robot(description, base="moving"), Oracle(description, "moving")
    q, v, a = (x[0] for x in random_states(description, "moving", 3, 1))
    rng = np.random.default_rng(0)
    for link in robot.bodies.place:
        wrenches = {link: rng.normal(size=6)}
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


def test_wrong_shapes_and_numbers_are_refused_by_name() -> None:
    robot, q, v, a = states("four_bar")
    with pytest.raises(TrajectoryError, match=r"v has shape \(3, 2\); wanted \(3,\) or \(T, 3\)"):
        hybridyn.idm(robot, q, v[:, :2], a)
    with pytest.raises(TrajectoryError, match=r"q has shape"):
        hybridyn.idm(robot, q[None], v, a)
    with pytest.raises(TrajectoryError, match=r"q, v, a have 3, 2, 3 samples"):
        hybridyn.idm(robot, q, v[:2], a)
    for i, name in enumerate(("q", "v", "a")):
        for bad in (np.nan, np.inf):
            arrays = [q.copy(), v.copy(), a.copy()]
            arrays[i][2, 0] = bad
            with pytest.raises(TrajectoryError, match=rf"^{name} is not finite at sample 2") as e:
                hybridyn.idm(robot, *arrays)
            assert (e.value.row, e.value.sample) == (None, 2)


@pytest.mark.parametrize(
    ("wrench", "text"),
    [
        ({"nobody": np.zeros(6)}, "wrench on unknown link 'nobody'"),
        ({"bass": np.zeros(6)}, r"wrench on unknown link 'bass' \(did you mean 'base'\?\)"),
        ({"base": np.zeros(5)}, r"wrench on 'base' has shape \(5,\); wanted \(6,\) or \(3, 6\)"),
        ({"base": np.zeros((2, 6))}, r"has shape \(2, 6\)"),
        ({"base": np.full(6, np.nan)}, "wrench on 'base' is not finite"),
    ],
)
def test_bad_wrenches_are_refused(wrench: dict[str, Array], text: str) -> None:
    robot, q, v, a = states("four_bar")
    with pytest.raises(TrajectoryError, match=text):
        hybridyn.idm(robot, q, v, a, wrenches=wrench)


@pytest.mark.parametrize("option", [{"on_singular": "ignore"}, {"passive": "guessed"}])
def test_unknown_options_are_refused(option: dict[str, str]) -> None:
    robot, q, v, a = states("four_bar")
    with pytest.raises(TrajectoryError, match=f"{next(iter(option))} must be"):
        hybridyn.idm(robot, q, v, a, **option)  # type: ignore[call-overload]


@pytest.mark.parametrize("kind", ["four_bar", "gough_gimbals", "stack", "gear_two", "delta_bars"])
def test_states_that_do_not_close_are_refused(kind: str) -> None:
    """Positions, rates and accelerations each; a millionth of the size is the limit."""
    robot, q, v, a = states(kind)
    looped = next(m for m in robot.modules if m.closures)
    joint = int(looped.v_index[0])
    step = np.zeros(robot.nv)
    step[joint] = 1e-4
    moved = q.copy()
    moved[1] = pin.integrate(robot.model, q[1], step)
    with pytest.raises(AssemblyError, match=r"positions do not close the loops at sample 1: open by") as e:
        hybridyn.idm(robot, moved, v, a)
    assert (e.value.module, e.value.sample) == (looped.name, 1)
    assert e.value.residual is not None
    assert 1e-6 < e.value.residual < 1e-2
    faster, harder = v.copy(), a.copy()
    faster[2] += 1e4 * step * max(np.abs(v).max(), 1.0)
    harder[0] += 1e4 * step * max(np.abs(a).max(), 1.0)
    with pytest.raises(AssemblyError, match=r"rates do not close the loops at sample 2: opening by"):
        hybridyn.idm(robot, q, faster, a)
    with pytest.raises(AssemblyError, match=r"accelerations do not close the loops at sample 0"):
        hybridyn.idm(robot, q, v, harder)


def test_rates_inside_a_cut_wrist_are_checked_too() -> None:
    """A gimbal's own joints are recovered, not integrated: wrong rates there must not pass in silence."""
    robot, q, v, a = states("gough_gimbals", seed=1)
    module = robot.modules[0]
    inside = next(w for w in module.mechanism.spec.wrists if len(w.joints) == 3 and not w.carries).joints
    column = int(module.v_index[module.mechanism.spanning.v_slices[inside[1]].start])
    wrong = v.copy()
    wrong[:, column] += 1.0
    with pytest.raises(AssemblyError, match="rates"):
        hybridyn.idm(robot, q, wrong, a)


def test_motors_given_as_states_come_back() -> None:
    robot, q, v, a = states("stack")
    q2, v2, a2 = hybridyn.assemble(robot, motors=of_joints(robot, q, v, a), guess=q[0])
    close_to(hybridyn.idm(robot, q2, v2, a2), hybridyn.idm(robot, q, v, a), 1e-9)
