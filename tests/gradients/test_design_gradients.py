"""Gradients over parameters, through closed loops, against differences of the general path."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.programs.designs import changed
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.effects import LoadFriction
from hybridyn.errors import (
    ActuationError,
    AssemblyError,
    HybridynError,
    ModelError,
    SingularityError,
    TrajectoryError,
)
from hybridyn.structure.building import build_robot
from tests.gradients.by_differences import agrees, near_home, numbers_of
from tests.robots.as_written import leg
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.support.comparing import close_to
from tests.support.samples import slow

#: Largest cost of all gradients of one number, over closing the loops and the inverse model once.
TIMES_MODEL = 6.0
SHIPPED = ("gough_stewart", "delta", "lx4", "rps3", "scara_delta", "snake", "stewart_ur5", "tanev")
NAMES = ["upper_length", "lower_length", "spacing", "mass:m1_tool"]
#: A length, of which a file has to be read again and again, and a number of a body.
TWO = NAMES[2:]


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
    agrees(robot, TWO, state, keep=["m1_tool/pose/x", "m1_tool/pose/z"])


@pytest.fixture(scope="module")
def of_five_bar() -> hybridyn.DesignGradients:
    return hybridyn.DesignGradients(hybridyn.load("five_bar"), TWO)


def test_the_mass_matrix_follows_parameters(of_five_bar: hybridyn.DesignGradients) -> None:
    gradients, robot = of_five_bar, of_five_bar.robot
    q = hybridyn.assemble(robot, motors=[0.1, 0.2])[0]
    found = gradients.mass_matrix(q)
    close_to(found.value, hybridyn.mass_matrix(robot, q), 1e-12)
    for k, name in enumerate(TWO):
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
    assert gradients.idm(q[2], v[2], a[2]).over.shape == (2, 2)


def test_the_cost_does_not_depend_on_the_number_of_parameters() -> None:
    """Operations of CasADi's graphs, and of reflections of the rows, over closing once and the model."""
    robot = hybridyn.load("five_bar")
    heavy = [link.name for link in robot.description.links if link.mass > 0]
    whole = [f"{kind}:{name}" for kind in ("mass", "centre", "inertia") for name in heavy]
    names = [*whole, *(f"placement:{joint}" for joint in robot.joints)]
    gradients = hybridyn.DesignGradients(robot, names)
    graphs = programs(robot, models=("idm", "close"), parameters=gradients.parameters.slots).values()
    assert gradients.operations <= TIMES_MODEL * sum(function_of(x).n_instructions() for x in graphs)


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
    gradients = hybridyn.DesignGradients(robot, ["position:m1_left_elbow"])
    found = gradients.idm(q, v, a)
    assert np.isnan(found.over[:, 1]).all()
    assert np.isfinite(found.over[:, [0, 2]]).all()
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
