"""Targets of random stacks against least squares on Pinocchio's kinematics with the rows of the file."""

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from tests.aims import Aim, Array, march, random_aims
from tests.fitted import differenced
from tests.samples import slow

REACHED = 1e-10  # of positions [m, rad]
MET = 1e-10  # of prescribed rates, relative to the largest: solved with rows of condition up to some hundreds
SOLVED = 1e-8  # of rates and accelerations of determined targets, relative
LEAST = 5e-3  # of rates of the rule: what counts a thousandth, squared, is the joints of cut legs here
    1e-4  # of those of the rule: joints without a motor count a thousandth of it, squared, times their number
)
STEP = 2.5e-3  # of differences, at rates of one [s]: STEP^6 of motions of size 1, and rounding over STEP^2
DIFFERENCED = 1e-7  # relative
CLEAR = 0.3  # least part of the first least singular value on the way to a target
ALIKE = 0.3  # of the motion of the rule: in small steps, and in one
#: Targets of a stack; of the slow ones, 20 of 100 stacks.
STACKS, TARGETS = 4, 20
CASES = [(range(seed, seed + 1), 2) for seed in (1, 3, 5)]
CASES += [slow(range(seed, seed + STACKS), TARGETS) for seed in range(0, 100, STACKS)]


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


@pytest.mark.parametrize(("seeds", "count"), CASES)
def test_rates_and_accelerations_are_those_of_a_fine_motion(seeds: range, count: int) -> None:
    """Where targets leave freedoms, rates are the least ones, and accelerations their derivatives."""
    for aim in random_aims(seeds, count):
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
        near(differenced(moving, h), a, DIFFERENCED)


@pytest.mark.parametrize(("seeds", "count"), CASES)
def test_targets_are_reached_on_the_branch_of_the_guess(seeds: range, count: int) -> None:
    """In one step, against small steps of the judge."""
    for aim in random_aims(seeds, count, still=True):
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
