"""What holds to rounding at every state of a mechanism of clear rank: the oracle, Pinocchio's `rnea`, energy.

A refusal is judged too: its reason must be one that the oracle finds.
"""

import numpy as np
import pinocchio as pin

import hybridyn
from hybridyn.structure.building import build_robot
from tests.judges.judging import Wrenches
from tests.robots.generated import Case

EPS = float(np.finfo(float).eps)
CLOSED = 1e-12  # the draws are closed to 1e-12 in metres and cosines
BACKWARD = 1e-12  # of the largest term: both models are backward stable
FORWARD = 1e3 * EPS  # of the condition number: products of some hundred terms on both sides
LOST = 1e-6  # of the largest singular value of the motors' map: below it a refusal is right
States = tuple[np.ndarray, ...]  # positions, rates, efforts and accelerations, shapes (T, ...)
MISSING = 1e-9  # of the largest effort: an effort that no motor can produce, which must be refused above it


def judge(case: Case, states: list[States]) -> None:
    """Compare both models with the oracle at every state."""
    robot = build_robot(case.description, base=case.base)
    assert robot.mobility == case.mobility
    q, v, a, tau = (np.array(x) for x in zip(*states, strict=True))
    assert hybridyn.closure_residual(robot, q).max(initial=0.0) <= CLOSED
    rng = np.random.default_rng([case.seed, 2])
    names = [link.name for link in case.description.links]
    wrenches = {
        str(name): 5 * rng.normal(size=6) for name in rng.choice(names, min(2, len(names)), replace=False)
    }
    given = a[:, :6] if case.base == "moving" else None
    moved = hybridyn.ddm(robot, q, v, tau, base_acceleration=given, wrenches=wrenches)
    judge_direct(case, robot, (q, v, tau, moved), wrenches)
    judge_inverse(case, robot, (q, v, tau, moved), wrenches, needs=False)
    if case.base != "floating":
        judge_inverse(case, robot, (q, v, tau, a), wrenches, needs=True)


def judge_direct(case: Case, robot: hybridyn.HybridRobot, states: States, wrenches: Wrenches) -> None:
    """Compare accelerations with the oracle's; check the loops and the balance of power."""
    oracle = case.oracle
    power = hybridyn.power(robot, *states[:3], wrenches=wrenches)
    data = robot.model.createData()
    for t, (q, v, tau, a) in enumerate(zip(*states, strict=True)):
        wanted = oracle.ddm(q, v, tau, a[:6] if case.base == "moving" else None, wrenches)
        posture = oracle.posture(q)
        size = float(np.abs(wanted / oracle.unit).max(initial=0.0) + natural_acceleration(case, v[None])[0])
        off = np.abs((a - wanted) / oracle.unit).max(initial=0.0)
        assert off <= FORWARD * condition(case, q) * size, f"ddm differs by {off / size:.1e}"
        k = oracle.tree.drifts(posture, v)[2]
        opening = np.abs((posture.K @ a + k) / posture.scale).max(initial=0.0)
        assert opening <= BACKWARD * max(1.0, np.abs(a / oracle.unit).max(initial=0.0) + size), "loops open"
        force = pin.rnea(robot.model, data, q, v, a)
        skip = 6 if case.base == "moving" else 0
        rate = force[skip:] @ v[skip:]
        if not skip:
            terms = np.abs(force * v).sum() + abs(power.wrenches[t]) + abs(power.motors[t])
            # the forces of the loops do no work, up to the rounding of rates that the loops allow
            off = abs(rate - power.motors[t] - power.wrenches[t])
            assert off <= FORWARD * condition(case, q) * max(terms, 1.0), (
                f"power differs by {off / terms:.1e}"
            )


def judge_inverse(
    case: Case, robot: hybridyn.HybridRobot, states: States, wrenches: Wrenches, needs: bool
) -> None:
    """Compare efforts with the oracle's along the motions that the loops allow."""
    oracle, weights, (q, v, led_by, a) = case.oracle, np.ones(len(robot.motors)), states
    answers = [oracle.idm_and_missing(*state, wrenches) for state in zip(q, v, a, strict=True)]
    maps = [oracle.motor_map(oracle.posture(x)) for x in q]
    largest = [
        np.abs(tau).max(initial=0.0) + np.abs(missing).max(initial=0.0) + needed(case, rates, rate)
        for (tau, missing), rates, rate in zip(answers, v, a, strict=True)
    ]
    lacking = [
        np.abs(missing).max(initial=0.0) / size for (_, missing), size in zip(answers, largest, strict=True)
    ]
    refused: hybridyn.HybridynError | None = None
    try:
        tau = hybridyn.idm(robot, q, v, a, wrenches=wrenches, weights=weights)
    except (hybridyn.ActuationError, hybridyn.SingularityError) as error:
        refused = error
    if isinstance(refused, hybridyn.ActuationError):
        assert needs, f"ddm's own accelerations are refused: {refused}"
        assert max(lacking) > BACKWARD, f"nothing is missing: {refused}"
    elif refused:
        assert min(map(clearness, maps)) < LOST, f"no direction is lost: {refused}"
    if refused:
        return
    assert max(lacking, default=0.0) <= MISSING, "efforts that no motor can produce were not refused"
    given = tau if needs else led_by  # the efforts that led to these accelerations
    for B, (wanted, _), got, led, size in zip(maps, answers, tau, given, largest, strict=True):
        for efforts in (got, led):
            off = np.abs(B @ (efforts - wanted)).max(initial=0.0)
            assert off <= BACKWARD * size * 10, f"idm differs by {off / size:.1e}"


def clearness(B: np.ndarray) -> float:
    """Return the least singular value of a motors' map, relative to the largest; 1 for none."""
    s = np.linalg.svd(B, compute_uv=False) if B.size else np.ones(1)
    return float(s[-1] / max(s[0], EPS))


def natural_acceleration(case: Case, v: np.ndarray) -> np.ndarray:
    """Return the size of scaled accelerations by gravity and rates v, (T, nv); shape (T,)."""
    rates: np.ndarray = np.abs(v / case.oracle.unit).max(axis=1, initial=0.0) ** 2
    return rates + 9.81 / case.oracle.tree.length


def needed(case: Case, v: np.ndarray, a: np.ndarray) -> float:
    """Return the size of the forces of weights and motion [N or N m, scaled]."""
    bodies, length = case.oracle.bodies, case.oracle.tree.length
    mass = bodies.mass * length + bodies.inertia / length
    size = np.abs(a / case.oracle.unit).max(initial=0.0) + natural_acceleration(case, v[None])[0]
    return float(mass * max(length, 1.0) * size * length)


def condition(case: Case, q: np.ndarray) -> float:
    """Return the condition number of the direct model: of the closure rows times that of the inertia."""
    oracle, posture = case.oracle, case.oracle.posture(q)
    inverse = posture.factor.inverse
    rows = float(np.abs(inverse).max(initial=1.0)) * max(
        1.0, 1 / float(np.abs(inverse[inverse > 0]).min(initial=1.0))
    )
    C = oracle.bodies.inertia_root(posture, oracle.unit[:, None] * posture.Z)
    s = np.linalg.svd(C, compute_uv=False) if C.size else np.ones(1)
    return rows * rows * float(s[0] / s[-1]) ** 2
