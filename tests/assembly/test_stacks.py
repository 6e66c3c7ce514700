"""Targets of random stacks against least squares on Pinocchio's kinematics with the rows of the file."""

from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import AssemblyError
from hybridyn.assembly.chain import solve
from hybridyn.assembly.chain.task import ChainTask
from tests.assembly.aims import Aim, Array, march, random_aims
from tests.assembly.fitted import differenced
from tests.assembly.test_angles import arm
from tests.robots.as_written import WRITTEN
from tests.support.comparing import refused
from tests.support.samples import slow

REACHED = 1e-10  # of positions [m, rad]
MET = 1e-10  # of prescribed rates, relative to the largest: solved with rows of condition up to some hundreds
SOLVED = 1e-8  # of rates and accelerations of determined targets, relative
LEAST = 5e-3  # of rates of the rule: a thousandth, squared, of joints of legs that are cut there
STEP = 2.5e-3  # of differences, at rates of one [s]: STEP^6 of motions of size 1, and rounding over STEP^2
DIFFERENCED = 1e-7  # relative
RULED = 1e-6  # of accelerations of the rule, which hold a difference of their own
CLEAR = 0.3  # least part of the first least singular value on the way to a target
ALIKE = 0.3  # of the motion of the rule: in small steps, and in one
#: Targets of a stack; of the slow ones, 20 of 100 stacks.
STACKS, TARGETS = 4, 20
CASES = [((name,), 2) for name in (1, 3, 5, "excavator")]
CASES += [slow(tuple(range(seed, seed + STACKS)), TARGETS) for seed in range(0, 100, STACKS)]
CASES += [slow((name,), TARGETS) for name in (*WRITTEN, "stewart_ur5", "scara_delta", "tanev")]
CASES += [slow(("lx4",), 4)]


def assembled(aim: Aim, t: float, x: Array) -> tuple[Array, Array, Array]:
    """Return what `assemble` finds from a guess, as the judge has it."""
    s = aim.standing
    q, v, a = hybridyn.assemble(s.robot, guess=s.given(x), **aim.asked(t))
    return s.taken(q), s.rates_taken(v), s.rates_taken(a)


def near(one: Array, other: Array, tolerance: float) -> None:
    """Compare motions relative to the largest entry, at least 1."""
    assert np.abs(one - other).max() <= tolerance * max(1.0, np.abs(other).max())


def along(aim: Aim, v: Array, h: float) -> dict[int, Array]:
    """Return postures that meet an aim at -3 to 3 steps h, by their tangent."""
    f, ease, out = aim.standing.fitted, aim.standing.ease, {}
    for k in (-3, -2, -1, 1, 2, 3):
        x = f.close(pin.integrate(f.model, aim.x, k * h * v), aim.wanted, k * h, ease, aim.rank)
        assert x is not None
        out[k] = x
    return out


@pytest.mark.parametrize(("names", "count"), CASES)
def test_rates_and_accelerations_are_those_of_a_fine_motion(names: tuple[int | str, ...], count: int) -> None:
    """Where targets leave freedoms, rates are the least ones, and accelerations their derivatives."""
    for aim in random_aims(names, count):
        f, ease = aim.standing.fitted, aim.standing.ease
        x, v, a = assembled(aim, 0.0, aim.x)
        assert np.abs(f.apart(aim.x, x)).max() < REACHED  # it is there already
        _, J, rates = f.rows(aim.x, aim.wanted)
        near(J @ v, rates, MET)
        near(v, f.rates(aim.x, aim.wanted, 0.0, ease, aim.rank), LEAST if aim.left else SOLVED)
        h = STEP / max(1.0, np.abs(v).max(), np.sqrt(np.abs(a).max()))
        postures = along(aim, v, h)
        if aim.left:
            moving = {k: assembled(aim, k * h, x)[1] for k, x in postures.items()}
        else:
            moving = {k: f.rates(x, aim.wanted, k * h, ease, aim.rank) for k, x in postures.items()}
            near(differenced({k: f.apart(aim.x, x) for k, x in postures.items()}, h), v, DIFFERENCED)
        near(differenced(moving, h), a, RULED if aim.left else DIFFERENCED)


@pytest.mark.parametrize(("names", "count"), CASES)
def test_targets_are_reached_on_the_branch_of_the_guess(names: tuple[int | str, ...], count: int) -> None:
    """In one step, against small steps of the judge."""
    for aim in random_aims(names, count, still=True):
        f = aim.standing.fitted
        way = march(aim, 0.03 * np.arange(1, 11), CLEAR)
        if not len(way.times):
            continue
        t, there = float(way.times[-1]), way.postures[-1]
        x, _, _ = assembled(aim, t, aim.x)
        assert np.abs(f.rows(x, aim.wanted, t)[0]).max() < REACHED
        off = f.apart(there, x)
        if not aim.left:
            assert np.abs(off).max() < REACHED
        else:
            whole = f.apart(aim.x, there) / aim.standing.ease
            assert np.abs(off / aim.standing.ease).max() < ALIKE * np.abs(whole).max()


@pytest.mark.parametrize(("seed", "number"), [(6, 2), (15, 2)])
def test_all_modules_move_on_the_way_from_a_guess(seed: int, number: int) -> None:
    """If motors that are given moved first, the tool would pass a fold, or angles be told apart elsewhere."""
    aim = next(islice(random_aims([seed], 20, still=True), number, None))
    way = march(aim, 0.03 * np.arange(1, 11), CLEAR)
    x, _, _ = assembled(aim, float(way.times[-1]), aim.x)
    assert np.abs(aim.standing.fitted.apart(x, way.postures[-1])).max() < REACHED


class _CaughtError(Exception):
    """Carries what would be followed."""


def _caught(task: ChainTask, *_: object, **__: object) -> None:
    raise _CaughtError(task)


@pytest.mark.parametrize("seeds", [(3,), slow(range(50)), slow(range(50, 100))])
def test_no_length_is_lacking_to_what_is_reached(seeds: range, monkeypatch: pytest.MonkeyPatch) -> None:
    """From any posture, be it closed or not."""
    monkeypatch.setattr(solve, "follow", _caught)
    for aim in random_aims(seeds, 4):
        s = aim.standing
        with pytest.raises(_CaughtError) as caught:
            assembled(aim, 0.0, aim.x)
        (task,) = caught.value.args
        rng = np.random.default_rng(0)
        tree, scale = task.problem.tree, task.problem.col_scale
        numbers = [[m.name for m in s.robot.modules].index(part.module) for part in task.parts]
        home = solve.cut_positions(s.robot, numbers, s.robot.home[None])
        q = tree.integrate(np.repeat(home, 5, axis=0), rng.normal(size=(5, tree.nv)) * scale)
        assert not task.lacking(q, np.zeros(5, dtype=int)).any()


@pytest.mark.parametrize(
    ("motors", "pose", "lacks"),
    [
        ({}, {"x": 3.0, "z": 0.0}, 2.0),
        ({}, {"x": -3.0, "z": 4.0}, 4.0),
        ({}, {"z": 1.5}, 0.5),
        ({"j1": 2.0}, {"x": 2.0, "z": 0.0}, 2.0 - np.cos(1.0)),
    ],
)
def test_the_length_that_is_lacking_is_told(
    tmp_path: Path, motors: dict[str, float], pose: dict[str, float], lacks: float
) -> None:
    """Two links of half a metre each."""
    robot = arm(tmp_path, "yyy")
    held = motors | {"j2": 0.0}
    error = refused(
        partial(hybridyn.assemble, robot, motors=held, platforms={"l2": (pose,)}),
        AssemblyError,
        rf"the way to the target lacks {lacks:.2g} m in any posture\)",
    )
    assert error.iterations <= 60  # of one start
