"""No unnoticed change of branch: Dietmaier's forty postures followed close by and past where branches meet.

Judge: every posture that comes out is tracked back to where the motion began in steps that Kantorovich's
theorem proves (`dietmaier.Tracked`), on other equations than the robot's.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

import hybridyn
from tests.hard import dietmaier
from tests.hard.claims import Claim
from tests.support.samples import slow

SAME = 1e-6  # of p [m] and e: the forward error of the worst posture below is 1e-9


def apart(pose: np.ndarray, other: np.ndarray) -> float:
    """Return the distance of two poses, signs of quaternions apart."""
    flipped = np.concatenate([other[:3], -other[3:]])
    return float(min(np.abs(pose - other).max(), np.abs(pose - flipped).max()))


#: What errors advise, one of which each must say.
MENDS = (
    "Move the trajectory away", "move it, or give a better guess",
    "Go there by a way that avoids the singularity between them",
)  # fmt: skip


def led_astray(number: int, lengths: np.ndarray) -> bool | None:
    """Follow leg lengths (T, 6) from a posture; say whether the last posture lies on another branch.

    None where the solver says that it cannot follow: with a message that names the sample and the mend.
    """
    robot, start = dietmaier.robot(), dietmaier.forty().q[number]
    try:
        q = hybridyn.assemble(robot, motors=dietmaier.motors(lengths), guess=start)[0]
    except hybridyn.AssemblyError as error:
        named = f"sample {error.sample}" in str(error)
        mend = any(text in str(error) for text in MENDS)
        return None if named and mend else True
    back = dietmaier.Tracked(dietmaier.poses(q[-1]), lengths[-1])
    arrived = all(back.move(row) for row in lengths[-2::-1])
    return not arrived or apart(back.pose, dietmaier.poses(start)) > SAME


def long_ways(seed: int, count: int) -> list[tuple[int, np.ndarray]]:
    """Draw straight ways of 3 mm to 0.3 m for leg lengths, in 1, 2 or 4 steps, from each posture in turn."""
    rng = np.random.default_rng(seed)
    out = []
    for number in range(count):
        way = rng.normal(size=6)
        way *= np.exp(rng.uniform(np.log(0.003), np.log(0.3))) / np.linalg.norm(way)
        parts = int(rng.choice([1, 2, 4]))
        way = np.linspace(0, 1, parts + 1)[:, None] * way
        out.append((number % dietmaier.REAL, dietmaier.LENGTHS + way))
    return out


ASTRAY = (36, 38, 49, 61, 74, 94, 101)
"""Ways of seed 3 on which comparing steps alone, not the derivative's turning, ended on other branches."""


def answers(claim: Claim, case: str, ways: list[tuple[int, np.ndarray]], refused_at_most: float) -> None:
    """Hold the ways to: no change of branch without an error, and not too many errors."""
    astray = [led_astray(number, lengths) for number, lengths in ways]
    claim(case, "unnoticed changes of branch", sum(x is True for x in astray), 0)
    claim(case, "share of ways refused", np.mean([x is None for x in astray]), refused_at_most)


@pytest.mark.parametrize("count", [1, slow(3)])
def test_steps_longer_than_branches_are_apart(count: int, claim: Claim) -> None:
    """Ways that long steps once took to another branch: some of the 7 of the 120 of this seed.

    Beyond a fold the branch ends, so that many must be refused: a bound of 1 says that errors are answers.
    """
    ways = long_ways(3, 120)
    answers(claim, "Dietmaier, long steps that once went astray", [ways[i] for i in ASTRAY[:count]], 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_long_ways_from_all_postures(claim: Claim, seed: int) -> None:
    """120 ways of up to 0.3 m in one to four steps; half of them pass the end of their branch."""
    answers(claim, f"Dietmaier, 120 long ways, seed {seed}", long_ways(seed, 120), 0.75)


def brushing(number: int, seed: int, left: float, steps: int) -> np.ndarray | None:
    """Return leg lengths that go near a fold, along it, and back to the start; None where none is in reach.

    Args:
        number: The posture.
        seed: Chooses the directions.
        left: What is left of the way to the fold when turning.
        steps: Samples on each of the three ways.
    """
    rng = np.random.default_rng([seed, number])
    ahead = dietmaier.Tracked(dietmaier.poses(dietmaier.forty().q[number]))
    way = rng.normal(size=6)
    ahead.move(dietmaier.LENGTHS + 0.3 * way / np.linalg.norm(way), 1e-4)
    reach = ahead.lengths - dietmaier.LENGTHS
    near = dietmaier.Tracked(dietmaier.poses(dietmaier.forty().q[number]))
    if np.linalg.norm(reach) < 0.01 or not near.move(dietmaier.LENGTHS + (1 - left) * reach):
        return None
    along, normal = rng.normal(size=6), near.normal()
    along -= normal * (along @ normal)
    corners = [near.lengths, near.lengths + 0.02 * along / np.linalg.norm(along), dietmaier.LENGTHS]
    if not all(near.move(corner, 1e-6) for corner in corners[1:]):
        return None
    corners = [dietmaier.LENGTHS, *corners]
    parts = np.linspace(0, 1, steps + 1)[:, None]
    legs = [a + parts[bool(i) :] * (b - a) for i, (a, b) in enumerate(pairwise(corners))]
    return np.concatenate(legs)


EVERY, SOME = range(dietmaier.REAL), (0, 4, 20)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("left", "steps", "seed", "numbers", "refused"),
    [
        (1e-1, 5, 1, (0,), 0.0), (1e-1, 10, 1, SOME, 0.0), (1e-2, 1, 1, SOME, 0.0),
        (1e-2, 100, 2, EVERY, 0.0), (1e-3, 100, 2, EVERY, 0.0), (1e-3, 3, 2, EVERY, 1.0),
        (1e-4, 10, 2, EVERY, 0.0),
    ],
    ids=lambda x: None if not isinstance(x, tuple | range) else f"of {len(x)}",
)  # fmt: skip
def test_ways_that_brush_a_fold(
    claim: Claim, left: float, steps: int, seed: int, numbers: Sequence[int], refused: float
) -> None:
    """To a tenth and down to a ten-thousandth of the way from a fold, along it and back, finely and coarsely.

    The judge has tracked all of these ways before: each ends where it began or where the judge says. Three
    steps to a thousandth of a fold are far too long: there a way may be refused, with the mend, but none may
    end on another branch.
    """
    ways = [(n, way) for n in numbers if (way := brushing(n, seed, left, steps)) is not None]
    assert len(ways) >= min(len(numbers), 2)
    answers(
        claim, f"Dietmaier, {len(ways)} ways to {left:g} from a fold, {steps} steps a side", ways, refused
    )
