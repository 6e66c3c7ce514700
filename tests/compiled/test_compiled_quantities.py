"""Closed-loop quantities of compiled models: the general path's numbers, words and fallback."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import moving_states
from hybridyn.compiled.programs.quantities import following
from hybridyn.dynamics.quantities.coordinates import independent_coordinates
from hybridyn.errors import AssemblyError, CompileError, SingularityError, TrajectoryError
from hybridyn.structure.robot import HybridRobot
from tests.comparing import SOLVED, close_to
from tests.dynamics.test_idm import flat_five_bar
from tests.dynamics.test_lost_rank import parallelogram
from tests.locked import hinged_five_bar, named
from tests.oracle import Oracle
from tests.quantities.reduced import columns_of, oracle_bias, oracle_map, oracle_mass
from tests.samples import slow
from tests.shipped import ROBOTS

#: Of the largest entry, in single precision: rounding times the condition of an operational-space inertia.
SINGLE = 1e-3
ELBOWS = ("m1_left_elbow", "m1_right_elbow")


def equal(compiled: hybridyn.CompiledRobot, q: np.ndarray, v: np.ndarray, **options: Any) -> None:
    """Compare every quantity with that of the general path, for the effects of the compiled models."""
    robot, effects = compiled.robot, compiled.effects
    for name in ("mass_matrix", "gravity"):
        expected = getattr(hybridyn, name)(robot, q, effects=effects, **options)
        close_to(getattr(compiled, name)(q, **options), expected, SOLVED)
    for name in ("bias", "coriolis"):
        expected = getattr(hybridyn, name)(robot, q, v, effects=effects, **options)
        close_to(getattr(compiled, name)(q, v, **options), expected, SOLVED)
    if robot.base != "moving":
        expected = hybridyn.coriolis_matrix(robot, q, v, effects=effects, **options)
        close_to(compiled.coriolis_matrix(q, v, **options), expected, SOLVED)
    expected = hybridyn.motion_map(robot, q, v, **options)
    close_to(np.array(compiled.motion_map(q, v, **options)), np.array(expected), SOLVED)
    close_to(compiled.motion_map(q, **options), expected[0], SOLVED)
    link = list(robot.bodies.place)[-1]
    for axes in ("world", "link"):
        expected = hybridyn.link_jacobian(robot, q, link, axes=axes, **options)
        close_to(compiled.link_jacobian(q, link, axes=axes, **options), expected, SOLVED)
        for links in (link, [link, robot.description.root, list(robot.bodies.place)[2]]):
            expected = hybridyn.delassus(robot, q, links, axes=axes, effects=effects)
            close_to(compiled.delassus(q, links, axes=axes), expected, SOLVED)
    energy = hybridyn.energy(robot, q, v, effects=effects)
    close_to(compiled.energy(q, v).kinetic, energy.kinetic, SOLVED)
    close_to(compiled.energy(q, v).potential, energy.potential, SOLVED)


@pytest.fixture(scope="module")
def bar() -> hybridyn.CompiledRobot:
    """Compile the five-bar."""
    return hybridyn.compile(hybridyn.load("five_bar"))


def test_every_quantity_is_the_general_paths(bar: hybridyn.CompiledRobot) -> None:
    before = bar.recomputed
    equal(bar, *moving_states(bar.robot, 4, 1)[:2])
    assert bar.recomputed == before


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_every_quantity_of_shipped_robots_with_all_that_their_files_state(name: str) -> None:
    """Rotors count in M and c, friction and springs in the bias alone."""
    compiled = hybridyn.compile(hybridyn.load(name), "model")
    equal(compiled, *moving_states(compiled.robot, 4, 1)[:2])
    assert compiled.recomputed == 0


@pytest.mark.parametrize("name", ["five_bar", *map(slow, (x for x in ROBOTS if x != "five_bar"))])
def test_against_the_oracle(name: str) -> None:
    compiled = hybridyn.compile(hybridyn.load(name))
    oracle = Oracle(compiled.robot.description)
    q, v, _ = moving_states(compiled.robot, 2, 2)
    columns = columns_of(oracle, compiled.robot.motors)
    for t in range(2):
        close_to(compiled.motion_map(q[t]), oracle_map(oracle, q[t], columns), SOLVED)
        close_to(compiled.mass_matrix(q[t]), oracle_mass(oracle, q[t], columns), SOLVED)
        close_to(compiled.bias(q[t], v[t]), oracle_bias(oracle, q[t], v[t], columns), SOLVED)
    assert compiled.recomputed == 0


@pytest.mark.slow
def test_other_joints_than_the_motors(bar: hybridyn.CompiledRobot) -> None:
    before = bar.recomputed
    equal(bar, *moving_states(bar.robot, 4, 1)[:2], joints=ELBOWS)
    assert bar.recomputed == before


def test_one_sample_or_a_batch_in_several_parts(
    bar: hybridyn.CompiledRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    q, v, _ = moving_states(bar.robot, 5, 3)
    whole = bar.mass_matrix(q), bar.coriolis(q, v), bar.motion_map(q, v)[1]
    monkeypatch.setattr("hybridyn.compiled.programs.quantities.following.ROWS_AT_ONCE", 4)
    parts = bar.mass_matrix(q), bar.coriolis(q, v), bar.motion_map(q, v)[1]
    one = bar.mass_matrix(q[2]), bar.coriolis(q[2], v[2]), bar.motion_map(q[2], v[2])[1]
    for all_rows, some_rows, row in zip(whole, parts, one, strict=True):
        np.testing.assert_array_equal(all_rows, some_rows)
        np.testing.assert_array_equal(all_rows[2], row)


@pytest.mark.slow
@pytest.mark.parametrize("base", ["moving", "floating"])
def test_robots_on_other_bases(base: str) -> None:
    """Forces on a floating base are computed with models of the robot on a held one."""
    compiled = hybridyn.compile(hybridyn.load("five_bar", base=base), "model")
    q, v, _ = moving_states(compiled.robot, 3, 1)
    equal(compiled, q, v)
    if base == "floating":
        equal(compiled, q, v, joints=ELBOWS)
    assert compiled.recomputed == 0
    given = np.arange(6.0)
    if base == "moving":
        words = error_of(compiled.coriolis_matrix, q, v)
        assert words == error_of(hybridyn.coriolis_matrix, compiled.robot, q, v)
        assert "the moving base has a twist" in words
        expected = hybridyn.bias(compiled.robot, q, v, base_acceleration=given, effects="model")
        close_to(compiled.bias(q, v, base_acceleration=given), expected, SOLVED)


def error_of(function: Any, *arguments: Any, **options: Any) -> str:
    """Return the message of the error that a call raises."""
    with pytest.raises(hybridyn.HybridynError) as caught:
        function(*arguments, **options)
    return f"{type(caught.value).__name__}: {caught.value}"


@pytest.mark.slow
def test_the_words_at_singular_postures() -> None:
    robot, flat = flat_five_bar()
    compiled = hybridyn.compile(robot)
    q = np.array([robot.home, robot.home, flat])
    v = np.zeros((3, robot.nv))
    link = list(robot.bodies.place)[-1]
    calls: list[tuple[str, tuple[Any, ...]]] = [
        ("mass_matrix", (q,)), ("bias", (q, v)), ("coriolis", (q, v)), ("coriolis_matrix", (q, v)),
        ("gravity", (q,)), ("motion_map", (q,)), ("motion_map", (q, v)), ("link_jacobian", (q, link)),
        ("joint_map", (q, ["left_elbow", "right_elbow"])),
    ]  # fmt: skip
    for name, arguments in calls:
        words = error_of(getattr(compiled, name), *arguments)
        assert words.startswith(SingularityError.__name__)
        assert "motors lose a direction at sample 2 (parallel singularity" in words
        assert words == error_of(getattr(hybridyn, name), robot, *arguments)


@pytest.mark.slow
def test_links_of_a_robot_at_a_parallel_singularity_have_a_delassus_matrix() -> None:
    """Motors lose a direction there, inertia does not: the general path computes these samples alone."""
    robot, flat = flat_five_bar()
    compiled, link = hybridyn.compile(robot), list(robot.bodies.place)[-1]
    q = np.array([robot.home, flat])
    close_to(compiled.delassus(q, link), hybridyn.delassus(robot, q, link), SOLVED)
    assert compiled.recomputed == 1


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_operational_inertia_and_its_refusal(dtype: str) -> None:
    compiled = hybridyn.compile(hybridyn.load("gough_stewart"), dtype=dtype)
    robot, link = compiled.robot, compiled.robot.modules[0].outputs[0]
    q, _, _ = moving_states(robot, 3, 1)
    expected = hybridyn.operational_inertia(robot, q, link)
    found = compiled.operational_inertia(q, link)
    assert found.dtype == dtype
    close_to(found, expected, SOLVED if dtype == "float64" else SINGLE)
    close_to(compiled.operational_inertia(q[1], link), expected[1], SOLVED if dtype == "float64" else SINGLE)
    assert compiled.recomputed == 0
    for links in (robot.description.root, [link, robot.description.root]):
        words = error_of(compiled.operational_inertia, q, links)
        assert words == error_of(hybridyn.operational_inertia, robot, q, links)
        assert "cannot be moved in every direction at sample 0" in words


@pytest.mark.slow
def test_the_words_where_closures_lose_rank(tmp_path: Path) -> None:
    robot = parallelogram(tmp_path)
    compiled = hybridyn.compile(robot)
    for name in ("mass_matrix", "gravity", "motion_map"):
        words = error_of(getattr(compiled, name), np.zeros(3))
        assert "closures lose rank at sample 0" in words
        assert words == error_of(getattr(hybridyn, name), robot, np.zeros(3))


def test_the_words_where_loops_are_open(bar: hybridyn.CompiledRobot) -> None:
    robot = bar.robot
    elbow = robot.q_slices[robot.joint_index[ELBOWS[0]]]
    q, rates = robot.home.copy(), np.array([1.0, 0.0, 0.0, 0.0])
    q[elbow] += 0.1
    words = error_of(bar.mass_matrix, q)
    assert words == error_of(hybridyn.mass_matrix, robot, q)
    assert words.startswith(AssemblyError.__name__)
    for name in ("bias", "coriolis", "motion_map"):
        words = error_of(getattr(bar, name), robot.home, rates)
        assert words == error_of(getattr(hybridyn, name), robot, robot.home, rates), name


def test_bad_questions_are_refused(bar: hybridyn.CompiledRobot) -> None:
    robot: HybridRobot = bar.robot
    for joints in (["m1_left_drive"], [*ELBOWS, "m1_left_drive"], ["what"]):
        words = error_of(bar.mass_matrix, robot.home, joints=joints)
        assert words == error_of(hybridyn.mass_matrix, robot, robot.home, joints=joints)
    with pytest.raises(TrajectoryError, match="unknown link 'what'"):
        bar.link_jacobian(robot.home, "what")
    with pytest.raises(TrajectoryError, match=r"q has shape \(3,\); wanted"):
        bar.gravity(np.zeros(3))


@pytest.mark.parametrize("ends", [("ja", "jx"), ("jx", "jd")])
def test_joints_that_are_never_independent(ends: tuple[str, str]) -> None:
    """Loops lock one: the program, which has to take another in its place, is not used."""
    compiled = hybridyn.compile(hinged_five_bar())
    robot, joints = compiled.robot, named(compiled.robot, *ends)
    for name in ("motion_map", "mass_matrix", "gravity", "joint_map"):
        words = error_of(getattr(compiled, name), robot.home, joints=joints)
        assert words == error_of(getattr(hybridyn, name), robot, robot.home, joints=joints)
        assert "they are not independent" in words


def test_a_motion_map_that_is_trusted_nowhere_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = hybridyn.load("five_bar")

    def batch(states: list[np.ndarray], threads: int) -> Any:
        """Trust nothing."""
        return states, np.full(len(states[0]), np.inf)

    calls = SimpleNamespace(batch=batch, trusted=1.0, dtype=np.dtype(float))
    monkeypatch.setattr(following, "Library", lambda _: SimpleNamespace(programs={"following": calls}))
    moves = following.Following(robot, independent_coordinates(robot, None), "float64")
    with pytest.raises(CompileError, match="trusted at none of 96 random states"):
        moves._accept(None)  # type: ignore[arg-type]
