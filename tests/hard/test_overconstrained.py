"""Loops with redundant rows: what is unique is right, what is not is said to be so and least in norm.

Planar loops closed by revolutes in 3-D, a parallelogram with a third bar, Bennett's, Bricard's and Sarrus'
linkages, each with its motion in closed form (`redundant_loops.py`, `one_freedom.py`), askew in the world.

Bounds: closed forms and the recursion both round some hundred operations, and the loops' own condition is
below 20, so 1e-13 relative for efforts, and 1e-12 for accelerations and wrenches, which are solved with the
inertia and the rows. A simulation adds up the errors of some fifty steps of rtol each.
"""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from tests import ROOT
from tests.hard.claims import Claim
from tests.hard.one_freedom import OneFreedom, slope_error
from tests.hard.redundant_loops import LINKAGES, Linkage, bricard_law, four_bar, loaded

EFFORT, SOLVED = 1e-13, 1e-12
CLOSED_FORM = 1e-14  # the closed forms close the loops and are differentiated to rounding
RTOL, ADDED_UP = 1e-9, 50.0
MOTION = (0.7, -1.3)  # s_dot, s_ddot
SAMPLES = (-0.15, 0.0, 0.15)  # about each linkage's own posture


def case_of(name: str, folder: Path) -> tuple[hybridyn.HybridRobot, OneFreedom, Linkage, str]:
    """Return a linkage's robot, its closed form, its facts and its motor."""
    if name != "bricard":
        linkage = LINKAGES[name]()
        robot = loaded(folder, linkage)
        return robot, OneFreedom(robot, linkage.law), linkage, "drive"
    robot = hybridyn.load(str(ROOT / "urdf" / "benchmarks" / "bricard.urdf.xacro"), gravity=(1.5, -4.0, -8.5))
    return robot, OneFreedom(robot, bricard_law), Linkage("", bricard_law, 1, 1.2, ("hinge5",)), "hinge0"


@pytest.fixture(params=[*LINKAGES, "bricard"])
def case(
    request: pytest.FixtureRequest, tmp_path: Path
) -> tuple[str, hybridyn.HybridRobot, OneFreedom, Linkage, str]:
    """Every linkage."""
    return (str(request.param), *case_of(request.param, tmp_path))


Case = tuple[str, hybridyn.HybridRobot, OneFreedom, Linkage, str]


def states(exact: OneFreedom, linkage: Linkage) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, rates and accelerations at all samples."""
    each = [exact.state(linkage.s + ds, *MOTION) for ds in SAMPLES]
    q, v, a = (np.array(x) for x in zip(*each, strict=True))
    return q, v, a


def test_mobility(claim: Claim, case: Case) -> None:
    """One freedom, which no count of rows finds; the rows left over are counted, across a clear gap."""
    name, robot, exact, linkage, _ = case
    assert robot.mobility == 1
    reports = [m.mechanism.reduction.report for m in robot.modules if m.closures]
    assert sum(r.rows - r.rank for r in reports) == linkage.spare
    claim(name, "dependent rows' singular value", max(r.dropped for r in reports), CLOSED_FORM)
    claim(name, "slope of the closed form", slope_error(exact, linkage.s), CLOSED_FORM)
    q, *_ = states(exact, linkage)
    claim(name, "closed form's residual", hybridyn.closure_residual(robot, q).max(), CLOSED_FORM)


def test_the_motors_effort_is_unique_and_right(claim: Claim, case: Case) -> None:
    name, robot, exact, linkage, motor = case
    q, v, a = states(exact, linkage)
    tau = hybridyn.idm(robot, q, v, a)[:, 0]
    wanted = np.array([exact.effort(linkage.s + ds, *MOTION, motor) for ds in SAMPLES])
    claim(name, "effort of idm", np.abs(tau - wanted).max() / np.abs(wanted).max(), EFFORT)
    back = hybridyn.ddm(robot, q, v, wanted[:, None])
    claim(name, "acceleration of ddm", np.abs(back - a).max() / np.abs(a).max(), SOLVED)


def test_the_motion_is_unique_and_right(claim: Claim, case: Case) -> None:
    """Let go: the linkage moves as its one equation says, by steps and by the assembly of its motor alone."""
    name, robot, exact, linkage, motor = case
    q, v, _ = exact.state(linkage.s, 0.5)
    times = np.linspace(0, 0.25, 6)
    result = hybridyn.simulate(robot, q, v, times, rtol=RTOL, atol=RTOL / 10)
    assert result.status == "finished"
    wanted = np.array([exact.state(*x)[0] for x in exact.motion(linkage.s, 0.5, times)])
    claim(name, "motion after 0.25 s", np.abs(result.q - wanted).max(), ADDED_UP * RTOL)
    at, rate, bend = (x[list(robot.joints).index(motor)] for x in exact.state(linkage.s, *MOTION))
    q, v, a = hybridyn.assemble(robot, motors={motor: (at, rate, bend)}, guess=result.q[0])
    for what, x, y in zip(
        ("positions", "rates", "accelerations"), (q, v, a), exact.state(linkage.s, *MOTION), strict=True
    ):
        claim(name, f"{what} from the motor's", np.abs(x - y).max() / np.abs(y).max(), SOLVED)


def wrench_map(robot: hybridyn.HybridRobot, q: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Return what unit wrenches in the closures do on the tree, shape (nv, 6 closures), by Pinocchio alone.

    As `Reactions` gives them: in the predecessor's axes as written, at the successor's origin.
    """
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    parts = []
    for closure in robot.description.closures:
        ends = []
        for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
            body = model.frames[model.getFrameId(link, pin.BODY)]
            ends.append((body.parentJoint, data.oMf[model.getFrameId(link, pin.BODY)] * pin.SE3(frame)))
        at = pin.SE3(ends[0][1].rotation @ closure.turn.T, ends[1][1].translation)
        rates = [
            pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.WORLD)
            if joint
            else np.zeros((6, model.nv))
            for joint, _ in ends
        ]
        parts.append((at.actionInverse @ (rates[1] - rates[0])).T)
    return np.hstack(parts), [closure.name for closure in robot.description.closures]


def test_closure_wrenches_are_least_and_said_not_to_be_unique(claim: Claim, case: Case) -> None:
    """They balance the tree, and every change of them that does not disturb it would make them longer.

    `determined` names exactly the components that no such change touches.
    """
    name, robot, exact, linkage, motor = case
    q, v, a = (x[1] for x in states(exact, linkage))
    tau, reactions = hybridyn.idm(robot, q, v, a, reactions=True)
    W, closures = wrench_map(robot, q)
    assert not any(reactions.unique[c] for c in closures)
    wrench = np.concatenate([reactions.closures[c] for c in closures])
    needed = pin.rnea(robot.model, robot.model.createData(), q, v, a)
    needed[list(robot.joints).index(motor)] -= tau[0]
    claim(name, "closures balance the tree", np.abs(W @ wrench - needed).max() / np.abs(wrench).max(), SOLVED)
    length = next(m.mechanism.length for m in robot.modules if m.closures)
    scale = np.tile([length] * 3 + [1.0] * 3, len(closures))
    free = np.tile([1.0, 1, 1, 1, 1, 0], len(closures))  # a revolute passes no moment about its axis
    assert all(c.rotation == "parallel" for c in robot.description.closures)
    to_author = np.kron(np.eye(2 * len(closures)), np.eye(3))  # from the axes in which z is the hinge's
    for i, c in enumerate(robot.description.closures):
        to_author[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = np.kron(np.eye(2), c.turn)
    rows = (W @ to_author)[:, free > 0] / scale[free > 0]
    idle = np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows, tol=1e-9) :].T
    assert idle.shape[1] >= linkage.spare
    scaled = (to_author.T @ (wrench * scale))[free > 0]
    claim(
        name,
        "part of the wrenches that does nothing",
        np.abs(idle.T @ scaled).max() / np.abs(scaled).max(),
        SOLVED,
    )
    touched = np.abs(to_author[:, free > 0] @ idle).max(axis=1) > 1e-6
    said = np.concatenate([reactions.determined[c] for c in closures])
    assert (said == ~touched).all()
    assert touched.any()


def test_what_is_determined_does_not_depend_on_how_the_loop_is_written(claim: Claim, tmp_path: Path) -> None:
    """A planar loop closed by two rows has unique wrenches; those that five rows share are the same."""
    kinds = ("revolute", 'rows" rows="tx ty')
    found = []
    for i, kind in enumerate(kinds):
        linkage = four_bar(kind)
        folder = tmp_path / str(i)
        folder.mkdir()
        robot = loaded(folder, linkage)
        q, v, a = OneFreedom(robot, linkage.law).state(linkage.s, *MOTION)
        found.append(hybridyn.idm(robot, q, v, a, reactions=True))
    (tau, many), (tau_few, few) = found
    assert many.determined["pin"].tolist() == [True, True, False, False, False, True]
    assert few.unique["pin"]
    off = np.abs(many.closures["pin"][:2] - few.closures["pin"][:2]).max()
    claim(
        "four-bar",
        "forces in the plane, five rows against two",
        off / np.abs(few.closures["pin"]).max(),
        SOLVED,
    )
    claim("four-bar", "effort, five rows against two", abs(tau[0] / tau_few[0] - 1), EFFORT)
