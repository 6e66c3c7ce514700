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

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from extended_judge import EPS, Judge
from posing import of_link
from singular_postures import PLACES, posture

from hybridyn import HybridRobot, SingularityError, assemble, ddm, idm
from hybridyn.robot import build_robot

if TYPE_CHECKING:
    from conftest import Claim

BACKWARD = 1e-13
FORWARD = 100 * EPS
DISTANCES = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 0.0]
FEW = {
    "": {1e-3, 1e-6, 1e-9, 1e-12, 0.0},
    "gough_stewart": {1e-8, 0.0},
    "delta": {1e-3, 1e-8, 0.0},
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


def cases(places: list[str]) -> list[object]:
    """Give every place at every distance, most of them for the long run."""
    out = []
    for place in places:
        few = FEW.get(place.split()[0], FEW[""])
        for d in STACKED if place.startswith("lx4") else DISTANCES:
            marks = [] if d in few else [pytest.mark.slow]
            out.append(pytest.param(place, d, 0, marks=marks, id=f"{place}-{d:.0e}"))
            out.append(pytest.param(place, d, 1, marks=[pytest.mark.slow], id=f"{place}-{d:.0e}-again"))
    return out


@pytest.mark.parametrize(("place", "distance", "seed"), cases(list(PLACES)))
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
    assert refusal.condition is not None
    assert refusal.condition > 1 / LOST_MOTORS
    tau = idm(this.robot, *state, on_singular="least-norm")
    errors = judge.of_idm(a, tau, this.tau, dropped=this.dropped)
    claim(this.name, "backward error of least-norm idm", errors.backward, this.backward + this.reciprocal)
    bound = (FORWARD + this.reciprocal) * errors.condition
    claim(this.name, "forward error of least-norm idm", errors.forward, bound)


def outcome(call: Callable[[], np.ndarray]) -> tuple[np.ndarray, None] | tuple[None, SingularityError]:
    """Give what a model answers, or why it refuses."""
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
        with pytest.raises(SingularityError, match="its closures lose rank at sample 0") as caught:
            call()
        assert caught.value.what == "closures"
        assert caught.value.condition is not None
        assert caught.value.condition > LOST_ROWS


# ------------------------------------------------------------------ no digit left


@pytest.mark.parametrize("place", ["five_bar constraint", "rps3 constraint"])
@pytest.mark.parametrize("answer", ["raise", "least-norm"])
def test_no_digit_is_left(place: str, answer: str) -> None:
    """A motion across a constraint singularity at full speed: accelerations of 1e12, closure forces of 1e24.

    The efforts are less than the rounding of what they are the sum of: 1e-16 of 1e24. That is said, whatever
    the caller asked for motors that lose a direction.
    """
    description, q = posture(place, 1e-12)
    judge = Judge(description, q)
    robot, tau = build_robot(description), np.ones(len(description.motors))
    a = judge.accelerations(tau).astype(float)
    with pytest.raises(SingularityError, match="no digit of its efforts is left at sample 0") as caught:
        idm(robot, q, judge.v, a, on_singular=answer)
    assert caught.value.what == "closures"


@pytest.mark.parametrize("distance", [1e-7, 1e-11])
def test_a_robot_at_rest_keeps_its_digits(distance: float, claim: Claim) -> None:
    """Lying flat, weight across the plane: efforts are zero, and rounding next to the weight is no loss."""
    description, q = posture("five_bar constraint", distance)
    robot = build_robot(description, gravity=(0.0, 9.81, 0.0))
    still = np.zeros(robot.nv)
    tau = idm(robot, q, still, still)
    claim(f"five_bar flat, {distance:.0e}, weight across", "effort [N m]", np.abs(tau).max(), 1e-12)


# ------------------------------------------------------------------ assembly at serial singularities

OUTPUTS = {
    "five_bar": ("m1_tool", "xz"),
    "delta": ("m1_platform", "xyz"),
    "gough_stewart": ("m1_platform", ""),
}


@pytest.mark.parametrize(
    "place", ["five_bar serial", "delta serial", "gough_stewart serial", "gough_stewart leg"]
)
def test_a_platform_motion_cannot_be_followed_where_a_leg_is_singular(place: str) -> None:
    """At the singularity `assemble` says so; the posture at rest is fine, and so are motors in its place."""
    description, q = posture(place, 0.0)
    robot = build_robot(description)
    link, axes = OUTPUTS[place.split()[0]]
    pose = link_pose(robot, q, link)
    rate = np.array([0.3, 0.0, -0.2, 0.0, 0.0, 0.0])
    given: tuple[object, object] = (pose, rate)
    if axes:
        given = tuple({x: float(part["xyz".index(x)]) for x in axes} for part in (pose, rate))
    with pytest.raises(
        SingularityError, match=r"the rates given at sample 0 cannot be followed.*serial"
    ) as caught:
        assemble(robot, platforms={link: given}, guess=q)
    assert caught.value.what == "legs"
    assert caught.value.condition is not None
    assert caught.value.condition > 1 / LOST_MOTORS
    at_rest = assemble(robot, platforms={link: given[:1]}, guess=q)
    assert np.isfinite(np.concatenate(at_rest)).all()
    assert not at_rest[1].any()


@pytest.mark.parametrize(
    ("place", "lost", "words"),
    [
        ("five_bar parallel", "motors", "parallel singularity: the motors lose a direction"),
        ("four_bar constraint", "closures", "constraint singularity: the closures lose rank"),
    ],
)
def test_motors_that_lose_a_direction_do_not_tell_a_motion(place: str, lost: str, words: str) -> None:
    """At a parallel or a constraint singularity `assemble` from motors' rates fails in the same words."""
    description, q = posture(place, 0.0)
    robot = build_robot(description)
    at = [robot.v_slices[robot.joints.index(motor)].start for motor in robot.motors]
    motors = {motor: (q[i], 1.0, 0.0) for motor, i in zip(robot.motors, at, strict=True)}
    with pytest.raises(SingularityError, match=f"cannot be followed.*{words}") as caught:
        assemble(robot, motors=motors, guess=q)
    assert caught.value.what == lost


def link_pose(robot: HybridRobot, q: np.ndarray, link: str) -> np.ndarray:
    """Give a link's pose in the base, shape (7,)."""
    still = np.zeros((1, robot.nv))
    return of_link(robot, q[None], still, still, link, robot.description.root)[0][0]


# ------------------------------------------------------------------ one singular sample among others


@pytest.mark.parametrize(
    "place", ["five_bar parallel", "rps3 parallel", "rps3 serial", "five_bar constraint"]
)
def test_a_singular_sample_leaves_its_neighbours_alone(place: str) -> None:
    """The sample is named, and the others have the same bits as without it."""
    description = posture(place, 0.0)[0]
    robot = build_robot(description)
    q = np.array([posture(place, d)[1] for d in (0.1, 0.0, 0.05)])
    rest, tau = np.zeros((3, robot.nv)), np.ones((3, len(robot.motors)))
    with pytest.raises(SingularityError, match="at sample 1") as caught:
        idm(robot, q, rest, rest)
    assert caught.value.sample == 1
    whole = idm(robot, q, rest, rest, on_singular="least-norm")
    assert np.isfinite(whole).all()
    assert np.array_equal(whole[[0, 2]], idm(robot, q[[0, 2]], rest[:2], rest[:2]))
    if "constraint" in place:
        with pytest.raises(SingularityError, match="at sample 1"):
            ddm(robot, q, rest, tau)
    else:
        whole = ddm(robot, q, rest, tau)
        assert np.array_equal(whole[[0, 2]], ddm(robot, q[[0, 2]], rest[:2], tau[:2]))


# ------------------------------------------------------------------ motors' accelerations alone


@pytest.mark.parametrize("distance", [1e-2, 1e-9, 1e-12, 0.0])
@pytest.mark.parametrize("place", ["five_bar parallel", "rps3 parallel", "five_bar serial"])
def test_accelerations_of_the_motors_alone(place: str, distance: float, claim: Claim) -> None:
    """With passive="solved" the motors' map is solved twice: for the motion, and for the efforts.

    Its condition number counts squared, and that is refused from 1e10 on, whatever is asked for motors that
    lose a direction: without all accelerations the motion there is not known.
    """
    this = case(place, distance, 0)
    judge = this.judge
    a = judge.accelerations(this.tau).astype(float)

    def solve(answer: str) -> np.ndarray:
        return idm(this.robot, judge.q, judge.v, a, passive="solved", on_singular=answer)

    if this.reciprocal > 1e-4:
        errors = judge.of_idm(a, solve("raise"), this.tau)
        bound = FORWARD * errors.condition / this.reciprocal
        claim(this.name, "forward error of idm, passive solved", errors.forward, bound)
        return
    for answer in ("raise", "least-norm"):
        with pytest.raises(SingularityError, match="accelerations alone do not tell the motion") as caught:
            solve(answer)
        assert caught.value.what == "motors"
        assert caught.value.condition is not None
        assert caught.value.condition > 1e10
