"""The ball that carries a platform, described by three hinges, in gimbal lock: the file alone is singular.

The robot is not. Claims, at every distance from the lock and in it, against a twin of the robot whose ball
is one `spherical` joint, in fifty digits: ddm's accelerations of the legs have a forward error of at most 100
eps times the twin's condition number, and idm gives back the efforts to as much. The rates of the hinges
themselves grow as 1 / distance; in the lock they are the least-norm ones, and cannot tell the platform's.
"""

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hybridyn import ddm, idm
from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.hard.claims import FORWARD, Claim
from tests.hard.closed_forms import about, balls, gough_stewart, numbers, placement, vector
from tests.hard.extended_judge import Judge, mp, norm
from tests.oracle import Oracle
from tests.robots.shipped import shipped
from tests.support.samples import slow

WRIST = "m1_leg1_wrist"
LOCKED = 1e-9  # gimbal_lock.GIMBAL_LOCK: nearer, the hinges' rates are the least-norm ones
DISTANCES = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 0.0]
FEW = {0.0}


def twin(description: Description) -> Description:
    """Return the robot with its ball as one joint."""
    hinges = {
        f"{WRIST}_{axis}": next(j for j in description.joints if j.name == f"{WRIST}_{axis}")
        for axis in "yxz"
    }
    ball = replace(hinges[f"{WRIST}_y"], name=WRIST, kind="spherical", child=hinges[f"{WRIST}_z"].child)
    joints = tuple(
        ball if j.name == f"{WRIST}_y" else j for j in description.joints if j.name not in list(hinges)[1:]
    )
    between = {hinges[f"{WRIST}_{axis}"].child for axis in "yx"}
    links = tuple(link for link in description.links if link.name not in between)
    home = {name: q for name, q in description.home.items() if name not in hinges}
    return replace(description, joints=joints, links=links, home=home | {WRIST: (0.0, 0.0, 0.0, 1.0)})


def posture(description: Description, d: float) -> tuple[np.ndarray, np.ndarray, Any]:
    """Return q of the robot and of its twin with the middle hinge pi/2 - d, and the ball's rotation."""
    Rh, ph = placement(description, "m1_leg1_cross_y")
    rod = Rh @ about(1, mp.mpf("0.2")) @ about(0, mp.mpf("-0.1"))
    angles = mp.mpf("0.4"), mp.pi / 2 - mp.mpf(d), mp.mpf("0.3")
    turns = [about(axis, angle) for axis, angle in zip((1, 0, 2), angles, strict=True)]
    ball = turns[0] @ turns[1] @ turns[2]
    R = rod @ placement(description, f"{WRIST}_y")[0] @ ball @ placement(description, f"{WRIST}_mount")[0]
    tip = ph + rod @ numbers([0.0, 0.0, 0.75])
    values = gough_stewart(description, R, tip - R @ balls(description, WRIST)["m1_leg1_rod"])
    values |= {f"{WRIST}_{axis}": angle for axis, angle in zip("yxz", angles, strict=True)}
    q = vector(description, values)
    other = twin(description)
    coordinates = Oracle(other).coordinates
    q_twin = np.zeros(Oracle(other).nq)
    for name, (kind, at, _) in coordinates.items():
        q_twin[at] = quaternion(ball) if kind == "spherical" else float(values[name])
    S = np.array([(turns[1] @ turns[2])[1], turns[2][0], numbers([0, 0, 1])]).T.astype(float)
    return q, q_twin, S


def quaternion(R: Any) -> list[float]:
    """Return x, y, z, w of a rotation by no more than a half turn, in fifty digits."""
    w = mp.sqrt(1 + R[0, 0] + R[1, 1] + R[2, 2]) / 2
    return [float(x / (4 * w)) for x in (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])] + [
        float(w)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("distance", [d if d in FEW else slow(d) for d in DISTANCES])
def test_a_carrying_ball_in_gimbal_lock(
    distance: float, claim: Claim, caplog: pytest.LogCaptureFixture
) -> None:
    description = shipped("gough_stewart")
    q, q_twin, S = posture(description, distance)
    judge = Judge(twin(description), q_twin)
    tau = 10 * np.random.default_rng(1).normal(size=6)
    exact = judge.accelerations(tau)
    here, there = Oracle(description), judge.oracle
    legs = [x for x in here.coordinates if x in there.coordinates]
    mine = [here.coordinates[x][2].start for x in legs]
    its = [there.coordinates[x][2].start for x in legs]
    hinges = [here.coordinates[f"{WRIST}_{axis}"][2].start for axis in "yxz"]
    v = np.zeros(here.nv)
    v[mine] = judge.v[its]
    v[hinges] = np.linalg.pinv(S, rcond=LOCKED) @ judge.v[there.coordinates[WRIST][2]]
    robot = build_robot(description)
    with caplog.at_level(logging.ERROR, logger="hybridyn"):  # that the wrist is locked is no news here
        a = ddm(robot, q, v, tau)
        back = idm(robot, q, v, a)
    case = f"gough_stewart, ball {distance:.0e} from gimbal lock"
    errors = judge.of_ddm(tau, exact.astype(float), exact)
    unit = there.unit[its].astype(float)
    wrong = norm((a[mine] - exact[its]) / unit) / norm(exact / there.unit)
    claim(case, "forward error of ddm", wrong, FORWARD * errors.condition)
    round_trip = judge.of_idm(exact.astype(float), tau, tau)
    bound = FORWARD * (round_trip.condition + errors.condition)
    claim(case, "idm after ddm", norm(back - tau) / norm(tau), bound)
