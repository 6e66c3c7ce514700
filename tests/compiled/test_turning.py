"""Bounds of how far Jacobians turn in a step: no step that the full check refuses passes by its bound."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.requests import gather_requests
from hybridyn.compiled.equations.expressions import Folding, pack, symbols
from hybridyn.compiled.equations.guarded_elimination import Pivots
from hybridyn.compiled.loops import bounds
from hybridyn.compiled.loops.bounds import largest_solutions
from hybridyn.compiled.programs.closing import closing_source, libraries
from hybridyn.compiled.programs.closing.assembling import Assembler
from hybridyn.compiled.programs.closing.given import Given
from hybridyn.compiled.programs.closing.kernels import ModuleKernels
from hybridyn.compiled.programs.closing.members import parts_of
from hybridyn.compiled.programs.closing.own_requests import module_requests
from hybridyn.compiled.programs.closing.rows import rows_at
from hybridyn.compiled.programs.closing.unknowns import Unknowns
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.assembly.test_assembly import waves
from tests.compiled.test_assemble import in_c, rows_towards
from tests.dynamics.test_idm import symmetric_five_bar
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.robots.posing import of_joints
from tests.robots.shipped import shipped
from tests.support.samples import slow

ROUNDING = 1e-9  # of a bound, through the condition of a Jacobian whose pivots are trusted
#: How far two postures are apart: from a tick to half a turn.
SIZES = (1e-4, 1e-2, 0.3, 2.0)


def kernels_of(robot: hybridyn.HybridRobot, motors: Any) -> list[ModuleKernels]:
    """Return the writers of the kernels of modules that follow motors."""
    requests = gather_requests(robot, motors, {})
    wanted = module_requests(robot, requests)
    parts = None if wanted is None else parts_of(robot, wanted)
    return [ModuleKernels([part.module], part.given, part.blocks) for part in parts or []]


def least_margin(writer: ModuleKernels) -> float:
    """Return the least of t / (1 - t), t the bound, over what "branch" gives, at random pairs of postures.

    It is at least 1 for any two postures, whether they close the loops or not.
    """
    written, rng = writer.write(), np.random.default_rng(0)
    (settle, numbers), (branch, _) = written["settle"], written["branch"]
    (table,), least = numbers.astype(float), np.inf
    rates = np.zeros(writer.u.given.rates)
    for start in zip(*writer._postures(writer.u.modules[0]), strict=True):
        for size in SIZES:
            at, p, g = (x + size * rng.uniform(-1, 1, x.shape) for x in start)
            *_, bound, _ = settle(at, p, *start, g, rates, rates, table)
            _, turned, guard = branch(*start, at, p, at, p, g, table)
            t = float(bound)
            if float(guard) <= 1.0 and t < 1.0 and turned > 0.0:
                least = min(least, t / (1.0 - t) / float(turned))
    return least


@pytest.mark.parametrize("name", ["five_bar", *map(slow, ("gough_stewart", "delta", "tanev", "stewart_ur5"))])
def test_bounds_are_above_what_the_full_check_computes(name: str) -> None:
    robot = build_robot(shipped(name))
    margins = [least_margin(x) for x in kernels_of(robot, waves(robot, np.zeros(1), 0.01))]
    assert 1.0 - ROUNDING <= min(margins) < 20.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in KINDS if KINDS[kind].motors != "few"])
def test_bounds_of_generated_mechanisms(kind: str) -> None:
    description = random_mechanism(8, kind=kind)
    robot = build_robot(description)
    motors = of_joints(robot, *random_states(description, "fixed", 2, 3))
    for writer in kernels_of(robot, motors):
        assert least_margin(writer) >= 1.0 - ROUNDING


@pytest.mark.parametrize("kind", ["loop_planar", "gear_three", "five_bar_four_motors"])
def test_rates_of_rows_are_the_rows_times_the_rates(kind: str) -> None:
    robot = build_robot(random_mechanism(8, kind=kind))
    rng = np.random.default_rng(5)
    for module in robot.modules:
        u, folding = Unknowns([module], Given((), (), ()), (), ({}, {})), Folding()
        v = rng.normal(size=u.e.tree.nv)
        rows = rows_at(u.trees, u.given, folding, u.positions(0), u.targets(), {}, v.astype(object))
        inputs = [*u.symbols("q_0", "p_0"), folding.symbol()]
        function = ca.Function("rows", inputs, [pack(rows.K), pack(rows.rates)])
        q, p = (rng.uniform(-1, 1, x.numel()) for x in inputs[:2])
        K, rates = (np.array(x).ravel() for x in function(q, p, folding.table(1)[0].astype(float)))
        right = K.reshape(rows.K.shape) @ v
        assert np.abs(rates - right).max(initial=0.0) <= ROUNDING * np.abs(K).max(initial=0.0)


@pytest.mark.parametrize("blocks", [0, 3])
def test_largest_solutions_bound_every_solution(blocks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrow matrices, whose last rows are full, as those of legs under a platform, and a full matrix.

    The more operations the bounds may take, the lower they are; with all of them they are exact.
    """
    rng, n = np.random.default_rng(4), 2 * blocks + 4
    A = rng.normal(size=(n, n))
    for i in range(2 * blocks):
        for j in range(2 * blocks):
            A[i, j] *= i // 2 == j // 2
    A += 2 * np.diag(np.sign(np.diag(A)))
    order, size = rng.permutation(n), rng.uniform(0.1, 1.0, n)
    column, entries = symbols("K", np.count_nonzero(A))
    K = A[order].astype(object)
    K[K != 0.0] = entries
    rows = tuple(int(x) for x in np.argsort(order))
    found, taken, shares = [], [], (0.0, bounds.INVERTED, 0.5, np.inf)
    for share in shares:
        monkeypatch.setattr(bounds, "INVERTED", share)
        most = pack(largest_solutions(K, size.astype(object), Pivots(rows, tuple(range(n)), (1.0,) * n)))
        found.append(np.array(ca.Function("bounds", [column], [most])(A[order][A[order] != 0.0])).ravel())
        taken.append(ca.n_nodes(most))
    worst = np.abs(np.linalg.inv(A[order])) @ size
    assert (np.diff(found, axis=0) <= ROUNDING * worst).all()
    np.testing.assert_allclose(found[-1], worst, rtol=ROUNDING)
    assert all(x <= (1.0 + share) * taken[0] for x, share in zip(taken, shares, strict=True))
    assert (found[1] / found[0]).min() < 0.9


# ------------------------------------------------------------------ with bounds and without


def closed(robot: hybridyn.HybridRobot, motors: Any, guess: Array | None = None) -> Any:
    """Return the rows in C and how many the general path computed, or the error in words."""
    assembler = Assembler(robot)
    try:
        return *in_c(assembler, motors=motors, guess=guess), assembler.recomputed
    except hybridyn.HybridynError as error:
        return str(error), assembler.recomputed


def tables(robot: hybridyn.HybridRobot) -> list[Any]:
    """Return tables of motors with steps of all lengths, through folds, and between random postures."""
    rng = np.random.default_rng(6)
    out = [waves(robot, np.linspace(0, 6, count), 0.5) for count in (601, 25, 7)]
    home = {m: x[0][0] for m, x in waves(robot, np.zeros(1), 0.0).items()}
    for size in 10.0 ** rng.uniform(-5, 0.3, 12):
        rows = np.cumsum(rng.normal(size=(9, len(home))) * size, axis=0)
        out.append({m: x + rows[:, i] for i, (m, x) in enumerate(home.items())})
    return out


@pytest.mark.slow
@pytest.mark.parametrize("name", ["symmetric", "five_bar", "gough_stewart"])
def test_tables_have_the_bits_of_the_full_check(name: str, monkeypatch: Any) -> None:
    """Without bounds every step takes the full check; rows, errors and counts are the same."""
    robot = build_robot(symmetric_five_bar() if name == "symmetric" else shipped(name))
    wanted = tables(robot)
    if name == "symmetric":
        ways = 1.0 - np.abs(np.linspace(-1, 1, 81)) ** 0.5
        for end in (-1e-5, -1e-3, 1e-6, 1e-2):
            wanted += [rows_towards(robot, -0.2, end, list(x)) for x in (ways, ways[::7], ways[::20])]
    by_bounds = [closed(robot, motors) for motors in wanted]
    monkeypatch.setattr(closing_source, "MOST_BOUND", -1.0)
    monkeypatch.setattr(libraries, "robot_key", lambda *_: f"{name} without bounds")
    in_full = [closed(robot, motors) for motors in wanted]
    for x, y in zip(by_bounds, in_full, strict=True):
        assert len(x) == len(y)
        assert all(np.array_equal(a, b) for a, b in zip(x, y, strict=True))
