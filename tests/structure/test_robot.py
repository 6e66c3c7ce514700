"""HybridRobot: coordinates and model of `pin.buildModelFromXML`, bases, refusals; drawn mechanisms."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import HybridRobot, ModelError
from hybridyn.description.records import Description, Joint, Link
from hybridyn.structure.building import build_robot
from tests.oracle import Base, Oracle
from tests.oracle.test_oracle import SHUFFLED
from tests.robots.mechanisms import KINDS, home_posture, random_mechanism, random_states
from tests.robots.shipped import ROBOTS, shipped
from tests.robots.sketch import CLOSURES, ROW_COUNT
from tests.support.comparing import ROUNDING, close_to, refused
from tests.support.extras import robots_of_others, skip
from tests.support.files import save
from tests.support.samples import in_turn, some

SHOWN = {"home", "joints", "motor_q", "motor_v", "motors", "nq", "nv", "with_parameters"}
BASES: tuple[Base, ...] = ("fixed", "moving", "floating")
SAMPLES = 4
SERIAL = (
    "ur5_robot.urdf",
    "panda.urdf",
    "pr2.urdf",
    "allegro_left_hand.urdf",
    "talos_reduced.urdf",
    "solo12.urdf",
    "kinova.urdf",
    "shuffled",
)
ALL_DRIVEN = ("ur5_robot.urdf", "allegro_left_hand.urdf", "talos_reduced.urdf", "solo12.urdf", "kinova.urdf")


def urdf_file(name: str, folder: Path) -> Path:
    if name == "shuffled":
        return save(folder, SHUFFLED, "shuffled.urdf")
    if not robots_of_others():
        skip("robots")
    return next(path for path in robots_of_others() if path.name == name)


def from_pinocchio(path: Path, base: Base) -> pin.Model:
    return (
        pin.buildModelFromUrdf(str(path))
        if base == "fixed"
        else pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    )


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", SERIAL)
def test_serial_robots_are_pinocchios(name: str, base: Base, tmp_path: Path) -> None:
    """Order, coordinates and names; the robot's own model has the same dynamics, limits and frames."""
    path = urdf_file(name, tmp_path)
    robot, expected = hybridyn.load(path, base=base), from_pinocchio(path, base)
    assert (robot.nq, robot.nv, list(robot.joints)) == (expected.nq, expected.nv, list(expected.names)[1:])
    for i, (at_q, at_v) in enumerate(zip(robot.q_slices, robot.v_slices, strict=True), start=1):
        assert (at_q.start, at_q.stop) == (expected.idx_qs[i], expected.idx_qs[i] + expected.nqs[i])
        assert (at_v.start, at_v.stop) == (expected.idx_vs[i], expected.idx_vs[i] + expected.nvs[i])
    model = robot.model
    assert (model.nq, model.nv, list(model.names)) == (expected.nq, expected.nv, list(expected.names))
    assert model is robot.model
    data, other = model.createData(), expected.createData()
    assert model.check(data)
    rng = np.random.default_rng(1)
    for _ in range(SAMPLES):
        q = pin.integrate(expected, pin.neutral(expected), rng.normal(size=expected.nv))
        v, a = rng.normal(size=(2, expected.nv))
        close_to(pin.rnea(model, data, q, v, a), pin.rnea(expected, other, q, v, a), ROUNDING)
    pin.framesForwardKinematics(model, data, q)
    pin.framesForwardKinematics(expected, other, q)
    for link in robot.bodies.place:
        ours, theirs = (m.getFrameId(link, pin.BODY) for m in (model, expected))
        close_to(data.oMf[ours].homogeneous, other.oMf[theirs].homogeneous, ROUNDING)
    finite = np.isfinite(expected.velocityLimit) & (expected.velocityLimit < 1e300)
    one = np.repeat(expected.nvs[1:] == np.ones(len(robot.joints)), expected.nvs[1:]) & finite
    assert np.array_equal(model.velocityLimit[one], expected.velocityLimit[one])


@pytest.mark.parametrize("base", ["fixed", "moving"])
@pytest.mark.parametrize("name", ALL_DRIVEN)
def test_inverse_model_of_serial_robots_is_rnea(name: str, base: Base, tmp_path: Path) -> None:
    """Every joint is driven here, in Pinocchio's order; on a moving base, its wrench is rnea's too."""
    path = urdf_file(name, tmp_path)
    expected = from_pinocchio(path, base)
    first = hybridyn.load(path, base=base)
    single = [
        j
        for j, k in zip(first.joints, first.kinds, strict=True)
        if k in ("revolute", "continuous", "prismatic")
    ]
    assert not first.description.couplings
    robot = hybridyn.load(path, base=base, motors=single)
    assert list(robot.motors) == single
    assert len(single) == len(robot.joints) - (base == "moving")
    rng = np.random.default_rng(2)
    q = np.array(
        [pin.integrate(expected, pin.neutral(expected), rng.normal(size=robot.nv)) for _ in range(SAMPLES)]
    )
    v, a = rng.normal(size=(2, SAMPLES, robot.nv))
    tau, reactions = hybridyn.idm(robot, q, v, a, reactions=True)
    wanted = np.array([pin.rnea(expected, expected.createData(), *x) for x in zip(q, v, a, strict=True)])
    close_to(tau, wanted[:, robot.nv - len(single) :], ROUNDING)
    if base == "moving":
        close_to(reactions.base, wanted[:, :6], ROUNDING)


@pytest.mark.parametrize(("name", "base"), in_turn(ROBOTS, BASES, None))
def test_shipped_robots_have_one_order_in_all_models(name: str, base: Base) -> None:
    description = shipped(name)
    robot, oracle = build_robot(description, base=base), Oracle(description, base)
    assert list(robot.joints) == oracle.joint_names == list(robot.model.names)[1:]
    assert (robot.nq, robot.nv) == (oracle.nq, oracle.nv) == (robot.model.nq, robot.model.nv)
    close_to(robot.home, home_posture(description, base), ROUNDING)
    close_to(pin.normalize(robot.model, robot.home), robot.home, ROUNDING)
    assert robot.motors == tuple(description.motors)


@pytest.mark.parametrize("kind", some(KINDS))
def test_model_of_the_spanning_tree_is_consistent(kind: str) -> None:
    """Fixed joints in between, any kind of joint, any axis: Pinocchio places links where the oracle does."""
    description = random_mechanism(3, kind=kind)
    robot, oracle = build_robot(description), Oracle(description)
    data = robot.model.createData()
    assert robot.model.check(data)
    assert robot.model.nq == robot.nq
    pin.framesForwardKinematics(robot.model, data, robot.home)
    links = oracle.posture(robot.home).links
    for name in robot.bodies.place:
        M = data.oMf[robot.model.getFrameId(name, pin.BODY)]
        assert np.abs(M.translation - links[name].x).max() < ROUNDING
        assert np.abs(M.rotation - links[name].E).max() < ROUNDING
    total = sum(link.mass for link in description.links)
    on_root = robot.bodies.bodies[0].mass
    assert pin.computeTotalMass(robot.model) == pytest.approx(total - on_root, rel=ROUNDING)


@pytest.mark.parametrize("base", BASES)
def test_bases_differ_by_the_joint_under_the_root_link(base: Base) -> None:
    description = random_mechanism(0, kind="four_bar")
    robot = build_robot(description, base=base)
    free = base != "fixed"
    assert (robot.joints[0] == "root_joint") == free
    assert robot.nv == build_robot(description).nv + 6 * free
    assert robot.mobility == 1 + 6 * (base == "floating")
    assert len(robot.modules) == 1 + (base == "floating")
    if free:
        assert robot.home[:7].tolist() == [0, 0, 0, 0, 0, 0, 1]
        assert robot.model.joints[1].shortname() == "JointModelFreeFlyer"
    if base == "floating":
        root = robot.modules[0]
        assert (root.mobility, root.joints, root.motors) == (6, ("root_joint",), ())
        assert robot.modules[1].parent == 0


def test_gravity_is_the_callers() -> None:
    description = random_mechanism(0, kind="four_bar")
    robot = build_robot(description, gravity=(1.0, -2.0, 3.0))
    assert robot.gravity.tolist() == [1, -2, 3]
    close_to(robot.model.gravity.linear, robot.gravity, ROUNDING)
    zero = np.zeros(robot.nv)
    weight = hybridyn.idm(robot, robot.home, zero, zero)
    close_to(weight, Oracle(description, gravity=(1.0, -2.0, 3.0)).idm(robot.home, zero, zero), ROUNDING * 10)
    assert not hybridyn.idm(build_robot(description, gravity=(0.0, 0.0, 0.0)), robot.home, zero, zero).any()


def test_unknown_base_is_refused() -> None:
    refused(
        lambda: build_robot(random_mechanism(0, kind="four_bar"), base="flying"),
        ModelError,
        r"base must be 'fixed', 'moving' or 'floating', not 'flying'",
    )  # type: ignore[arg-type]


def long_chain(joints: int) -> HybridRobot:
    """Return a comb: one trunk joint, the others side by side on it."""
    Z, M = np.array([0.0, 0.0, 1.0]), np.eye(4)
    links = tuple(Link(f"l{i}", 1.0, np.zeros(3), np.eye(3)) for i in range(joints + 1))
    records = tuple(Joint(f"j{i}", "revolute", f"l{min(i, 1)}", f"l{i + 1}", M, Z) for i in range(joints))
    return build_robot(Description("comb", links, records))


@pytest.mark.slow
def test_pinocchio_model_of_a_huge_robot_is_refused_and_names_the_way_out() -> None:
    robot = long_chain(10_001)
    assert robot.nv == 10_001
    words = r"'comb' has 10001 joints.*refused above 10000.*hybridyn's own functions"
    refused(lambda: robot.model, ModelError, words)


def test_a_robot_of_one_link_is_a_robot() -> None:
    """No joints at all: nothing to drive, but a base that can be carried or float."""
    block = Description("block", (Link("block", 2.0, np.array([0.1, 0, 0]), 0.1 * np.eye(3)),), ())
    robot = build_robot(block)
    nothing = np.zeros(0)
    tau, reactions = hybridyn.idm(robot, nothing, nothing, nothing, reactions=True)
    assert tau.shape == (0,)
    close_to(reactions.base, np.array([0, 0, 19.62, 0, -1.962, 0]), ROUNDING)
    floating = build_robot(block, base="floating")
    falling = np.array([0.0, 0, -9.81, 0, 0, 0])
    tau = hybridyn.idm(floating, floating.home, np.zeros(6), falling)
    assert tau.shape == (0,)


def test_dir_lists_what_a_user_may_touch() -> None:
    robot = build_robot(shipped("five_bar"))
    assert {*dir(robot)} >= SHOWN
    assert all(hasattr(robot, name) and not name.startswith("_") for name in dir(robot))


@pytest.mark.parametrize("kind", some(KINDS))
def test_recipes_are_what_they_say(kind: str) -> None:
    """Joints that share closure rows form the modules; mobility is what the rows leave to each."""
    recipe, description = KINDS[kind], random_mechanism(2, kind=kind)
    oracle = Oracle(description)
    q, _, _ = random_states(description, "fixed", 2, 1)
    K = oracle.rows(q[0])
    groups = [{i} for i in range(oracle.nv)]
    for row in K:
        met = {int(i) for i in np.flatnonzero(np.abs(row) > 1e-9)}
        met |= set().union(*(g for g in groups if g & met))
        groups = [g for g in groups if not g & met] + [met]
    looped = [sorted(g) for g in groups if np.abs(K[:, sorted(g)]).max(initial=0.0) > 1e-9]
    left = [len(g) - np.linalg.matrix_rank(K[:, g], tol=1e-9) for g in looped]
    assert sorted(left) == sorted(recipe.loops)
    assert oracle.nv - sum(map(len, looped)) == recipe.serial
    rank = np.linalg.matrix_rank(oracle.motor_map(oracle.posture(q[0])), tol=1e-9)
    assert (rank < recipe.mobility) == (recipe.motors == "few")
    assert (len(oracle.motors) > rank) == (recipe.motors == "redundant")
    assert (oracle.massless(q[0]).shape[1] > 0) == recipe.massless


def test_draws_are_repeatable_and_differ_by_seed() -> None:
    first, same, other = (random_mechanism.__wrapped__(seed, kind="gough") for seed in (0, 0, 1))
    assert [link.name for link in first.links] == [link.name for link in same.links]
    assert all((a.placement == b.placement).all() for a, b in zip(first.joints, same.joints, strict=True))
    assert [link.name for link in first.links] != [link.name for link in other.links]


def test_every_kind_of_closure_is_drawn() -> None:
    missing = set(CLOSURES)
    for kind in KINDS:
        if missing:
            missing -= {closure.kind for closure in random_mechanism(0, kind=kind).closures}
    assert not missing
    assert all(count > 0 for count in ROW_COUNT.values())
