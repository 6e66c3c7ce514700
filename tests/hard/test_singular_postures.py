"""Serial, parallel, leg and constraint singularities, approached from 1e-1 to 1e-12 and hit.

Claims, for every robot, kind and distance, against the same equations at the same float64 numbers in fifty
digits (`extended_judge.py` defines the errors and the condition numbers):

- wherever ddm and idm answer, their backward error is at most 1e-13 per module and their forward error at
  most 100 eps times the condition number of what is solved;
- at serial and parallel singularities ddm always answers;
- where the motors lose a direction (their map's reciprocal condition under 1e-10, `actuation.SINGULAR`), idm
  raises a SingularityError with the condition number, or gives the least-norm efforts, as it is asked;
- where closures lose rank (smallest pivot under 1e-13, `lost_rank.LOST`), both raise it; nearer than 1e-6 idm
  raises it as well where no digit of the efforts is left.

A least-norm answer is judged at a motion whose exact efforts have no part in the lost direction. Dropping a
direction with the share s in the motors, 0 <= s < 1e-10, may change it by s times its condition.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest

from hybridyn import HybridRobot, SingularityError, ddm, idm
from hybridyn.structure.building import build_robot
from tests.hard.claims import BACKWARD, FORWARD, Claim
from tests.hard.extended_judge import Judge
from tests.hard.singular_postures import PLACES, posture
from tests.support.comparing import refused

DISTANCES = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 0.0]
FEW = {
    "": {1e-9, 0.0},
    "gough_stewart": {1e-8, 0.0},
    "delta": {1e-8},
    "lx4": set(),
}
STACKED = (1e-3, 1e-12, 0.0)  # of two modules: distances at which both are refused, or none
LOST_MOTORS = 1e-10  # reciprocal condition of the motors' map at which idm stops, in its own scaling
LOST_ROWS = 1e13  # condition number of the closures at which both models stop, in their own scaling
SCALING = 50.0  # how far those scalings may be from the judge's
LEAST_SHARE = 1e-6  # a direction with less has no part in the efforts of a drawn motion


@dataclass(frozen=True)
class Case:
    """A robot near a singularity, a motion, and what the motors can do there."""

    name: str
    robot: HybridRobot
    judge: Judge
    tau: np.ndarray
    shares: np.ndarray
    dropped: int

    @property
    def backward(self) -> float:
        """The claim on backward errors."""
        return BACKWARD * len(self.robot.modules)

    @property
    def reciprocal(self) -> float:
        """Reciprocal condition number of the motors' map."""
        return float(self.shares[-1] / self.shares[0])


@lru_cache(maxsize=1)
def case(place: str, distance: float, seed: int) -> Case:
    """Draw rates, and efforts without a part in what the motors lose (or come near to losing)."""
    description, q = posture(place, distance)
    # Through a constraint singularity a drawn motion can only go slowly: accelerations are |v|^2 / distance.
    slow = min(1.0, 3 * distance**0.5) if "constraint" in place else 1.0
    judge = Judge(description, q, seed=seed, speed=slow)
    tau = 10 * np.random.default_rng(seed).normal(size=len(description.motors))
    _, shares, directions = np.linalg.svd(judge.B)
    lost = directions[shares < LEAST_SHARE * shares[0]]
    tau -= lost.T @ (lost @ tau)
    return Case(f"{place}, {distance:.0e}", build_robot(description), judge, tau, shares, len(lost))


#: Every place at every distance, most of them for the long run.
CASES = [
    pytest.param(
        place, d, seed, id=f"{place}-{d:.0e}{seed * '-again'}",
        marks=pytest.mark.slow if seed or d not in FEW.get(place.split()[0], FEW[""]) else (),
    )
    for place in PLACES
    for d in (STACKED if place.startswith("lx4") else DISTANCES)
    for seed in (0, 1)
]  # fmt: skip


@pytest.mark.parametrize(("place", "distance", "seed"), CASES)
def test_both_models(place: str, distance: float, seed: int, claim: Claim) -> None:
    this = case(place, distance, seed)
    judge, rows = this.judge, this.judge.condition_of_rows
    a, refusal = outcome(lambda: ddm(this.robot, judge.q, judge.v, this.tau))
    if refusal is not None:
        assert place.endswith("constraint") or place == "delta leg"
        assert rows > LOST_ROWS / SCALING
        refuses_lost_rows(this)
        return
    assert rows < LOST_ROWS * SCALING
    exact = judge.accelerations(this.tau)
    errors = judge.of_ddm(this.tau, a, exact)
    claim(this.name, "backward error of ddm", errors.backward, this.backward)
    claim(this.name, "forward error of ddm", errors.forward, FORWARD * errors.condition)
    inverse(this, exact.astype(float), claim)


def inverse(this: Case, a: np.ndarray, claim: Claim) -> None:
    """Hold idm to its claims at accelerations a, which the efforts `this.tau` make, up to their rounding."""
    judge, state = this.judge, (this.judge.q, this.judge.v, a)
    tau, refusal = outcome(lambda: idm(this.robot, *state))
    if refusal is None:
        assert this.reciprocal > LOST_MOTORS / SCALING
        errors = judge.of_idm(a, tau)
        claim(this.name, "backward error of idm", errors.backward, this.backward)
        claim(this.name, "forward error of idm", errors.forward, FORWARD * errors.condition)
        return
    assert this.reciprocal < LOST_MOTORS * SCALING
    assert refusal.what == "motors"
    assert (refusal.condition or 0.0) > 1 / LOST_MOTORS
    tau = idm(this.robot, *state, on_singular="least-norm")
    errors = judge.of_idm(a, tau, this.tau, dropped=this.dropped)
    claim(this.name, "backward error of least-norm idm", errors.backward, this.backward + this.reciprocal)
    bound = (FORWARD + this.reciprocal) * errors.condition
    claim(this.name, "forward error of least-norm idm", errors.forward, bound)


def outcome(call: Callable[[], np.ndarray]) -> tuple[np.ndarray, None] | tuple[None, SingularityError]:
    """Return what a model answers, or why it refuses."""
    try:
        return call(), None
    except SingularityError as refusal:
        return None, refusal


def refuses_lost_rows(this: Case) -> None:
    """Hold both models to a SingularityError of the closures, at rest as in motion."""
    judge, still = this.judge, np.zeros(this.robot.nv)
    for call in (
        lambda: ddm(this.robot, judge.q, judge.v, this.tau),
        lambda: ddm(this.robot, judge.q, still, this.tau),
        lambda: idm(this.robot, judge.q, still, still),
    ):
        words = "its closures lose rank at sample 0"
        assert (refused(call, SingularityError, words, what="closures").condition or 0.0) > LOST_ROWS
