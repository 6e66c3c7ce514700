"""Guards of open loops and of calls, and one division per divisor."""

import sys
import threading
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hybridyn
from benchmarks.operations import costing, flattened
from hybridyn.compiled.code.graph import graph_of
from hybridyn.compiled.code.kernels import operations_of
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.chains import point_acceleration, point_velocity
from hybridyn.compiled.equations.core import write_core
from hybridyn.compiled.equations.direct import _inertia_guard
from hybridyn.compiled.equations.expressions import numbers, pack, plain
from hybridyn.compiled.equations.factors import solve_definite
from hybridyn.compiled.equations.guarded_elimination import (
    TRUSTED_PIVOT,
    choose_pivots,
    solve,
)
from hybridyn.compiled.equations.least_inertia import NEARLY_NO_INERTIA
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.scales import squares
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.library.calls import Library, load
from hybridyn.compiled.program import Call, GivenPlace, Kernel, Program, ResultPlace, Worst
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.effects.choice import choose
from hybridyn.structure.building import build_robot
from hybridyn.symbols import dot
from tests.compiled.toys import inputs, single, toy
from tests.robots.mechanisms import random_mechanism
from tests.robots.shipped import ROBOTS
from tests.support.samples import slow

CLEARLY = 1e-2  # a joint moved by so much opens its loop so far that the general path raises
BARELY = 1e-8  # relative; a hundredth of what the general path lets pass, a thousand times the guard's limit

HELD = 1e-12  # rounding, of motions of order one


def refused(robot: hybridyn.HybridRobot, name: str, states: list[Any]) -> bool:
    """Return whether the general path refuses a state because its loops are open."""
    try:
        getattr(hybridyn, name)(robot, *states)
    except hybridyn.AssemblyError:
        return True
    return False


@pytest.mark.parametrize(
    "name",
    ["five_bar", "gear_three", *map(slow, ("delta", "gough_stewart", "tanev"))],
)
def test_each_joint_that_opens_a_loop_is_noticed(name: str) -> None:
    """Change single joints a little, wherever the general path refuses a larger change."""
    robot = hybridyn.load(name) if name in ROBOTS else build_robot(random_mechanism(0, kind=name))
    q, v, a, tau = (x[0] for x in random_states(robot, 1))
    seen = 0
    for model, program in programs(robot, models=("idm", "ddm")).items():
        function = function_of(program)
        third = a if model == "idm" else tau
        assert float(function(q, v, third)[1]) <= 1.0
        given = [q, v, a] if model == "idm" else [q, v]
        for which, column in enumerate(given):
            size = np.abs(column).max() if which else 1.0
            for k in range(len(column)):
                moved, nearly = [q, v, third], [q, v, third]
                moved[which], nearly[which] = column.copy(), column.copy()
                moved[which][k] += CLEARLY * size
                nearly[which][k] += BARELY * size
                if refused(robot, model, moved):
                    seen += 1
                    assert not float(function(*nearly)[1]) <= 1.0, (model, which, k)
    assert seen >= robot.nv


def test_forces_that_no_motor_bears_are_noticed() -> None:
    """One motor for two freedoms bears what the direct model gives, but not any motion of the linkage."""
    robot = hybridyn.load("five_bar", motors=["m1_left_drive"])
    function = function_of(programs(robot, models=("idm",))["idm"])
    for drawn, borne in ((robot, True), (hybridyn.load("five_bar"), False)):
        q, v, a, _ = (x[0] for x in random_states(drawn, 1))
        assert (float(function(q, v, a)[1]) <= 1.0) == borne


def test_pivots_far_below_their_usual_size_are_noticed() -> None:
    """Pivots are chosen where the first entry is about 2.5."""

    def K(x: Any) -> np.ndarray:
        return np.array([[x, 1.0, 0.3], [0.2, 0.5, 1.0]], dtype=object)

    samples = np.array([K(x) for x in np.linspace(2.0, 3.0, 9)], dtype=float)
    pivots, x = choose_pivots(samples, 2, np.ones(2), np.ones(3)), ca.SX.sym("x")
    _, doubts = solve(K(x), plain(np.ones((2, 1))), pivots)
    guard = ca.Function("guard", [x], [squares(doubts)])
    for share, trusted in ((1.0, True), (1.1 * TRUSTED_PIVOT, True), (0.9 * TRUSTED_PIVOT, False)):
        assert (float(guard(2.5 * share)) <= 1.0) == trusted


def test_motions_that_move_the_same_mass_are_noticed() -> None:
    """Each has an inertia, but their difference has nearly none."""
    c, usual = ca.SX.sym("c"), SimpleNamespace(usual=(1.0, 1.0))
    A = np.array([[1.0, c], [c, 1.0]], dtype=object)
    _, definite = solve_definite(A, plain(np.ones((2, 1))), NEARLY_NO_INERTIA)
    guard = ca.Function("guard", [c], [_inertia_guard(0.0, usual, A, definite)])
    for left, trusted in ((0.5, True), (2 * NEARLY_NO_INERTIA, True), (0.1 * NEARLY_NO_INERTIA, False)):
        assert (float(guard(np.sqrt(1.0 - left))) <= 1.0) == trusted


def test_wrists_that_place_a_platform_hold_at_any_joint_motion() -> None:
    """The guard does not compare their closures: place, rate and acceleration agree where loops are open."""
    robot, generator, seen = hybridyn.load("tanev"), np.random.default_rng(0), 0
    for plan in request(robot, choose(robot, None)).plans:
        q, v, a = (plain(x) for x in generator.normal(size=(3, plan.mechanism.spanning.nv)))
        core = write_core(plan, q, v, plain(generator.normal(size=6)), a, plain(generator.normal(size=6)))
        for k, c in enumerate(plan.parts.closures):
            motion = []
            for body, point in ((c.body_a, numbers(c.p_a)), (c.body_b, numbers(c.p_b))):
                chain, p = core.chain, point
                R0, V, A = chain.R0[body], chain.V[body], chain.c[body]
                parts = (p, point_velocity(V, p), point_acceleration(V, A, p))
                moved = [dot(R0, x) for x in parts]
                motion.append(np.array(ca.DM(ca.evalf(pack(moved[0] + chain.p0[body], *moved[1:])))))
            apart = np.abs(motion[0] - motion[1]).max()
            held = k >= plan.parts.checked
            seen += held
            assert apart < HELD if held else apart > CLEARLY
    assert seen == len(robot.modules)


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("five_bar", 1.86),
        slow("delta", 1.51),
        slow("tanev", 1.47),
    ],
)
def test_the_guard_takes_few_operations(name: str, most: float) -> None:
    robot = hybridyn.load(name)
    (program,) = programs(robot, models=("idm",)).values()
    with_guard, alone = flattened(program)
    assert with_guard < most * alone


def test_results_that_are_not_finite_are_not_trusted() -> None:
    program = toy(3, 1)
    function, given = function_of(program), [x[0] for x in inputs(program, 1)]
    assert np.isfinite(float(function(*given)[-1]))
    assert float(function(*(x * np.nan for x in given))[-1]) == np.inf


def test_a_divisor_divides_once() -> None:
    a, b, c = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("c")
    f = ca.Function("f", [a, b, c], [ca.vertcat(a / c, b / c, a / 3, b / a)])
    assert sum(node.name == "div" for node in graph_of(f).nodes) == 4
    costs = [node.name for node in costing(operations_of(f))]
    assert costs.count("div") == 2  # 1 / c, b / a
    assert costs.count("mul") == 3


# -------------------------------------------------------------------- the guard of a call


def rooted(first: int) -> Program:
    """Return a program whose result is finite and whose guards are the roots of both inputs, in an order."""
    x = ca.SX.sym("x", 1)
    kernel = Kernel("root", ca.Function("root", [x], [1.0 + 0.0 * x * x, ca.sqrt(x)]), "module")
    calls = tuple(
        Call(0, 1, (GivenPlace(np.array([[k]])),), (ResultPlace(np.array([[k]])), Worst()))
        for k in (first, 1 - first)
    )
    return Program(f"rooted_{first}", (("x", 2),), (("one", 2),), (kernel,), calls, 0, 0)


@pytest.fixture(scope="module")
def roots() -> Library:
    """Return the programs of both orders."""
    return load([rooted(0), rooted(1)])


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("x", [(-1.0, 0.25), (0.25, -1.0), (-1.0, -1.0)])
def test_a_guard_that_is_nan_fails_in_every_engine(
    roots: Library, first: int, x: tuple[float, float]
) -> None:
    program, library = rooted(first), roots
    guards = [
        float(function_of(program)(np.array(x))[1]),
        single(library, program.name, np.array(x))[1],
        float(library.batch(program.name, np.array([x]))[1][0]),
        float(library.batch(program.name, np.array([x, x]))[1][1]),
    ]
    assert not any(guard <= GUARD_LIMIT for guard in guards)


def test_threads_do_not_read_each_others_guards(roots: Library) -> None:
    """Each thread calls with its own sample, while the others' guards are on the other side of the limit."""
    wrong = []

    def call(x: float) -> None:
        given, guard = np.full(2, x), np.sqrt(x)
        for _ in range(4000):
            if single(roots, "rooted_0", given)[1] != guard:
                wrong.append(x)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    threads = [threading.Thread(target=call, args=(x,)) for x in (0.25, 4.0, 0.0625, 16.0)]
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert not wrong
