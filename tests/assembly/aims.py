"""Random targets of random stacks: what is prescribed of links and joints over time, and what the rule is."""

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pinocchio as pin

from hybridyn import HybridRobot
from hybridyn.assembly.chain.coupling import ways_between
from hybridyn.assembly.poses import PoseRequest
from hybridyn.description import read
from hybridyn.structure.building import build_robot
from tests.assembly.fitted import ANGLES, DEPENDENT, LENGTHS, ROOT, WORLD, Array, Course, Fitted, Wanted
from tests.assembly.stacks import Stack, random_stack
from tests.oracle import Oracle
from tests.robots.as_written import WRITTEN
from tests.robots.mechanisms import home_posture, near
from tests.robots.shipped import shipped

#: How far a state lies from home, in the oracle's scaled coordinates.
AWAY = 0.25
#: A row is independent of others if this part of its motion remains when they are held; a row moves at all if
#: its motion is this part of that of the largest.
REMAINS, MOVES = 0.3, 0.1
#: A whole pose is prescribed where its least singular value is at least this part of its largest.
WHOLE = 0.05
#: Angles are prescribed where the cosine of the pitch is at least this.
OFF_POLE = 0.3
#: A step that bends by more than this part of its length is no step along a smooth motion.
BENT = 0.3
#: What joints without a motor count in the rule.
PASSIVE = 1e-3


def quadratic(value: Array, rate: Array, change: Array) -> Course:
    """Return numbers of constant acceleration."""
    return lambda t: (value + t * rate + t * t / 2 * change, rate + t * change, change)


def straight(names: tuple[str, ...], value: Array, rate: Array) -> Course:
    """Return coordinates that move as between two rows: a complete orientation turns about a fixed axis."""
    still = np.zeros_like(rate)
    if not set(ANGLES) <= set(names):
        return quadratic(value, rate, still)
    turns, frame = [names.index(name) for name in ANGLES], pin.LOCAL_WORLD_ALIGNED
    R = pin.rpy.rpyToMatrix(value[turns])
    w = pin.rpy.computeRpyJacobian(value[turns], frame) @ rate[turns]

    def course(t: float) -> tuple[Array, Array, Array]:
        x, v, a = value + t * rate, rate.copy(), still.copy()
        x[turns] = angles = pin.rpy.matrixToRpy(pin.exp3(t * w) @ R)
        to_rates = pin.rpy.computeRpyJacobianInverse(angles, frame)
        v[turns] = rates = to_rates @ w
        a[turns] = -to_rates @ pin.rpy.computeRpyJacobianTimeDerivative(angles, rates, frame) @ rates
        return x, v, a

    return course


@dataclass(frozen=True, eq=False)
class Standing:
    """A robot, the links between which poses are given, and the judge.

    Attributes:
        robot: The robot.
        fitted: The judge.
        link: The link.
        other: The other link, or `WORLD`.
    """

    robot: HybridRobot
    fitted: Fitted
    link: str
    other: str

    @classmethod
    def of(cls, stack: Stack) -> "Standing":
        """Build a stack."""
        floating = stack.base == "floating"
        fitted = Fitted(stack.description, floating=floating)
        return cls(build_robot(stack.description, base=stack.base), fitted, stack.link, stack.other)

    @property
    def root(self) -> str:
        """The root link."""
        return self.robot.description.root

    @cached_property
    def q_slices(self) -> dict[str, slice]:
        """Where the robot has a joint's coordinates."""
        own = dict(zip(self.robot.joints, self.robot.q_slices, strict=True))
        return {ROOT: slice(0, 7)} | own if self.robot.base != "fixed" else own

    @cached_property
    def v_slices(self) -> dict[str, slice]:
        """Where the robot has a joint's rates."""
        own = dict(zip(self.robot.joints, self.robot.v_slices, strict=True))
        return {ROOT: slice(0, 6)} | own if self.robot.base != "fixed" else own

    def taken(self, q: Array) -> Array:
        """Return a posture of the robot as the judge has it."""
        return self.fitted.taken(q, self.q_slices)

    def rates_taken(self, v: Array) -> Array:
        """Return rates of the robot as the judge has them."""
        return self.fitted.taken(v, self.v_slices, rates=True)

    def given(self, x: Array) -> Array:
        """Return a posture of the judge as the robot has it."""
        return self.fitted.given(x, self.q_slices, self.robot.nq)

    @cached_property
    def between(self) -> set[int]:
        """Numbers of the modules that move the link in the other."""
        other = self.root if self.other == WORLD else self.other
        ways = ways_between(self.robot, PoseRequest(self.link, other, None, {}))
        return {k for way in ways for k, _ in way}

    @cached_property
    def ease(self) -> Array:
        """The motion of each freedom that counts as one in the rule, shape (nv,)."""
        robot, out = self.robot, np.ones(self.fitted.model.nv)
        for module in robot.modules:
            length, alone = module.mechanism.length, module.driven >= module.mobility
            for name in module.joints:
                at, joint = self.fitted.slices(name)[1], self.fitted.joints[name]
                slides = {"prismatic": 1, "planar": 2, "floating": 3}.get(joint.kind, 0)
                out[at.start : at.start + slides] = length
                span = joint.upper - joint.lower
                if alone and name in module.motors:
                    whole = length if joint.kind == "prismatic" else 2 * np.pi
                    out[at] = span if 0 < span < np.inf else whole
                elif alone:
                    out[at] /= PASSIVE
        return out

    def start(self, rng: np.random.Generator) -> Array | None:
        """Draw a closed posture near home, shape (judge's nq,)."""
        oracle = Oracle(self.robot.description, self.robot.base)
        drawn = self.robot.description.home  # files state none; zeros are no cosine and sine
        home = home_posture(self.robot.description, self.robot.base) if drawn else self.robot.home
        q = near(oracle, home, rng, AWAY)
        return None if q is None else self.taken(q)


@dataclass(frozen=True, eq=False)
class Aim:
    """What is prescribed from a posture on.

    Attributes:
        standing: The robot.
        x: The posture at time zero, which meets it.
        target: What is prescribed of the link in the other.
        joints: What is prescribed of joints.
        base: What is prescribed of the base.
        left: Freedoms that this leaves to the rule.
    """

    standing: Standing
    x: Array
    target: Wanted
    joints: tuple[Wanted, ...]
    base: tuple[Wanted, ...]
    left: int

    @property
    def wanted(self) -> list[Wanted]:
        """All that is prescribed."""
        return [*self.base, self.target, *self.joints]

    @cached_property
    def rank(self) -> int:
        """Number of independent rows."""
        s = self.standing.fitted.values(self.x, self.wanted, 0.0, self.standing.ease)
        return int((s > DEPENDENT * s[0]).sum())

    def least_value(self, x: Array, t: float) -> float:
        """Return the least singular value of the independent rows, all freedoms counting alike."""
        return float(self.standing.fitted.values(x, self.wanted, t)[self.rank - 1])

    def asked(self, times: Sequence[float] | float) -> dict[str, Any]:
        """Return motors and platforms at times as `assemble` takes them."""

        def of(one: Wanted) -> Any:
            whole = one.names == ("pose",)
            rows = [one.pose(t) if whole else one.course(t) for t in np.atleast_1d(times)]
            levels = [np.array(level) for level in zip(*rows, strict=True)]
            levels = levels if np.ndim(times) else [level[0] for level in levels]
            if not one.other:
                return tuple(level[..., 0] for level in levels)
            if whole:
                return tuple(levels)
            return tuple(dict(zip(one.names, np.moveaxis(level, -1, 0), strict=True)) for level in levels)

        platforms = {f"{one.link}@{one.other}": of(one) for one in (*self.base, self.target)}
        return {"motors": {one.link: of(one) for one in self.joints}, "platforms": platforms}


def _is_plain(angles: Array) -> bool:
    """Return whether roll, pitch and yaw, shape (3,), are meant by a lone one of them, far from a pole."""
    other = np.pi - np.abs(angles)
    return bool(np.cos(angles[1]) > OFF_POLE and np.abs(angles).sum() < other.sum() - OFF_POLE)


def _chosen(rows: Array, rng: np.random.Generator, held: Array) -> list[int]:
    """Choose rows (n, d) that move independently of each other and of held ones, in random order."""
    Q, out = [*held], []
    size = np.linalg.norm(rows, axis=1)
    for i in rng.permutation(len(rows)):
        rest = rows[i] - sum(((q @ rows[i]) * q for q in Q), np.zeros(rows.shape[1]))
        left = np.linalg.norm(rest)
        if left > REMAINS * size[i] and size[i] > MOVES * size.max(initial=0.0):
            out.append(int(i))
            Q.append(rest / left)
    return out


def random_aim(
    standing: Standing, x: Array, rng: np.random.Generator, *, determined: bool, still: bool = False
) -> Aim:
    """Draw what is prescribed from a posture on.

    Args:
        standing: The robot.
        x: The posture.
        rng: Source of numbers.
        determined: Whether motors are prescribed, too, until no freedom is left.
        still: Whether all moves straight, as between two rows, and the base is at rest.
    """
    fitted, robot = standing.fitted, standing.robot
    n = fitted.model.nv
    plain = np.ones(n)
    kept = 0.0 if still else 1.0

    def along(names: tuple[str, ...], link: str, other: str, J: Array, value: Array, start: Array) -> Wanted:
        course = straight(names, value, J @ v) if still else quadratic(value, J @ v, J @ a)
        return Wanted(link, names, course, other, start)

    base: list[Wanted] = []
    if robot.base != "fixed":
        fitted.at(x)
        p, R, J = fitted.relative((WORLD, None), (standing.root, None))
        rates = kept * 0.5 * rng.normal(size=(2, 6))
        base.append(Wanted(standing.root, ("pose",), quadratic(np.r_[p, np.zeros(3)], *rates), WORLD, R))
    beside = [m for k, module in enumerate(robot.modules) if k not in standing.between for m in module.motors]
    joints = [
        Wanted(name, ("q",), quadratic(x[fitted.slices(name)[0]], np.zeros(1), np.zeros(1)))
        for name in beside
    ]
    N = fitted.motions(x, plain, [*base, *joints])
    v, a = (N @ rng.normal(size=N.shape[1]) * s for s in (0.5, 0.5))
    here, J = fitted.coordinates(x, standing.link, standing.other)
    s = np.linalg.svd(J @ N, compute_uv=False)
    if len(s) == 6 and s[5] > WHOLE * s[0] and rng.random() < 0.5:
        fitted.at(x)
        p, R, J = fitted.relative((standing.other, None), (standing.link, None))
        target = along(("pose",), standing.link, standing.other, J, np.r_[p, np.zeros(3)], R)
        rows = J @ N
    else:
        count = 6 if _is_plain(here[3:]) else 3
        some = _chosen(J[:count] @ N, rng, np.zeros((0, N.shape[1])))
        some = some[: int(rng.integers(1, len(some) + 1))]
        names = tuple((*LENGTHS, *ANGLES)[i] for i in some)
        target = along(names, standing.link, standing.other, J[some], here[some], np.eye(3))
        rows = J[some] @ N
    held = np.linalg.qr(rows.T)[0].T
    motors = [m for k in sorted(standing.between) for m in robot.modules[k].motors]
    picked = _chosen(N[[fitted.slices(m)[1].start for m in motors]], rng, held)
    most = len(picked) if determined else int(rng.integers(0, 2))
    for i in picked[:most]:
        at, to = fitted.slices(motors[i])
        own = np.zeros((1, n))
        own[0, to] = 1.0
        joints.append(along(("q",), motors[i], "", own, x[at], np.eye(3)))
    left = N.shape[1] - len(rows) - len(picked[:most])
    return Aim(standing, x, target, tuple(joints), tuple(base), left)


@dataclass(frozen=True)
class March:
    """A way that the judge follows from the start of an aim on, in small steps.

    Attributes:
        times: Times of its postures.
        postures: The postures, shape (steps, judge's nq).
        clear: Least independent singular value of all rows at each, over that at the start.
        lost: Whether no posture was found, or one beyond a fold, right after the last.
    """

    times: Array
    postures: Array
    clear: Array
    lost: bool


def march(aim: Aim, times: Iterable[float], least: float = 0.0) -> March:
    """Follow an aim through times; stop where a step is bent more than a smooth motion is.

    Args:
        aim: What is prescribed.
        times: The times.
        least: Least `clear` of a posture; the way ends before.
    """
    fitted, ease = aim.standing.fitted, aim.standing.ease
    times, rank, start = [*map(float, times)], aim.rank, aim.least_value(aim.x, 0.0)
    known, clear = [aim.x], [1.0]
    for before, t in pairwise([0.0, *times]):
        ahead = fitted.rates(known[-1], aim.wanted, before, ease, rank) * (t - before)
        guess = pin.integrate(fitted.model, known[-1], ahead)
        x = fitted.close(guess, aim.wanted, t, ease, rank)
        bent = np.inf if x is None else np.abs(fitted.apart(guess, x)).max()
        if x is None or bent > BENT * np.abs(ahead).max() + 1e-9:
            break
        value = aim.least_value(x, t) / start
        if value < least:
            break
        known.append(x)
        clear.append(value)
    found = len(known) - 1
    return March(np.array(times[:found]), np.array(known[1:]), np.array(clear[1:]), found < len(times))


def standing_of(name: int | str) -> Standing:
    """Build a random stack by its seed, or a robot as people write it, or a shipped one, by its name."""
    if isinstance(name, int):
        return Standing.of(random_stack(name))
    if name not in WRITTEN:
        robot = build_robot(shipped(name))
        return Standing(
            robot, Fitted(robot.description), robot.modules[-1].outputs[0], robot.description.root
        )
    text, link, other, floating = WRITTEN[name]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.urdf"
        path.write_text(text())
        description = read(path)
    robot = build_robot(description, base="floating" if floating else "fixed")
    return Standing(robot, Fitted(description, floating=floating), link, other)


def random_aims(names: Iterable[int | str], count: int, *, still: bool = False) -> Iterator[Aim]:
    """Draw so many targets of each robot; every other one may leave freedoms to the rule."""
    for name in names:
        seed = name if isinstance(name, int) else crc32(name.encode())
        standing, rng = standing_of(name), np.random.default_rng([seed, count, int(still)])
        alone = len(standing.between) == 1 and standing.other != WORLD
        drawn = 0
        while drawn < count:
            x = standing.start(rng)
            if x is not None:
                yield random_aim(standing, x, rng, determined=alone or drawn % 2 == 0, still=still)
                drawn += 1
