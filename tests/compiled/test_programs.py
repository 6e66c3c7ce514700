"""Written-out models, run by CasADi without a compiler, against the general path."""

from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations import parts
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.programs.kinematics import WIDTH
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.dynamics.link_motion import body_motions
from hybridyn.structure.building import build_robot
from tests import ROOT
from tests.oracle import Base
from tests.robots.mechanisms import random_mechanism
from tests.support.comparing import refused
from tests.support.engines import TRUSTED, written_agrees

AGREE = 1e-10  # the claim: two ways of elimination, each good to some hundred roundings
EXACT = 1e-13  # one chain of products, summed in another order


#: Loops whose closures hold all rotations, slide, or cross an axis; and a platform whose base moves.
FORMS: dict[str, Base] = {
    "loop_fixed": "fixed", "loop_cylindrical": "fixed", "loop_universal": "fixed", "planar_rpr": "floating"
}  # fmt: skip


@pytest.mark.parametrize(("kind", "base"), FORMS.items())
def test_closures_of_each_form(kind: str, base: Base) -> None:
    written_agrees(build_robot(random_mechanism(1, kind=kind), base=base), 2)


@pytest.mark.parametrize(
    "effects",
    [
        "model",
        ["gravity", "inertia", "massless_legs"],
        ["inertia"],
        ["gravity", "inertia", "velocity"],
    ],
)
def test_effects(effects: Any) -> None:
    robot = hybridyn.with_effects(hybridyn.load("gough_stewart"), effects)
    written_agrees(robot, 3, effects, AGREE)


@pytest.mark.parametrize(
    ("name", "base"), [("gough_stewart", "fixed"), ("delta", "moving"), ("scara_delta", "floating")]
)
def test_kinematics(name: str, base: Base) -> None:
    robot = hybridyn.load(name, base=base)
    q, v, a, _ = random_states(robot, 2)
    function = function_of(programs(robot, models=("kinematics",))["kinematics"])
    for t in range(2):
        got = np.array(function(q[t], v[t], a[t])[0]).reshape(-1, WIDTH)
        for body, m in body_motions(robot, q, v, a).items():
            for at, value in ((9, m.p), (12, m.p_dot), (15, m.w), (18, m.p_ddot), (21, m.w_dot)):
                size = max(np.abs(got[:, at : at + 3]).max(), 1.0)
                np.testing.assert_allclose(got[body, at : at + 3], value[t], atol=EXACT * size)
            np.testing.assert_allclose(got[body, :9].reshape(3, 3), m.R[t], atol=EXACT)


def test_effects_that_are_off_leave_no_code_and_base_parameters_make_it_shorter(
    monkeypatch: pytest.MonkeyPatch, written_anew: None
) -> None:
    robot = hybridyn.load("five_bar")
    chosen: tuple[list[str] | None, ...] = (
        None,
        ["gravity", "inertia"],
        ["gravity", "inertia", "massless_legs"],
    )
    sizes = [
        function_of(programs(robot, effects, models=("ddm",))["ddm"]).n_instructions() for effects in chosen
    ]
    monkeypatch.setattr(parts, "regrouped", lambda links, kept: (links, np.zeros(10)))
    whole = function_of(programs(robot, models=("ddm",))["ddm"]).n_instructions()
    assert whole > sizes[0] > sizes[1] > sizes[2]


def test_a_state_that_is_not_closed_is_not_trusted() -> None:
    robot = hybridyn.load("five_bar")
    q, v, _, tau = (x[0] for x in random_states(robot, 1))
    function = function_of(programs(robot, models=("ddm",))["ddm"])
    turn = robot.q_slices[robot.joint_index[robot.motors[0]]].start
    for dq, dv in ((0.0, 0.0), (1e-9 * np.eye(robot.nq)[turn], 0.0), (0.0, 1e-8 * np.eye(robot.nv)[3])):
        assert (float(function(q + dq, v + dv, tau)[1]) <= TRUSTED) == (not np.any(dq + np.sum(dv)))


def test_effects_that_need_time_or_contact_are_refused() -> None:
    robot = hybridyn.load("five_bar")
    wrench = hybridyn.effects.Wrench(robot.bodies.bodies[-1].name, (0.0, 0, 0, 0, 0, 1.0))  # type: ignore[attr-defined]
    for call, words in (
        (lambda: request(robot, ["default", wrench]), "cannot be compiled"),
        (lambda: request(robot, ["gravity"]), "without the effect 'inertia'"),
    ):
        refused(call, hybridyn.ModelError, words)


def test_a_dead_centre_among_the_generic_postures_is_a_map_of_rank_zero() -> None:
    """The slider-crank's home is one: its motor map is 0 there, and 0 / 0 hid how regular the others are."""
    robot = hybridyn.load(ROOT / "benchmarks/robots/slider_crank.urdf")
    with np.errstate(divide="raise", invalid="raise"):
        program = programs(robot, models=("idm",))["idm"]
    crank = {"crank": (0.7, 1.3, -2.0)}
    q, v, a = hybridyn.assemble(robot, motors=crank)
    tau, guard = (np.array(x).ravel() for x in function_of(program)(q, v, a))
    assert guard[0] <= 1.0
    np.testing.assert_allclose(tau, hybridyn.idm(robot, q, v, a), rtol=1e-10)
