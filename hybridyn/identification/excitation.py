"""Exciting motions: finite Fourier series of the motors that tell as much of the parameters as limits allow.

    q(t) = q_home + sum_k a_k sin(k w t) + b_k (cos(k w t) - 1),   sum_k k a_k = 0,   sum_k k^2 b_k = 0

so that the motion starts and ends at rest at home, without acceleration, and can be repeated without a seam
(Swevers et al. 1997). What is maximised is log det Y^T Y of the base parameters (D-optimality), by an
evolution strategy: of all candidates, only those count that stay within the limits.
"""

import os
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ..compiled import CompiledRobot
from ..dynamics.forward import forward
from ..effects.choice import Choice
from ..errors import HybridynError, ModelError
from ..spatial import Array
from ..streams.departures import departures, position_limits
from ..structure.robot import HybridRobot, joint_position
from ..tables.results import open_results
from ..threads import one_thread
from .base_parameters import base_parameters
from .losses import sought_losses
from .regressor import motions_of_motors
from .rows import LogSource, check_robot
from .signals import Triple, fourier
from .sought import linear_model

#: Samples of a period for each harmonic: the limits are checked there while searching, and finer at the end.
COARSE, FINE = 30, 60
#: Part of its room that a motor of the first candidate uses, and its room without limits [rad, sizes].
FIRST, ROOM = 0.3, 1.0
#: Factor of a candidate beyond the limits, and how often it is tried.
SMALLER, TRIES = 0.7, 12
#: Part of the limits that the search stays within, since it looks at few samples.
INSIDE = 0.97
#: Change of the steps after a success and after a failure: one success in five keeps them (Rechenberg).
GROWS, SHRINKS = 1.5, 0.904

#: Information, condition and gain of a motion.
Measures = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Excitation:
    """A motion that excites the parameters.

    Attributes:
        robot: The robot.
        period: Period [s].
        sine: a_k of each motor, shape (harmonics, motors), [m or rad].
        cosine: b_k of each motor, of the same shape.
        home: Positions at the start, shape (motors,).
        information: log det Y^T Y of a period, in parameters of like influence.
        condition: Condition number of Y with scaled columns.
        gain: Largest growth of the joints' rates over those of the motors, compared with home.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> motion = hybridyn.excitation(robot, evaluations=1)
        >>> import numpy as np
        >>> position, rate, acceleration = motion.at(np.array([0.0, 0.5]))
        >>> position.shape
        (2, 2)
    """

    robot: HybridRobot
    period: float
    sine: Array
    cosine: Array
    home: Array
    information: float
    condition: float
    gain: float

    def at(self, time: Array) -> Triple:
        """Compute positions, velocities and accelerations of the motors, shape (T, motors) each."""
        return fourier(self.home - self.cosine.sum(axis=0), self.cosine, self.sine, self.period, time)

    def columns(self, *, rate: float = 200.0, periods: int = 1) -> dict[str, Array]:
        """Return a table as columns: time, and position, velocity and acceleration of every motor.

        Args:
            rate: Samples per second [Hz].
            periods: How often the motion is repeated.
        """
        time = np.arange(round(periods * self.period * rate) + 1) / rate
        x, x_dot, x_ddot = self.at(time)
        out = {"time": time}
        for i, motor in enumerate(self.robot.motors):
            out[f"{motor}/position"], out[f"{motor}/velocity"] = x[:, i], x_dot[:, i]
            out[f"{motor}/acceleration"] = x_ddot[:, i]
        return out

    def write(self, path: str | os.PathLike[str], *, rate: float = 200.0, periods: int = 1) -> None:
        """Write the motion as a table (.csv or .parquet) that `idm`, `view` and a robot can play.

        Args:
            path: The file.
            rate: Samples per second [Hz].
            periods: How often the motion is repeated.
        """
        table = self.columns(rate=rate, periods=periods)
        with open_results(os.fspath(path), list(table)) as write:
            write(np.column_stack(list(table.values())))


@one_thread()
def excitation(
    robot: HybridRobot, *, effects: Choice = "model", symmetric: bool = False, period: float = 10.0,
    harmonics: int = 5, gain: float = 3.0, evaluations: int = 50, seed: int = 0,
    compiled: CompiledRobot | None = None,
) -> Excitation:  # fmt: skip
    """Compute a motion of the motors from which `identify` learns much.

    The motion starts at home. It respects the limits of positions, speeds and efforts of all joints in the
    robot's file (efforts by the file's numbers), closes the loops, and stays away from singular postures.

    Args:
        robot: The robot.
        effects: As in `identify`, like the next.
        symmetric: Whether equal legs share parameters.
        period: Period [s].
        harmonics: Number of harmonics of each motor; at least three.
        gain: How many times more than at home the joints may move per motion of the motors: towards a
            singular posture this grows beyond all bounds.
        evaluations: Number of candidates.
        seed: Seed of the search.
        compiled: The robot's compiled models, which close loops faster.

    Raises:
        ModelError: There are too few harmonics, no motion is within the limits, or the robot's base is
            not fixed.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> motion = hybridyn.excitation(robot, evaluations=1)
        >>> sorted(motion.columns(rate=100.0))[:3]
        ['m1_left_drive/acceleration', 'm1_left_drive/position', 'm1_left_drive/velocity']
    """
    if harmonics < 3 or not period > 0 or evaluations < 1:
        raise ModelError("an excitation needs a period, at least three harmonics and at least one candidate")
    check_robot(robot)
    linear, _ = sought_losses(robot, effects)
    sought = linear_model(base_parameters(robot, effects=linear, symmetric=symmetric))
    search = _ExcitationSearch(LogSource(robot, sought, compiled, every=1), period, gain)
    best = _best(search, harmonics, evaluations, seed)
    measures, best_one = search.within(best, each=FINE)
    return Excitation(robot, period, *search.judged(best_one), search.home, *measures)


class _ExcitationSearch:
    """What candidates are judged by.

    Attributes:
        source: How motions become rows.
        period: Period [s].
        gain: How many times more than at home the joints may move per motion of the motors.
        scale: Unit of each base parameter, shape (rank,).
        home: Positions of the motors at home, shape (motors,).
        room: How far each motor may move from home, shape (motors,).
        of_home: Motion of the joints per motion of the motors at home.
    """

    def __init__(self, source: LogSource, period: float, gain: float) -> None:
        robot = source.robot
        self.source, self.period, self.gain = source, period, gain
        self.scale = source.sought.model.unit[source.sought.model.columns]
        self.home = np.array([float(joint_position(robot, robot.home, name)) for name in robot.motors])
        room = []
        for name, x in zip(robot.motors, self.home, strict=True):
            joint = robot.records[name]
            free = ROOM * (robot.bodies.size if joint.kind.slides else 1.0)
            limited = not joint.kind.endless and joint.lower < joint.upper
            room.append(min(free, max(joint.upper - x, x - joint.lower)) if limited else free)
        self.room, self.of_home = np.array(room), _growth(robot, robot.home[None])

    def judged(self, coefficients: Array) -> tuple[Array, Array]:
        """Return a_k and b_k of a motion that starts at rest, from any, shape (2, harmonics, motors)."""
        k = np.arange(1.0, coefficients.shape[1] + 1)
        a, b = (
            x - np.outer(w, w @ x) / (w @ w)
            for w, x in zip((k, k**2), coefficients, strict=True)
        )  # fmt: skip
        return a, b

    def within(self, coefficients: Array, tries: int = TRIES, each: int = COARSE) -> tuple[Measures, Array]:
        """Make a candidate smaller until it is within the limits; return its measures and itself.

        Raises:
            ModelError: It never is.
        """
        for _ in range(tries):
            a, b = self.judged(coefficients)
            try:
                return self.measures(a, b, each), coefficients
            except HybridynError as error:
                wrong = error
            coefficients = coefficients * SMALLER
        raise ModelError(f"no motion around home is within the limits: {wrong}")

    def measures(self, a: Array, b: Array, each: int) -> Measures:
        """Compute information, condition and gain of a motion.

        Raises:
            AssemblyError: The loops do not close.
            SingularityError: A posture is singular.
            ModelError: The motion is beyond a limit.
        """
        robot = self.source.robot
        count = each * len(a)
        motion = fourier(self.home - b.sum(axis=0), b, a, self.period, np.arange(count) * self.period / count)
        for name, x, x_dot in zip(
            robot.motors, motion[0].T, motion[1].T, strict=True
        ):  # before loops are closed
            joint, limits = robot.records[name], position_limits(robot.records[name])
            if np.abs(x_dot).max() > joint.speed_limit or (
                limits and not limits[0] <= x.min() <= x.max() <= limits[1]
            ):
                raise ModelError(f"'{name}' leaves its limits")
        q, v, acceleration = self.source.closed(motion, robot.home)
        Y, _, efforts = self.source.of_states(q, v, acceleration)
        part = INSIDE if each == COARSE else 1.0
        if beyond := departures(robot, q, v / part, efforts / part):
            one = beyond[0]
            raise ModelError(f"{one.quantity} of '{one.joint}' is {one.worst:.4g} {one.unit}")
        growth = _growth(robot, q) / self.of_home
        if growth > self.gain * part:
            raise ModelError(f"near a singular posture the joints move {growth:.3g} times more than at home")
        rows = Y.reshape(-1, len(self.scale)) * self.scale
        R = linalg.qr(rows, mode="r", pivoting=True)[0]
        diagonal = np.abs(np.diagonal(R))[: len(self.scale)]
        length = np.linalg.norm(rows, axis=0)
        condition = float(np.linalg.cond(rows / np.where(length > 0, length, 1.0)))
        return 2.0 * float(np.sum(np.log(np.maximum(diagonal, np.finfo(float).tiny)))), condition, growth


def _best(search: _ExcitationSearch, harmonics: int, evaluations: int, seed: int) -> Array:
    """Search the Fourier coefficients from which most is learned, shape (2, harmonics, motors).

    Each candidate is drawn around the best one so far, in steps that grow with success and shrink without.
    """
    rng = np.random.default_rng(seed)
    spread = search.room / np.arange(1, harmonics + 1)[:, None]
    shape = 2, *spread.shape
    best = search.within(FIRST * spread * rng.normal(size=shape))
    step = 0.5
    for _ in range(evaluations - 1):
        changed = best[1] + step * np.abs(best[1]).max() / search.room.max() * spread * rng.normal(size=shape)
        try:
            other = search.within(changed, tries=2)
        except ModelError:
            other = (-np.inf, np.inf, np.inf), changed
        better = other[0] > best[0]
        best, step = (other, step * GROWS) if better else (best, step * SHRINKS)
    return best[1]


def _growth(robot: HybridRobot, q: Array) -> float:
    """Compute the largest motion of all joints per motion of the motors, in the joints' units, over samples.

    Raises:
        SingularityError: The motors lose a direction.
    """
    rest, out = np.zeros((len(q), robot.nv)), 0.0
    for s in forward(robot, q, rest, rest, None):
        unit = s.mechanism.reduction.col_scale
        Phi = motions_of_motors(robot, s) / unit[:, None]
        of_motors = unit[s.module.motor_columns]
        out = max(out, float(np.linalg.norm(Phi * of_motors, ord=2, axis=(1, 2)).max(initial=0.0)))
    return out
