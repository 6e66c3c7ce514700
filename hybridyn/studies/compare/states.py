"""Draw closed states of a robot, with motor efforts and the accelerations that follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...dynamics.direct import ddm
from ...dynamics.inverse import idm
from ...errors import HybridynError, ModelError
from ...manifold.manifold import Manifold
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..home import homes

#: Most freedoms of the tree: closure rows of the whole robot are held as one matrix.
MOST_FREEDOMS = 2000
#: How far states lie from home, in the units of the freedoms (a radian, a module's length).
STEP = 0.2
#: Draws for each state before the comparison gives up.
DRAWS = 20
#: Random starts of the search for a closed posture, where home is open.
STARTS = 20
#: Relative singular value below which closure rows count as dependent.
DEPENDENT = 1e-9


@dataclass(frozen=True, eq=False)
class ComparedState:
    """A closed state.

    Attributes:
        q: Positions, shape (nq,).
        v: Rates that keep the loops closed, shape (nv,).
        force: Motor efforts as generalised forces on all joints, shape (nv,).
        tau: The same in the order of the motors, shape (motors,).
        a: Accelerations by hybridyn, shape (nv,).
        K: Closure rows in units of the freedoms, shape (rows, nv).
    """

    q: Array
    v: Array
    force: Array
    tau: Array
    a: Array
    K: Array


def draw_states(robot: HybridRobot, count: int, seed: int) -> list[ComparedState]:
    """Draw states near home.

    Args:
        count: Number of states.
        seed: Seed of the draws.

    Raises:
        ModelError: The robot is too large, its base is moved, or no states with a solution were found.
    """
    if robot.base == "moving":
        raise ModelError("a moving base cannot be compared; take base='fixed' or 'floating'")
    if robot.nv > MOST_FREEDOMS:
        raise ModelError(f"{robot.nv} freedoms of the joints, limit {MOST_FREEDOMS}, are too many to compare")
    rng = np.random.default_rng(seed)
    manifold, home = Manifold(robot), start_posture(robot)
    out: list[ComparedState] = []
    last: HybridynError | None = None
    for _ in range(DRAWS * count):
        try:
            out.append(_draw(robot, manifold, rng, home))
        except HybridynError as error:  # a singular or unreachable draw
            last = error
        if len(out) == count:
            return out
    raise ModelError(f"no {count} closed states were found near home: {last}")


def start_posture(robot: HybridRobot) -> Array:
    """Return the closed posture nearest home, shape (nq,).

    Raises:
        ModelError: No posture closes the robot's loops.
    """
    try:
        return Manifold(robot).project(robot.home, np.zeros(robot.nv))[0]
    except HybridynError:
        found = homes(robot, starts=STARTS).postures
        if not found:
            raise ModelError("no posture closes its loops, so there is no state to compare at") from None
        return found[0].q


def _draw(robot: HybridRobot, manifold: Manifold, rng: np.random.Generator, home: Array) -> ComparedState:
    unit = manifold.unit
    K = closure_rows(robot, home) * unit
    away = _kept(K, rng.normal(size=robot.nv)) * STEP * unit
    if robot.base == "floating":
        away[:6] = rng.normal(size=6) * STEP
    start = manifold.retraction.move(home, away)
    q, v = manifold.project(start, np.zeros(robot.nv))
    K = closure_rows(robot, q) * unit
    v = _kept(K, rng.normal(size=robot.nv)) * unit
    q, v = manifold.project(q, v)
    tau = np.zeros(len(robot.motors))
    force = np.zeros(robot.nv)
    if len(tau):
        wanted = ddm(robot, q, v, tau)
        size = max(1.0, float(np.abs(wanted / unit).max()))
        wanted = wanted + _kept(K, rng.normal(size=robot.nv)) * unit * size
        tau = idm(robot, q, v, wanted, passive="solved", on_singular="least-norm")
        force[robot.motor_v] = tau
    return ComparedState(q, v, force, tau, ddm(robot, q, v, tau), K)


def _kept(K: Array, x: Array) -> Array:
    """Return the part of x that the rows leave free."""
    return x - np.linalg.lstsq(K, K @ x, rcond=DEPENDENT)[0] if len(K) else x


def closure_rows(robot: HybridRobot, q: Array) -> Array:
    """Compute the closure rows of the whole robot, scaled to its modules' lengths, shape (rows, nv)."""
    blocks = []
    for module in robot.modules:
        m = module.mechanism
        if m.spanning_closures.rows:
            motion = m.spanning.sweep(q[None, module.q_index])
            own = m.spanning_closures.matrix(motion)[0] * m.spanning_row_scale[:, None]
            rows = np.zeros((len(own), robot.nv))
            rows[:, module.v_index] = own
            blocks.append(rows)
    return np.vstack(blocks) if blocks else np.zeros((0, robot.nv))


def closure_names(robot: HybridRobot) -> tuple[str, ...]:
    """Return the name of each closure and coupling, in the order of the rows."""
    return tuple(name for module in robot.modules for name in module.closures)


def closure_slices(robot: HybridRobot) -> list[slice]:
    """Return the rows of each closure and coupling in `closure_rows`, in the order of `closure_names`."""
    out, before = list[slice](), 0
    for module in robot.modules:
        own = module.mechanism.spanning_closures
        out += [slice(before + at.start, before + at.stop) for at in own.row_slices]
        before += own.rows
    return out


def apart(robot: HybridRobot, q: Array, v: Array, a: Array) -> list[float]:
    """Compute how fast accelerations open each closure and coupling, in the order of `closure_names`.

    Args:
        q: Positions, shape (nq,).
        v: Rates, shape (nv,).
        a: Accelerations, shape (nv,).

    Returns:
        The largest second derivative of each closure's residuals, over its module's length [1/s^2].
    """
    out: list[float] = []
    for module in robot.modules:
        m = module.mechanism
        closures = m.spanning_closures
        if not closures.rows:
            continue
        qk, vk, ak = q[None, module.q_index], v[None, module.v_index], a[None, module.v_index]
        second = closures.rates(m.spanning.sweep(qk, vk, ak), vk, ak)[1][0] * m.spanning_row_scale
        out += [float(np.abs(second[at]).max()) for at in closures.row_slices]
    return out
