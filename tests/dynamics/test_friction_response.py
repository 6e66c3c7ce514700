"""What wrenches of joints feel of friction in the direct model, and the bound of its feedback."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.dynamics import direct, direct_recursion, friction_response, inverse, load_friction
from hybridyn.dynamics.backward import reactions_of
from hybridyn.dynamics.forward import forward
from hybridyn.dynamics.friction_bound import feedback
from hybridyn.dynamics.friction_response import Response, answer, answering
from hybridyn.dynamics.load_friction import answers_one_by_one, settle
from hybridyn.dynamics.loads import all_loads
from hybridyn.effects.choice import choose
from hybridyn.effects.load_friction import LoadFriction, OnLoads
from hybridyn.errors import ActuationError
from hybridyn.spatial import Array
from tests.oracle import Base
from tests.oracle.test_friction import drawn, effect
from tests.support.comparing import close_to
from tests.support.samples import slow

SOLVED = 1e-11  # differences of reactions under unit friction, of which some are small
CASES = [
    ("legged", "floating"), slow("branched", "fixed"), slow("stack", "moving"), slow("on_leg", "floating"),
    slow("gough_gimbals", "floating"), slow("gear_across", "fixed"),
]  # fmt: skip

Case = tuple[hybridyn.HybridRobot, LoadFriction, tuple[Array, Array, Array]]


def rubbing(kind: str, base: Base) -> Case:
    """Build a robot with friction in every joint, and draw two states."""
    _, robot, (q, v, _), tau, law = drawn(kind, 4, base, 2)
    return robot, effect(law), (q, v, tau)


def written_out(case: Case) -> tuple[OnLoads, list[Response], Array]:
    """Return the law, how modules answer, and the wrenches that unit frictions cause by as many models."""
    robot, law, (q, v, tau) = case
    on = choose(robot, ["default", law])
    assert on.loaded is not None
    loads, D = all_loads(robot, on, q, v, None, None), on.loaded.directions(v)
    states = forward(robot, q, v, None, on.gravity, classical=True, base=np.zeros_like(v))
    modules = answering(robot, on.loaded, D, states, q, v, np.zeros_like(v), tau, loads)[1]

    def wrenches(friction: Array) -> Array:
        under, a = replace(loads, joints=friction), np.zeros_like(v)
        direct.solve(robot, q, v, a, tau, under)
        found = reactions_of(robot, q, v, a, tau, under)
        return np.stack([found.joints[name] for name in on.loaded.joints], axis=1)

    start = wrenches(np.zeros_like(v))
    units = [wrenches(D[:, :, j]) - start for j in range(len(on.loaded.joints))]
    return on.loaded, modules, np.stack(units, axis=3)


@pytest.mark.parametrize(("kind", "base"), CASES)
def test_two_sweeps_answer_like_as_many_models_as_joints(kind: str, base: Base) -> None:
    """The bound holds what all answers together can do, and not much more."""
    law, modules, B = written_out(rubbing(kind, base))
    unit = np.tile(np.eye(len(law.joints)), (len(B), 1, 1))
    close_to(answer(modules, unit), B, SOLVED)
    bound, weight = feedback(law, modules, 1.0)
    every = np.arange(len(law.joints))
    norm = np.linalg.norm(law.lipschitz(every, B, weight) * weight[:, None], 2, axis=(1, 2))
    assert (norm <= bound).all()
    assert (bound <= 15 * norm).all()


def test_the_contraction_settles_where_newton_s_method_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes the direct model twice, whatever the number of joints."""
    robot, law, (q, v, tau) = rubbing("legged", "floating")
    effects, calls = ["default", law], []
    count = direct_recursion.accelerate
    for file in (direct, friction_response):
        monkeypatch.setattr(file, "accelerate", lambda *given: (calls.append(1), count(*given)))
    contracted = hybridyn.ddm(robot, q, v, tau, effects=effects)
    assert len(calls) == 2
    monkeypatch.setattr(load_friction, "SURE", 0.0)
    close_to(contracted, hybridyn.ddm(robot, q, v, tau, effects=effects), SOLVED)


@pytest.mark.parametrize(
    ("kind", "base"), [("legged", "fixed"), slow("stack", "moving"), slow("branched", "floating")]
)
def test_the_inverse_model_runs_twice_whatever_the_number_of_joints(
    kind: str, base: Base, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What joints answer to friction is that of a model call for each of them."""
    robot, law, (q, v, tau) = rubbing(kind, base)
    effects, calls, count = ["default", law], [], inverse.backward
    a = hybridyn.ddm(robot, q, v, tau, effects=effects)
    monkeypatch.setattr(inverse, "backward", lambda *given: (calls.append(1), count(*given)))
    found = hybridyn.idm(robot, q, v, a, effects=effects)
    assert len(calls) == 2

    def one_by_one(law: OnLoads, v: Array, under: Any, answers: object) -> Array:
        return settle(law, v, under, lambda D: answers_one_by_one(law, D, under))

    monkeypatch.setattr(load_friction, "settle", one_by_one)
    close_to(found, hybridyn.idm(robot, q, v, a, effects=effects), SOLVED)
    assert len(calls) == 5 + len(law.joints)


def test_where_the_bound_proves_nothing_all_answers_are_judged() -> None:
    """Just below the ratio at which joints jam there is a solution, just above there may be none."""
    robot, law, (q, v, tau) = rubbing("legged", "fixed")

    def times(factor: float) -> list[object]:
        words = {w: {j: factor * x for j, x in getattr(law, w).items()} for w in ("radial", "axial", "tilt")}
        return ["default", LoadFriction(**words)]

    with pytest.raises(ActuationError, match="may jam") as error:
        hybridyn.ddm(robot, q, v, tau, effects=times(1e3))
    assert error.value.size is not None
    limit = 1e3 / error.value.size
    hybridyn.ddm(robot, q, v, tau, effects=times(0.99 * limit))
    with pytest.raises(ActuationError, match=r"by 1\.01 times itself"):
        hybridyn.ddm(robot, q, v, tau, effects=times(1.01 * limit))
