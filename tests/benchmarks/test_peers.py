"""The direct model against Pinocchio's `constraintDynamics`.

It knows rigid closures at points and welds. Written exactly so are

- all closures of gough_stewart, lx4, rps3, delta, tanev, stewart_ur5, scara_delta and snake (balls), and of
  the random mechanisms of `EXACT` (balls and welds);
- the hinge that closes the planar five-bar, as a point: its motions are the same, since the plane already
  keeps the axes parallel, with one row too many (out of the plane), which `mu` has to carry. Two rows in the
  plane, which would have full rank, it cannot say.

Closures by hinges, slides, universal joints, planes or single rows in space are other mechanisms as points or
as welds; they are judged by the oracle alone. So are mechanisms whose tree ends in massless links that a weld
holds: Pinocchio gives NaN there at any `mu`.
"""

from dataclasses import replace

import numpy as np
import pytest

from hybridyn import ddm
from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.judges.judging import drawn, efforts
from tests.judges.peers import Peer
from tests.robots.shipped import ROBOTS, shipped, states_near_home

PROXIMAL = 1e-9  # what constraintDynamics reaches at its best mu on robots of condition 1e4
MU = 10.0 ** np.arange(-12, -1)
AGREEING = 3  # values of mu, neighbours, that must all give our answer: not one lucky point
EXACT = [
    "serial",
    "serial_all",
    "loop_spherical",
    "loop_fixed",
    "four_bar_point",
    "rssr",
    "gough_points",
    "delta_rods",
]


def at_points(description: Description) -> Description:
    """Write the hinge of the planar five-bar as a point."""
    if description.name != "five_bar":
        return description
    (hinge,) = description.closures
    return replace(description, closures=(replace(hinge, kind="spherical", rotation="free"),))


def swept(description: Description, q: np.ndarray, v: np.ndarray, tau: np.ndarray, ours: np.ndarray) -> None:
    """Compare with constraintDynamics over mu."""
    peer = Peer(description)
    for state, a in zip(zip(q, v, tau, strict=True), ours, strict=True):
        scale = np.abs(a).max()
        errors = [np.abs(peer.constraint_dynamics(*state, mu=mu) - a).max() / scale for mu in MU]
        good = [error < PROXIMAL for error in errors]
        runs = "".join("x" if ok else " " for ok in good).split()
        assert max(map(len, runs), default=0) >= AGREEING, dict(zip(MU, errors, strict=True))


@pytest.mark.parametrize("name", ROBOTS)
def test_shipped_robots_against_constraint_dynamics(name: str) -> None:
    description = shipped(name)
    q, v, _ = states_near_home(description, "fixed", 11, 1 if name == "snake" else 2)
    tau = efforts(description, len(q))
    swept(at_points(description), q, v, tau, ddm(build_robot(description), q, v, tau))


@pytest.mark.parametrize("kind", EXACT)
def test_random_mechanisms_against_constraint_dynamics(kind: str) -> None:
    description, _, (q, v, _) = drawn(kind, "fixed")
    assert {c.kind for c in description.closures} <= {"spherical", "fixed"}
    tau = efforts(description, len(q))
    swept(description, q, v, tau, ddm(build_robot(description), q, v, tau))
