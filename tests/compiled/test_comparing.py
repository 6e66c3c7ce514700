"""New code that differs from the general path is refused, whatever it computes."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.code.scalars import Scalar
from hybridyn.compiled.comparing import SAMPLES, compare_at_states
from hybridyn.compiled.equations.states import any_accelerations, moving_states
from hybridyn.compiled.library.building import best_lanes
from hybridyn.compiled.library.cache import Built
from hybridyn.compiled.library.calls import Calls, Library
from hybridyn.compiled.programs.derivatives import evaluation
from hybridyn.compiled.programs.derivatives.evaluation import Derivatives
from hybridyn.compiled.programs.quantities import following
from hybridyn.compiled.programs.sources import library_of
from hybridyn.compiled.programs.whole_robot import Interpreted, programs
from hybridyn.compiled.second import prepared
from hybridyn.compiled.verifying import movable_states, verify
from hybridyn.dynamics.quantities.independent import independent_coordinates
from hybridyn.effects.choice import choose
from hybridyn.identification.compiled_rows import CompiledRows
from hybridyn.identification.parameters import standard_parameters
from hybridyn.linkage.retraction import Retraction
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.robots.locked import with_truss
from tests.robots.mechanisms import random_mechanism
from tests.robots.robot_texts import CLOSED_FOUR_BAR, door, read_text, save
from tests.support.comparing import refused
from tests.support.samples import some

Robot = hybridyn.HybridRobot


def motion_map(robot: Robot) -> None:
    following.artifact_of(robot, independent_coordinates(robot, None), "float64").loaded(Library)


def pushed_models(robot: Robot) -> None:
    on = choose(robot, None)
    scalar, check = Scalar("float64", best_lanes()), partial(following._check, robot, on, "float64")
    library_of(robot, on, scalar, models=following.MODELS, check=check).loaded(Library)


def regressor(robot: Robot) -> None:
    parameters = standard_parameters(robot)
    CompiledRows(robot, parameters, np.arange(len(parameters.names)))


def products(robot: Robot) -> Any:
    return hybridyn.SecondDerivatives(robot, "idm", coordinates="joints")._products


#: What builds code, the robot's base, and a program with the outputs that are compared.
NEW: dict[str, tuple[Callable[[Robot], Any], str, str, list[int]]] = {
    "derivatives": (lambda robot: Derivatives(robot, "ddm"), "fixed", "ddm_jacobian", [0, 1, 2, 3]),
    "motor derivatives": (
        lambda robot: Derivatives(robot, "idm", coordinates="motors"),
        "fixed", "idm_motor_jacobian", [0, 1, 2, 3],
    ),
    "motion map": (motion_map, "fixed", "following", [1, 2]),
    "wrench": (pushed_models, "floating", "idm_pushed", [0]),
    "accelerations under a wrench": (pushed_models, "floating", "ddm_pushed", [0]),
    "products": (products, "fixed", "idm_product", [0, 3, 8]),
    "regressor": (regressor, "fixed", "regressor", [1]),
    "floating regressor": (regressor, "floating", "regressor", [1]),
}  # fmt: skip


@pytest.mark.parametrize("what", some(NEW, ("motion map", "regressor")))
def test_new_code_that_differs_is_refused(
    what: str, empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A part in 1,000 of one output, or one guard that is NaN; a motion map is then trusted nowhere else."""
    build, base, program, outputs = NEW[what]
    robot, right = hybridyn.load("five_bar", base=base), Calls.batch
    for output in [*outputs, None][: 2 if what == "motion map" else None]:

        def bent(self: Calls, *given: Any, output: int | None = output) -> Any:
            found, guard = right(self, *given)
            if self.name == program:
                if output is None:
                    guard[-1] = np.nan
                else:
                    found[output][:] *= 1.001
            return found, guard

        monkeypatch.setattr(Calls, "batch", bent)
        refused(partial(build, robot), hybridyn.CompileError, "differs from the general path by")


def test_derivatives_that_cancel_are_compared_up_to_their_rounding(
    tmp_path: Path, interpreted: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A parallelogram has the same inertia everywhere: rates change no effort, except for rounding."""
    made, wrong = products(hybridyn.load(save(tmp_path, CLOSED_FOUR_BAR))), [1e-12]

    class Bent:
        """A library with other slopes."""

        def batch(self, name: str, *given: Array) -> Any:
            found, guard = made._interpreted.batch(name, *given)
            slopes = found[[name for name, _ in made.program.outputs].index("v_slope")]
            assert np.abs(slopes).max() < 1e-14  # [N m s/rad], of efforts around 1 N m
            slopes[:] += wrong[0]
            return found, guard

    monkeypatch.setattr(prepared, "Library", lambda built: Bent())
    check = partial(made._check, Built(tmp_path, {}))
    refused(check, hybridyn.CompileError, "the compiled 'idm_product' .* differs from the general path by")
    wrong[0] = 1e-16
    check()


def test_states_that_the_general_path_refuses_are_not_computed() -> None:
    robot = hybridyn.load("five_bar")

    def run(q: Array, *_: Array) -> tuple[list[Array], Array]:
        return [q], np.arange(len(q)) % 2.0 * 2.0

    def general(q: Array, *_: Array) -> list[Array]:
        raise hybridyn.SingularityError("there is no answer")

    words = "the compiled 'idm' of the robot 'five_bar' computes a state that the general path refuses"
    refused(lambda: compare_at_states(robot, "'idm'", run, general, 1.0), hybridyn.CompileError, words)


def test_states_of_few_motors_are_ones_that_they_drive() -> None:
    """At least every other one, so that the inverse model is compared, too."""
    robot = hybridyn.load("five_bar", motors=["m1_left_drive"])
    q, v, _, a = (x[::2] for x in movable_states(robot, choose(robot, None), 0))
    assert len(hybridyn.idm(robot, q, v, a)) == SAMPLES / 2


def test_a_robot_in_which_nothing_moves_is_verified() -> None:
    robot = with_truss("alone")
    verify(Interpreted([*programs(robot, None).values()]), robot, choose(robot, None))


def test_derivatives_of_a_robot_without_motors_are_compared(
    tmp_path: Path, interpreted: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    derive = Derivatives(build_robot(replace(read_text(tmp_path, door(2)), motors=())), "ddm")
    monkeypatch.setattr(evaluation, "Library", lambda built: derive._interpreted)
    derive._check(Built(tmp_path, {}))


def test_drawn_accelerations_follow_the_states_smoothly() -> None:
    """Quotients of differences are compared with derivatives; the basis of this one's motions turns."""
    robot, step = build_robot(random_mechanism(1, kind="gough_floating")), 1e-5
    q, v, _ = moving_states(robot, SAMPLES)
    move = Retraction(robot.kinds).move
    way = [np.array(list(map(move, q, h * v))) for h in (0.0, step, 2.0 * step)]
    a = [any_accelerations(robot, x, v, 1) for x in way]
    np.testing.assert_allclose(a[2] - a[1], a[1] - a[0], atol=100.0 * step**2)  # 2 without the projection
