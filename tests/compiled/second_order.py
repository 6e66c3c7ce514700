"""Judge second derivatives along closed paths of the oracle in long double.

Along a path x(s) of states that keep the loops closed, weighted results f of a model have

    f'' = x'^T f_xx x' + f_x x''

with positions that move as by Pinocchio's `integrate`. Rods that spin idly keep their rates on the way.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

import hybridyn
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.programs.derivatives.coordinates import check_coordinates
from hybridyn.spatial import Array
from tests.compiled.found import Found
from tests.oracle import Oracle
from tests.oracle.arithmetic import Long, Numbers
from tests.oracle.joints import between
from tests.oracle.tree import ROW

#: Of the largest term: differences of sixth order in long double leave 1e-12.
ORACLE = 1e-9
#: Steps of paths in long double: shorter ones where a path bends fast, a longer one where rounding counts.
STEPS = [np.longdouble(x) for x in (1e-3, 2.5e-4, 6e-5, 4e-3)]
#: Weights of the differences of sixth order on seven samples.
FIRST = np.array([-1, 9, -45, 0, 45, -9, 1], dtype=np.longdouble) / 60
SECOND = np.array([2, -27, 270, -490, 270, -27, 2], dtype=np.longdouble) / 180
#: Terms below this count as so large, of mechanisms of about a metre and a kilogram: differences leave 1e-12.
NOTHING = 1e-3
#: Turns of a joint about other lines than a spin's, of unit ones: the rounding of files.
UNFELT = 1e-9
#: Least pivot of closure rows that count, of the least singular value at a closed posture: rows that depend
#: on others there part beside it, and would lead Newton's method along the path by their rounding.
COUNTED = 0.1
#: Rounds that take spins out of a displacement: each leaves a part of its size.
ROUNDS = 6

Spin = tuple[slice, Numbers]


class Offs(NamedTuple):
    """Differences from the oracle, of the largest term.

    Attributes:
        value: Of the model's results.
        first, second: Of the first and the second derivative along the path, by `product`.
        along: Of the second derivative by `along`, from that by `product`.
        symmetry: Of products of two directions that change places.
    """

    value: float
    first: float
    second: float
    along: float
    symmetry: float


class Path(NamedTuple):
    """Seven states of a closed path.

    Attributes:
        q, v, a, tau: Positions, rates, accelerations and efforts.
        xi: Displacement from the middle.
    """

    q: Numbers
    v: Numbers
    a: Numbers
    tau: Numbers
    xi: Numbers


def left_free(oracle: Oracle, q: Numbers) -> Numbers:
    """Return a basis of the rates that loops and resting motors allow, shape (nv, k)."""
    posture = oracle.posture(q)
    kept: Numbers = oracle.arithmetic.factor(posture.Z[oracle.motors], oracle.rank_tolerance, 1.0).Z
    return oracle.unit[:, None] * (posture.Z @ kept)


def spins_of(oracle: Oracle, q: Numbers) -> list[Spin]:
    """Return the spins of rods, if motors determine all other motions: freedoms of a joint, and their share.

    A motion that turns several joints about one line counts as that of the first of them.
    """
    N = left_free(oracle, q).astype(float)
    out, rows = list[Spin](), np.zeros((0, N.shape[1]))
    for kind, _, at in oracle.coordinates.values():
        if kind in ("spherical", "revolute", "continuous", "floating") and N.shape[1]:
            unit = oracle.unit[at, None].astype(float)
            U, s, _ = np.linalg.svd(N[at] / unit)
            more = np.vstack([rows, U[:, :1].T @ (N[at] / unit)])
            if (
                s[1:].max(initial=0.0) <= UNFELT
                and np.linalg.svd(more)[1][-1] > UNFELT
                and len(more) <= N.shape[1]
            ):
                out.append((at, oracle.arithmetic.array(U[:, 0] / unit[:, 0])))
                rows = more
    return out if len(rows) == N.shape[1] else []


def closed_path(
    oracle: Oracle, q: Array, v: Array, seed: int, step: np.longdouble, *, direct: bool, driven: bool
) -> Path:
    """Return a path near a state, on which motions without a motor need no effort.

    Spins keep their rates, if motors determine all other motions (`driven`). They keep their accelerations,
    too, unless they follow the efforts of `direct`.
    """
    random, T = np.random.default_rng(seed), oracle.arithmetic.array
    d, dv, a, da = (T(random.normal(size=oracle.nv)) for _ in range(4))
    middle = oracle.close(T(q))
    spins, states = spins_of(oracle, middle) if driven else [], []
    free = left_free(oracle, middle).shape[1] > (0 if direct else len(spins))
    for s in step * np.arange(-3, 4):
        at = oracle.close(oracle.integrate(middle, s * d)) if s else middle
        for _ in range(ROUNDS if spins and s else 0):
            back = lacking(oracle, at, spins, displacement(oracle, middle, at), 0 * d)
            at = oracle.close(oracle.integrate(at, back))
        rates = oracle.project_velocity(at, T(v) + s * dv)
        rates = rates + lacking(oracle, at, spins, rates, T(v))
        change = oracle.consistent_acceleration(at, rates, a + s * da)
        change = oracle.solve_passive(at, rates, change) if free else change
        change = change if direct else change + lacking(oracle, at, spins, change, a)
        tau = efforts(oracle, (at, rates, change), spins)
        states.append((at, rates, change, tau, displacement(oracle, middle, at)))
    return Path(*map(np.array, zip(*states, strict=True)))


def efforts(oracle: Oracle, state: tuple[Numbers, ...], spins: list[Spin]) -> Numbers:
    """Return the efforts along the motors' motions without spins, whatever effort the spins would need."""
    tau, missing = oracle.idm_and_missing(*state)
    if not spins:
        return tau
    Z, T = oracle.motions(state[0]), oracle.arithmetic.array
    held = np.concatenate([Z[oracle.motors], [n @ Z[at] for at, n in spins]])
    E = Z @ oracle.arithmetic.solve(held, T(np.eye(len(held))[:, : len(tau)]))
    return tau + E.T @ missing


def lacking(oracle: Oracle, q: Numbers, spins: list[Spin], rates: Numbers, wanted: Numbers) -> Numbers:
    """Return the spins that rates lack to have those that are wanted."""
    if not spins:
        return 0 * rates
    N = left_free(oracle, q)
    missing = oracle.arithmetic.array([n @ (wanted[at] - rates[at]) for at, n in spins])
    share = oracle.arithmetic.array([n @ N[at] for at, n in spins])
    return N @ oracle.arithmetic.solve(share, missing[:, None])[:, 0]


def displacement(oracle: Oracle, q: Numbers, other: Numbers) -> Numbers:
    """Return the rates that move q to another posture in a unit of time, as Pinocchio's `difference`."""
    out = oracle.arithmetic.array(np.zeros(oracle.nv))
    for kind, at, at_v in oracle.coordinates.values():
        out[at_v] = between(oracle.arithmetic, kind, q[at], other[at])
    return out


def hold_rank(oracle: Oracle, q: Numbers) -> None:
    """Let as many closure rows count on a path as at a closed posture near it."""
    posture = oracle.posture(q)
    rows = (posture.K * oracle.unit / posture.scale[:, None])[:, oracle.tree.free]
    s, rank = np.linalg.svd(rows.astype(float))[1], posture.factor.V.shape[1]
    if 0 < rank < len(s):
        oracle.tree.rank_tolerance = COUNTED * float(s[rank - 1] / max(s[0], ROW))


class Judge:
    """The oracle's paths near one state of a robot, each drawn once.

    Attributes:
        robot: The robot.
    """

    def __init__(self, robot: hybridyn.HybridRobot, seed: int = 0, near: Array | None = None) -> None:
        """Take a random state, or one near a posture."""
        self.robot, self._seed, self._paths = robot, seed, dict[tuple[float, bool], Path]()
        self._oracle = Oracle(robot.description, robot.base, arithmetic=Long())
        q, v, *_ = (x[0] for x in random_states(robot, 1))
        self._near, self._driven = (q if near is None else near, v), True
        hold_rank(self._oracle, self._oracle.close(self._near[0]))
        try:
            check_coordinates(robot, "idm", "motors")
        except hybridyn.ModelError:
            self._driven = False

    def offs(self, model: str, coordinates: str) -> Offs:
        """Return by how much second derivatives differ from the oracle; the least over the steps of paths."""
        second = hybridyn.SecondDerivatives(self.robot, model, coordinates=coordinates)
        found = Offs(*[np.inf] * len(Offs._fields))
        for step in STEPS:
            if max(found) > ORACLE:
                found = Offs(*map(min, found, self._along(second, model, coordinates, step)))
        return found

    def _along(
        self, second: hybridyn.SecondDerivatives, model: str, coordinates: str, step: np.longdouble
    ) -> Offs:
        """Return the differences along the path of a step."""
        oracle, direct = self._oracle, model == "ddm"
        if (step, direct) not in self._paths:
            self._paths[step, direct] = closed_path(
                oracle, *self._near, self._seed, step, direct=direct, driven=self._driven
            )
        path = self._paths[step, direct]
        own = oracle.motors if coordinates == "motors" else slice(None)
        inputs = [path.xi[:, own], path.v[:, own], path.tau if direct else path.a[:, own]]
        results = path.a[:, own] if direct else path.tau
        random = np.random.default_rng(self._seed + 1)
        weights = random.normal(size=results.shape[1])
        loose = np.zeros(len(weights), dtype=bool)
        if direct and own == slice(None):  # accelerations of what has no mass are anything
            loose = np.abs(oracle.massless(path.q[3]).astype(float)).max(axis=1, initial=0.0) > UNFELT
            weights, results = np.where(loose, 0.0, weights), np.where(loose, 0, results)
        (moved, rise), (bent, bend) = (
            ([(w @ x / h).astype(float) for x in inputs], float(weights @ (w @ results) / h))
            for w, h in ((FIRST, step), (SECOND, step**2))
        )
        state = [x[3].astype(float) for x in (path.q, path.v, path.tau if direct else path.a)]
        found = second.product(*state, weights, moved)
        right = results[3].astype(float)
        other = [random.normal(size=x.shape) * np.abs(x).max(initial=0.0) for x in moved]
        turned = second.product(*state, weights, other)
        slopes, products = terms(found.slope, moved), terms(found.product, moved)
        bends, along = terms(found.slope, bent), second.along(*state, moved).second * weights
        there, back = terms(found.product, other), terms(turned.product, moved)
        return Offs(
            off(np.abs(np.where(loose, 0.0, found.value) - right).max(initial=0.0), right),
            off(slopes.sum() - rise, slopes),
            off(products.sum() + bends.sum() - bend, products, bends),
            off(products.sum() - along.sum(), products, along),
            off(there.sum() - back.sum(), there, back),
        )


def terms(found: dict[str, Array], other: list[Array]) -> Array:
    """Return the terms of a product of vectors."""
    return np.concatenate([x * y for x, y in zip(found.values(), other, strict=True)])


def off(difference: float, *parts: Array) -> float:
    """Return a difference of the largest term."""
    return abs(float(difference)) / max(float(np.abs(x).max(initial=NOTHING)) for x in parts)


def compare_second(robot: hybridyn.HybridRobot, seed: int, case: str, found: Found) -> None:
    """Compare second derivatives of both models with the oracle's paths, over joints and over motors."""
    judge = Judge(robot, seed)
    for model, coordinates in product(("idm", "ddm"), ("joints", "motors")):
        try:
            offs = judge.offs(model, coordinates)
        except hybridyn.CompileError as error:
            found.wrong.append(f"{case}: {model} over {coordinates} {error}")
        except hybridyn.SingularityError:
            found.count["not trusted"] += 1
        except (hybridyn.ModelError, hybridyn.ActuationError):
            found.count["refused derivatives"] += 1
        else:
            found.add(f"{model} over {coordinates}", case, max(offs), ORACLE)
