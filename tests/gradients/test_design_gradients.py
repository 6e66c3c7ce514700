"""Gradients over parameters, through closed loops, against differences of the general path."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.programs.designs import changed
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.effects import GearEfficiency, LoadFriction
from hybridyn.errors import (
    ActuationError,
    AssemblyError,
    HybridynError,
    ModelError,
    SingularityError,
    TrajectoryError,
)
from hybridyn.gradients.gradient import MeasureBars
from hybridyn.structure.building import build_robot
from tests.gradients.by_differences import AGREE, agrees, design, differences, numbers_of
from tests.robots.as_written import leg
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.robots.posing import position
from tests.support.comparing import close_to
from tests.support.samples import slow

#: Largest cost of all gradients of one number, over closing the loops and the inverse model once.
TIMES_MODEL = 6.0
SHIPPED = ("gough_stewart", "delta", "lx4", "rps3", "scara_delta", "snake", "stewart_ur5", "tanev")
NAMES = ["upper_length", "lower_length", "spacing", "mass:m1_tool"]


def near_home(robot: hybridyn.HybridRobot, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a motion near home; accelerations of free bases are those of efforts."""
    rng = np.random.default_rng(seed)
    motors: dict[str, Any] = {}
    for name in robot.motors:
        step = 0.005 if robot.kinds[robot.joint_index[name]].slides else 0.05
        x = float(position(robot, name, robot.home)) + step * rng.standard_normal()
        motors[name] = (x, 0.3 * rng.standard_normal(), rng.standard_normal())
    base: Mapping[str, Any] = {}
    if robot.base == "floating":
        pose = np.array([0, 0, 1, 0, 0, np.sin(0.1), np.cos(0.1)])
        base = {robot.description.root: (pose, np.full(6, 0.1), np.zeros(6))}
    q, v, a = hybridyn.assemble(robot, motors=motors, platforms=base)
    if robot.base == "floating":
        a = hybridyn.ddm(robot, q, v, rng.standard_normal(len(motors)))
    return q, v, a


@pytest.mark.parametrize(
    ("name", "base"),
    [
        ("five_bar", "fixed"), ("five_bar", "floating"),
        *(slow(name, base) for name in SHIPPED for base in ("fixed", "floating")),
    ],
)  # fmt: skip
def test_gradients_are_those_of_robots_built_for_their_designs(name: str, base: Any) -> None:
    robot = hybridyn.load(name, base=base)
    names = NAMES if name == "five_bar" else numbers_of(robot.description, 1)
    agrees(robot, names, near_home(robot))


@pytest.mark.slow
def test_a_leg_with_a_parallel_ankle_on_a_floating_base(tmp_path: Path) -> None:
    heavy = """<link name="pelvis"><inertial><mass value="8"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
    assert '<link name="pelvis"/>' in leg()
    (tmp_path / "leg.urdf").write_text(leg().replace('<link name="pelvis"/>', heavy))
    robot = hybridyn.load(tmp_path / "leg.urdf", base="floating")
    agrees(robot, numbers_of(robot.description, 2), near_home(robot))


#: Recipes whose models have no gradient, and what says so: rods that turn and have inertia about their line,
#: loops whose last freedom nothing keeps, motors beyond the compiled model, joints that no motion determines.
WITHOUT = {
    "sps": "motions", "rssr": "motions", "star_few": "motions", "five_bar_one_motor": "motions",
    "gough_eight_motors": "share 6 freedoms. Give weights",
}  # fmt: skip
#: Motions that `assemble` cannot be asked for by joints of one freedom.
NOT_ASKED = ("serial_all", "sps_thin")


def of_random(kind: str, seed: int, base: Any) -> None:
    """Compare the gradients of a random mechanism, or that it says why it has none."""
    description = random_mechanism(seed, kind=kind, base=base)
    robot = build_robot(description, base=base)
    q, v, a = (x[0] for x in random_states(description, base, seed, count=1))
    if robot.base == "floating":
        a = hybridyn.ddm(robot, q, v, np.ones(len(robot.motors)))
    compare = partial(agrees, robot, numbers_of(description, seed), (q, v, a), seed)
    if kind in WITHOUT:
        with pytest.raises((ActuationError, SingularityError), match=WITHOUT[kind]):
            compare()
    else:
        compare()


@pytest.mark.parametrize(
    ("kind", "seed"), [("loop_prismatic", 4), ("four_bar", 16), ("gear_rack", 45), ("four_bar_two_motors", 0)]
)
def test_gradients_of_random_mechanisms(kind: str, seed: int) -> None:
    of_random(kind, seed, "fixed")


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in NOT_ASKED])
def test_gradients_of_four_random_mechanisms_of_each_recipe(kind: str) -> None:
    for seed in range(4):
        of_random(kind, seed, "fixed")


@pytest.mark.parametrize("kind", [slow(kind) for kind in ("loop_universal", "gough", "delta_rods", "legged")])
def test_gradients_of_random_mechanisms_on_floating_bases(kind: str) -> None:
    of_random(kind, 4, "floating")


@pytest.mark.slow
def test_near_singular_postures_the_error_grows_with_the_condition_alone() -> None:
    """The five-bar's outer links close to one line."""
    robot = hybridyn.load("five_bar")
    for angle in (0.6, 0.9, 0.99):
        q, v, a = hybridyn.assemble(robot, motors=([angle, -angle], [0.1, 0.0], [0.0, 0.1]))
        agrees(robot, NAMES, (q, v, a))


def test_poses_may_stay_instead_of_motors() -> None:
    robot = hybridyn.load("five_bar")
    state = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 2.0]))
    agrees(robot, NAMES, state, keep=["m1_tool/pose/x", "m1_tool/pose/z"])


@pytest.fixture(scope="module")
def of_five_bar() -> hybridyn.DesignGradients:
    return hybridyn.DesignGradients(hybridyn.load("five_bar"), NAMES)


def test_the_mass_matrix_follows_parameters(of_five_bar: hybridyn.DesignGradients) -> None:
    gradients, robot = of_five_bar, of_five_bar.robot
    q = hybridyn.assemble(robot, motors=[0.1, 0.2])[0]
    found = gradients.mass_matrix(q)
    close_to(found.value, hybridyn.mass_matrix(robot, q), 1e-12)
    for k, name in enumerate(NAMES):
        p, h = gradients.parameters.nominal[k], 1e-4
        one, other = (
            hybridyn.mass_matrix(new, hybridyn.assemble(new, motors=[0.1, 0.2])[0])
            for new in (robot.with_parameters({name: p + sign * h}) for sign in (1, -1))
        )
        close_to(found.over[..., k], (one - other) / (2 * h), 1e-6)  # the quotient's own error


def test_weights_are_one_sweep_of_many_samples(of_five_bar: hybridyn.DesignGradients) -> None:
    gradients, robot = of_five_bar, of_five_bar.robot
    q, v, a = hybridyn.assemble(
        robot, motors={"m1_left_drive": np.linspace(0, 0.3, 5), "m1_right_drive": 0.2}
    )
    weights = np.arange(10.0).reshape(5, 2)
    rows = gradients.idm(q, v, a)
    summed = gradients.idm(q, v, a, weights=weights)
    close_to(summed.over, np.einsum("ti,tik->tk", weights, rows.over), 1e-12)
    assert gradients.idm(q[2], v[2], a[2]).over.shape == (2, 4)


def test_the_cost_does_not_depend_on_the_number_of_parameters() -> None:
    """Operations of CasADi's graphs, and of reflections of the rows, over closing once and the model."""
    robot = hybridyn.load("five_bar")
    heavy = [link.name for link in robot.description.links if link.mass > 0]
    whole = [f"{kind}:{name}" for kind in ("mass", "centre", "inertia") for name in heavy]
    for names in (NAMES[3:], [*whole, *(f"placement:{joint}" for joint in robot.joints)]):
        gradients = hybridyn.DesignGradients(robot, names)
        graphs = programs(robot, models=("idm", "close"), parameters=gradients.parameters.slots).values()
        model = sum(function_of(program).n_instructions() for program in graphs)
        assert gradients.operations <= TIMES_MODEL * model


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gough_stewart", "delta", "lx4"])
def test_the_cost_of_many_parameters(name: str) -> None:
    robot = hybridyn.load(name)
    names = [f"mass:{link.name}" for link in robot.description.links if link.mass > 0]
    names += [f"placement:{joint}" for joint in robot.joints]
    gradients = hybridyn.DesignGradients(robot, names)
    graphs = programs(robot, models=("idm", "close"), parameters=gradients.parameters.slots).values()
    assert gradients.operations <= TIMES_MODEL * sum(function_of(x).n_instructions() for x in graphs)


def test_numbers_that_open_a_loop_have_no_derivative() -> None:
    robot = hybridyn.load("five_bar")
    q, v, a = hybridyn.assemble(robot, motors=[0.1, 0.2])
    found = hybridyn.DesignGradients(robot, ["position:m1_left_elbow"]).idm(q, v, a)
    assert np.isnan(found.over[:, 1]).all()
    assert np.isfinite(found.over[:, [0, 2]]).all()
    gradients = hybridyn.DesignGradients(robot, ["position:m1_left_elbow"])
    slots = gradients.parameters.slot_values(gradients.parameters.nominal[None] + [[0, 0.01, 0]])[0]
    with pytest.raises(HybridynError):
        changed(robot, gradients.parameters, slots)


BAD: list[tuple[dict[str, Any], str]] = [
    ({"parameters": []}, "need parameters"),
    ({"parameters": "mass:m1_tool"}, "a list of names"),
    ({"parameters": ["mass:m1_tol"]}, "did you mean 'm1_tool'"),
    ({"parameters": ["name"]}, "no parameter 'name'"),
    ({"keep": ["m1_left_driv"]}, "no joint 'm1_left_driv'"),
    ({"keep": ["m1_tool/pose/w"]}, "no coordinate of 'm1_tool' 'w'"),
    ({"keep": ["m1_tol/pose/x"]}, "no link 'm1_tol'"),
    ({"effects": ["inertia", "gravity", "limits"]}, "'limits' has no derivative"),
]


@pytest.mark.parametrize(("wrong", "says"), BAD)
def test_what_cannot_be_asked_is_refused(wrong: dict[str, Any], says: str) -> None:
    robot = hybridyn.load("five_bar")
    with pytest.raises(ModelError, match=says) as caught:
        hybridyn.DesignGradients(robot, **({"parameters": ["mass:m1_tool"]} | wrong))
    assert "\n" not in str(caught.value)


def test_wrong_samples_are_refused() -> None:
    robot = hybridyn.load("five_bar")
    q, v, a = hybridyn.assemble(robot, motors=[0.1, 0.2])
    gradients = hybridyn.DesignGradients(robot, ["mass:m1_tool"])
    with pytest.raises(AssemblyError, match=r"open by .* at sample 0"):
        gradients.idm(q + 0.1, v, a)
    with pytest.raises(ModelError, match="wrench on 'm1_tool': name the link"):
        gradients.idm(q, v, a, wrenches={"m1_tool": np.ones(6)})
    with pytest.raises(TrajectoryError, match="parameters has shape"):
        gradients.idm(q, v, a, parameters=[1.0, 2.0])
    with pytest.raises(ModelError, match="cannot be -1"):
        gradients.idm(q, v, a, parameters=[-1.0])
    with pytest.raises(SingularityError, match="leaves 1 motions"):
        hybridyn.DesignGradients(robot, ["mass:m1_tool"], keep=["m1_left_drive"]).idm(q, v, a)


def test_friction_that_does_not_settle_is_named() -> None:
    robot = hybridyn.load("five_bar")
    state = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.5], [0.0, 0.0]))
    rubbing = ["default", LoadFriction(radial={"m1_left_elbow": 0.3, "m1_left_drive": 0.3})]
    gradients = hybridyn.DesignGradients(robot, ["mass:m1_tool"], effects=rubbing)
    with pytest.raises(SingularityError, match="grows with load does not settle at sample 0"):
        gradients.idm(*state)


def test_accelerations_of_free_motions_follow_those_of_motors() -> None:
    """Motors keep their accelerations; the base moves as their efforts demand."""
    robot = hybridyn.load("five_bar", base="floating")
    q, v, a = near_home(robot)
    gradients, nv = hybridyn.DesignGradients(robot, NAMES), robot.nv
    p, still = gradients.parameters.nominal, np.zeros((1, nv))
    each = [MeasureBars(still, still, one[None], np.zeros((1, 2)), {}) for one in np.eye(nv)]
    found = gradients.of_measures((q[None], v[None], a[None]), p, np.eye(len(p)), each)
    along = p * [0.5, -0.3, 0.2, 0.4]
    wanted, errors = differences(robot, gradients.parameters, along, q, design(robot, q, v, a))
    size = AGREE * np.abs(wanted.found).max()
    assert (np.abs(found.over @ along - wanted.found) <= size + errors.found).all()


def test_solved_accelerations_are_those_of_no_effort() -> None:
    """Those of a floating base, and of joints that follow the motors, are not read."""
    robot = hybridyn.load("five_bar", base="floating")
    q, v, a = near_home(robot)
    gradients, other = hybridyn.DesignGradients(robot, NAMES), np.full(robot.nv, 7.0)
    other[robot.motor_v] = a[robot.motor_v]
    found, known = gradients.idm(q, v, other, passive="solved"), gradients.idm(q, v, a)
    close_to(found.value, hybridyn.idm(robot, q, v, other, passive="solved"), AGREE)
    close_to(found.over, known.over, AGREE)
    with pytest.raises(TrajectoryError, match="passive must be 'given' or 'solved', not 'free'"):
        gradients.idm(q, v, a, passive="free")


@pytest.mark.parametrize(
    ("seed", "base"), [(1, "fixed"), slow(0, "fixed"), slow(2, "fixed"), slow(3, "fixed"), (1, "moving")]
)
def test_joints_without_motors_may_stay_beside_motors(seed: int, base: Any) -> None:
    """Also where the base has an acceleration of its own."""
    description = random_mechanism(seed, kind="five_bar_one_motor", base=base)
    robot = build_robot(description, base=base)
    q, v, a = (x[0] for x in random_states(description, base, seed, count=1))
    of_base = {"base_acceleration": a[:6]} if base == "moving" else {}
    a = hybridyn.ddm(robot, q, v, np.ones(len(robot.motors)), **of_base)
    free = [x for x in robot.joints if x not in (*robot.motors, "root_joint")]
    names = [*robot.motors, free[0]]
    agrees(robot, numbers_of(description, seed), (q, v, a), seed, keep=names)


def test_efforts_beside_free_motions_hold_the_motors_accelerations_behind_gears() -> None:
    """Efforts follow parameters so that accelerations of motors stay."""
    robot = hybridyn.load("five_bar", base="floating")
    gears = ["default", GearEfficiency(dict.fromkeys(robot.motors, 0.7), width=0.05)]
    q, v, _ = hybridyn.assemble(robot, motors=([0.1, 0.2], [0.5, -0.4], [0.0, 0.0]))
    tau = np.array([1.0, -0.6])
    gradients = hybridyn.DesignGradients(robot, ["mass:m1_tool"], effects=gears)
    a, over = gradients.ddm(q, v, tau)[:2]
    sides = [
        [hybridyn.ddm(robot, q, v, tau + sign * 1e-6 * e, effects=gears)[robot.motor_v] for e in np.eye(2)]
        for sign in (1, -1)
    ]
    by_tau = (np.array(sides[0]) - sides[1]).T / 2e-6
    moved = by_tau @ gradients.idm(q, v, a).over[:, 0]
    close_to(moved, -over[robot.motor_v, 0], 1e-7)  # rounding over the step
    with pytest.raises(ModelError, match="mass matrix does not take the effect 'gear_efficiency'"):
        gradients.mass_matrix(q)
    elbows = hybridyn.DesignGradients(robot, ["mass:m1_tool"], keep=["m1_left_elbow", "m1_right_drive"])
    with pytest.raises(ModelError, match="name all motors in 'keep'"):
        elbows.idm(q, v, a)
    with pytest.raises(ModelError, match="where every motion has one motor"):
        hybridyn.DesignGradients(robot, ["mass:m1_tool"]).mass_matrix(q)
