"""Base parameters: the combinations of standard parameters on which the motors' efforts depend.

The columns of Y depend on each other, by constants. A QR with column pivoting over random assembled states
counts the independent ones. A QR body by body, with pivoting among the ten of each, chooses them (Gautier
1991): a parameter is grouped with those of bodies nearer to the base, as in Khalil's rules.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from ..assembly.spanning import spanning_positions
from ..compiled import any_accelerations, moving_states
from ..effects.choice import Choice
from ..linkage.loop_problem import LoopProblem
from ..linkage.newton import close
from ..linkage.walking import CLOSED
from ..spatial import Array, Index
from ..structure.module import Module
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .parameters import standard_parameters
from .regressor import effort_rows
from .standard import StandardParameters

#: A pivot below this part of the largest counts as zero, in columns of scaled parameters. Rounding leaves
#: about 1e-14, and less than 1e-6 of a robot's efforts is beyond any measurement.
RANK = 1e-9
#: Random states: so many, and so many equations for each parameter.
STATES, EQUATIONS = 40, 3
#: Random postures lie so far from generic ones [rad, module lengths]: with loops in some short steps, which
#: stay on the branch, and without.
FAR_WITH_LOOPS, STEPS, FAR = 0.6, 3, 2.5
#: Entries of Y that are held at once.
ENTRIES = 4_000_000
#: Terms that the name of a base parameter shows.
SHOWN = 8


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Base parameters: tau = Y[..., columns] base, with base = combination values.

    Attributes:
        rank: Number of base parameters.
        columns: The standard parameter that leads each, shape (rank,).
        combination: Coefficient of each standard parameter in each base parameter, shape (rank, p).
        names: Base parameters as sums, such as "m of leg 3 rod + 0.5 m of platform".
        standard: The standard parameters.
        unit: Unit of each standard parameter, in which they compare, shape (p,).
        never: Names of the standard parameters on which no effort depends.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> base = hybridyn.base_parameters(robot)
        >>> base.combination.shape, len(base.names)
        ((11, 40), 11)
    """

    rank: int
    columns: Index
    combination: Array
    names: tuple[str, ...]
    standard: StandardParameters
    unit: Array

    @cached_property
    def values(self) -> Array:
        """The robot's own base parameters, shape (rank,)."""
        return np.asarray(self.combination @ self.standard.values)

    @cached_property
    def never(self) -> tuple[str, ...]:
        """Names of the standard parameters on which no effort depends."""
        return tuple(np.array(self.standard.names)[~self.combination.any(axis=0)].tolist())

    def contributions(self, name: str) -> dict[str, float]:
        """Return what a standard parameter contributes: the base parameters it is in, with its coefficients.

        Raises:
            ValueError: There is no such parameter.
        """
        column = self.combination[:, self.standard.names.index(name)]
        return {self.names[i]: float(column[i]) for i in np.flatnonzero(column)}


@one_thread()
def base_parameters(robot: HybridRobot, *, effects: Choice = None, symmetric: bool = False) -> BaseParameters:
    """Compute the base parameters of a robot from Y at random assembled states.

    Args:
        robot: The robot.
        effects: As in `regressor`.
        symmetric: As in `regressor`.

    Raises:
        ModelError: Effects are unknown, or have no number to identify.
        SingularityError: The motors lose a direction in every posture.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> hybridyn.base_parameters(robot).rank
        11
    """
    parameters = standard_parameters(robot, effects=effects, symmetric=symmetric)
    unit = units(robot, parameters)
    R = triangular(np.concatenate([*_factors(robot, parameters, unit)]))
    size = np.linalg.norm(R, axis=0)
    felt = size > RANK * size.max(initial=0.0)
    size = np.where(felt, size, 1.0)
    R, unit = felt * R / size, unit / size
    pivots = np.abs(np.diagonal(scipy.linalg.qr(R, mode="r", pivoting=True)[0]))
    rank = int((pivots > RANK * pivots.max(initial=0.0)).sum())
    return led(R, rank, parameters, unit)


def led(R: Array, rank: int, parameters: StandardParameters, unit: Array) -> BaseParameters:
    """Choose the parameters that lead the groups, and express all others by them.

    Args:
        R: Rows over scaled parameters, shape (k, p).
        rank: Their rank.
        parameters: The standard parameters.
        unit: Their units, shape (p,).
    """
    columns = _independent(R, rank, parameters)
    combination = scipy.linalg.lstsq(R[:, columns], R)[0] if rank else np.zeros((0, len(unit)))
    combination[np.abs(combination) < RANK] = 0.0
    combination *= unit[columns, None] / unit
    combination[:, columns] = np.eye(rank)
    names = tuple(_name(*one, parameters.names) for one in zip(combination, columns, strict=True))
    return BaseParameters(rank, columns, combination, names, parameters, unit)


def units(robot: HybridRobot, parameters: StandardParameters) -> Array:
    """Compute the unit of each parameter, in which they compare, shape (p,).

    A kilogram, a kilogram at the robot's size, and a kilogram at its size squared; those of laws are one, but
    for rotors that turn.
    """
    size = robot.bodies.size
    out = np.ones(len(parameters.names))
    for at in parameters.tens:
        out[at] = size ** np.array([0.0] + [1.0] * 3 + [2.0] * 6)
    for term in parameters.terms:
        turns = np.array([not robot.records[name].kind.slides for name in term.joints])
        out[term.columns] = np.where(turns, size**2, 1.0)
    return out


def _factors(robot: HybridRobot, parameters: StandardParameters, scale: Array) -> Iterator[Array]:
    """Yield triangular factors of Y in scaled parameters, rows of length one, over random states."""
    p, motors = len(scale), len(robot.motors)
    count = STATES + EQUATIONS * p // max(motors, 1)
    q, v, a = random_motions(robot, count)
    step = max(1, ENTRIES // max(p * motors, 1))
    yield np.zeros((0, p))
    for first in range(0, count, step):
        part = slice(first, first + step)
        Y = effort_rows(robot, parameters, q[part], v[part], a[part], together=True) * scale
        size = np.linalg.norm(Y, axis=2, keepdims=True)  # no row near a singular posture outweighs others
        yield triangular((Y / np.where(size > 0, size, 1.0)).reshape(-1, p))


def random_motions(robot: HybridRobot, count: int) -> tuple[Array, Array, Array]:
    """Draw q, v, a, shapes (count, nq), (count, nv), (count, nv), that the loops allow, all independent."""
    q, v, _ = moving_states(robot, count, positions=_spread)
    return q, v, any_accelerations(robot, q, v, seed=1)  # of another seed: v must not be a


def _spread(module: Module, count: int, rng: np.random.Generator) -> Array:
    """Draw assembled positions of a module's spanning tree far from each other, shape (count, nq)."""
    m = module.mechanism
    x, loops = m.postures[rng.integers(len(m.postures), size=count)], m.closures.rows > 0
    for _ in range(STEPS if loops else 1):
        Psi = m.basis(m.closures.matrix(m.tree.sweep(x))).Psi / m.reduction.col_scale[:, None]
        along, _ = np.linalg.qr(Psi)
        step = np.einsum("tij,tj->ti", along, rng.uniform(-1, 1, along.shape[::2])) * m.reduction.col_scale
        start, x = x, m.tree.integrate(x, step * (FAR_WITH_LOOPS if loops else FAR))
        if loops:
            every = np.ones(m.tree.nv, dtype=bool)
            found = close(LoopProblem(m.closures, m.reduction.row_scale, m.reduction.col_scale, every), x)
            closed = found.residual <= CLOSED + m.rounding
            x = np.where(closed[:, None], found.q, start)
    home = np.tile(m.spec.home, (count, 1))
    return spanning_positions(module, x, m.tree.sweep(x), home)


def triangular(A: Array) -> Array:
    """Compute the triangular factor of a matrix, shape (at most columns, columns)."""
    return np.asarray(np.linalg.qr(A, mode="r"))


def _independent(R: Array, rank: int, parameters: StandardParameters) -> Index:
    """Choose independent columns: body by body the clearest; by pivoting of all if the rank is unclear."""
    kept: list[int] = []
    Q, tens = np.zeros((len(R), 0)), parameters.tens
    for at in (*tens, np.setdiff1d(np.arange(R.shape[1]), tens)):
        rest = R[:, at] - Q @ (Q.T @ R[:, at])
        own, pivots, order = scipy.linalg.qr(rest - Q @ (Q.T @ rest), mode="economic", pivoting=True)
        count = int((np.abs(np.diagonal(pivots)) > RANK).sum())
        kept += at[order[:count]].tolist()
        Q = np.column_stack([Q, own[:, :count]])
    if len(kept) != rank:
        kept = scipy.linalg.qr(R, mode="r", pivoting=True)[1][:rank].tolist()
    return np.sort(np.array(kept, dtype=int))


def _name(row: Array, lead: int, names: tuple[str, ...]) -> str:
    """Write a base parameter as a sum, its leading parameter first."""
    others = [i for i in np.flatnonzero(row) if i != lead]
    out = names[lead]
    for i in others[:SHOWN]:
        size = "" if abs(abs(row[i]) - 1.0) < 1e-9 else f"{abs(row[i]):.4g} "
        out += f" {'-' if row[i] < 0 else '+'} {size}{names[i]}"
    return out + (f" + {len(others) - SHOWN} more" if len(others) > SHOWN else "")
