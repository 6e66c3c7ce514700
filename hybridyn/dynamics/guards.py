"""Guards of the models: what each compares, its limit, and what it says.

A guard accepts a sample if value <= limit * scale. An error names the first sample that is refused, a warning
the worst one. `check` finds the sample and composes the words.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import AT_SAMPLE, HybridynError, SingularityError
from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.module import Module
from .natural_sizes import NOISE

EPS = float(np.finfo(float).eps)
#: A closure row is lost at a posture if its pivot is below this part of the largest: the pivot is rounding.
LOST_PIVOT = 1e-13
#: Below this pivot ratio, the correct digits of the efforts are checked.
NEAR_LOST_PIVOT = 1e-6
#: Smallest squared pivot ratio of the motors' map if only the accelerations of motors are given. The errors
#: of the motion grow with the condition number of this map, and the errors of the efforts with its square.
SINGULAR_ACCELERATION_MAP = 1e-10
#: Largest force that may act on a motion without inertia, as a part of the largest term.
FORCED = 1e-9
#: Rounding below this part of the effect of the robot's weight is harmless.
HARMLESS = 1e-6

_log = logging.getLogger("hybridyn")


class Guard(NamedTuple):
    """One guard.

    Attributes:
        limit: Largest ratio of value to scale that is accepted.
        raises: Class of the error; None if a warning is logged.
        data: Words that the error carries as attributes.
        says: The sentence after the module's name. Its fields are the words of `check`.
    """

    limit: float
    raises: type[HybridynError] | None
    data: tuple[str, ...]
    says: str


SINGULAR = ("what", "condition", "sample")
CLOSURES = Guard(
    1 / LOST_PIVOT,
    SingularityError,
    SINGULAR,
    "its closures lose rank{at} (constraint singularity; condition number {ratio:.1e}, limit "
    "{limit:.0e}): more motions than its {mobility} freedoms are instantaneously possible there. Move the "
    'posture away from it, or, for the inverse model, pass on_singular="least-norm"',
)
EFFORT_DIGITS = Guard(
    1.0,
    SingularityError,
    SINGULAR,
    "its efforts have no correct digit{at}, next to a constraint singularity (condition "
    "number {condition:.1e}): terms of {size:.1e} N m cancel. The accelerations there are not those of a "
    "smooth motion; take q, v, a from a smooth motion, or move the posture away",
)
MOTOR_ACCELERATIONS = Guard(
    1 / SINGULAR_ACCELERATION_MAP,
    SingularityError,
    SINGULAR,
    "its motors lose a direction{at} (parallel singularity), and their accelerations alone do "
    "not determine the motion there (squared condition number {ratio:.1e}, limit {limit:.0e}). Give all "
    'accelerations and passive="given", or move the trajectory away',
)
MASSLESS = Guard(
    FORCED,
    SingularityError,
    SINGULAR,
    "the motion of {freedom} has no inertia, and a force of {force:.3g} N m acts on it{at}: "
    "its acceleration is not defined. Give a mass to the bodies that it moves, or drive it by position",
)
DIGITS = Guard(
    1.0,
    None,
    (),
    "its {what} have no correct digit at {samples} samples (worst: sample {sample}): terms of {size:.1e} "
    "{unit} cancel, and only their rounding of {rounding:.1e} {unit} remains. Slow the motion down, or "
    "reduce the loads",
)


def check(
    guard: Guard,
    module: Module,
    value: Array,
    scale: Array | float = 1.0,
    words: Callable[[int], dict[str, Any]] = lambda t: {},
) -> None:
    """Raise or warn if a guard refuses a sample.

    Args:
        guard: The guard.
        module: The module that it is about.
        value: What is compared, shape (T,).
        scale: What it is compared with, in the same unit, shape (T,).
        words: Words of the sentence for sample t; besides them, these are known: at (the words " at
            sample 7"), sample, samples (how many are refused), ratio and condition (of value to scale),
            limit, mobility of the module.

    Raises:
        HybridynError: The guard's error, at the first sample that is refused.
    """
    refused = np.flatnonzero(value > guard.limit * np.asarray(scale))
    if not len(refused):
        return
    t = int(refused[0] if guard.raises else refused[np.argmax(value[refused])])
    least = float(np.broadcast_to(scale, value.shape)[t])
    ratio = float(value[t]) / least if least > 0 else np.inf
    known = {
        "at": AT_SAMPLE, "sample": t, "samples": len(refused), "ratio": ratio,
        "condition": ratio, "limit": guard.limit, "mobility": module.mobility,
    } | words(t)  # fmt: skip
    message = f"module '{module.name}': {guard.says.format(**known)}"
    if guard.raises is None:
        _log.warning(message)
        return
    error: Callable[..., HybridynError] = guard.raises
    raise error(message, module=module.name, **{name: known[name] for name in guard.data})


def check_closure_rank(module: Module, basis: Basis) -> None:
    """Raise if the closures of a module lose rank at a sample.

    Raises:
        SingularityError: The message names module, sample and condition number.
    """
    if module.mechanism.reduction.rank:
        check(CLOSURES, module, np.ones(len(basis.pivot)), basis.pivot, lambda t: {"what": "closures"})


def check_motor_map(module: Module, pivot: Array) -> None:
    """Raise if the accelerations of the motors do not determine the motion (parallel singularity).

    Args:
        pivot: Smallest pivot of its motors' map over the largest, shape (T,).

    Raises:
        SingularityError: The message names module, sample and condition number.
    """
    check(MOTOR_ACCELERATIONS, module, np.ones(len(pivot)), pivot**2, lambda t: {"what": "motors"})


def check_effort_digits(module: Module, basis: Basis, Q: Array, size: Array, weight: float) -> None:
    """Raise if efforts have no correct digit next to a constraint singularity; warn elsewhere.

    A motion that is not smooth next to a singularity has accelerations proportional to 1 / pivot and closure
    wrenches proportional to 1 / pivot^2. The efforts are the small difference of these large terms.

    Args:
        Q: Generalised force needed along each motion, shape (T, N), [N m].
        size: Largest term in the sum Q, shape (T,), [N m].
        weight: Largest effort that the robot's weight can cause [N m]; rounding below it is harmless.

    Raises:
        SingularityError: The message names module, sample and condition number.
    """
    if not module.motors:
        return
    left, pivot = np.abs(Q).max(axis=1, initial=0.0), basis.pivot
    near = (pivot >= LOST_PIVOT) & (pivot < NEAR_LOST_PIVOT)
    words = {"what": "closures"}
    check(
        EFFORT_DIGITS, module, np.where(near, EPS * size, 0.0), np.maximum(left, weight) * pivot,
        lambda t: words | {"condition": 1 / float(pivot[t]), "size": size[t]},
    )  # fmt: skip
    _check_digits(module, "efforts", "N m", left, size, weight)


def check_acceleration_digits(module: Module, x_ddot: Array, terms: Array, gravity: Array) -> None:
    """Log a warning for samples at which the accelerations of a module have no correct digit.

    Args:
        x_ddot: Accelerations of the module, shape (T, n).
        terms: Largest term in their sum, shape (T,), [rad/s^2].
        gravity: Acceleration of gravity, shape (3,), [m/s^2].
    """
    m = module.mechanism
    left = np.abs(x_ddot / m.reduction.col_scale).max(axis=1, initial=0.0)
    natural = float(np.linalg.norm(gravity)) / m.length
    _check_digits(module, "accelerations", "rad/s^2", left, terms, natural)


def _check_digits(module: Module, what: str, unit: str, left: Array, size: Array, natural: float) -> None:
    """Log a warning for samples at which a sum is rounding, because its terms cancel.

    Rounding below a millionth of the effect of the robot's weight counts as zero. Without gravity there is
    nothing to compare with, and no warning.

    Args:
        left: Size of the sum, shape (T,).
        size: Largest term in it, shape (T,).
        natural: Effect of the robot's weight, in the unit of the sum; 0 without gravity.
    """
    if natural > 0.0:
        rounding = NOISE * size
        harms = np.where(rounding > HARMLESS * natural, rounding, 0.0)
        words = {"what": what, "unit": unit}
        check(DIGITS, module, harms, left, lambda t: words | {"size": size[t], "rounding": rounding[t]})


def check_massless_forces(module: Module, basis: Basis, left: Array, size: Array, slipping: Array) -> None:
    """Raise if a force acts on a motion without inertia.

    Args:
        left: Forces on massless motions (`InertiaFactor.solve`), shape (T, N), [N m].
        size: Largest term in the sum of these forces, shape (T,), [N m].
        slipping: Largest force that is rounding, shape (T,), [N m].

    Raises:
        SingularityError: The message names the motion, the force and the sample.
    """
    force = np.abs(left).max(axis=1, initial=0.0)

    def words(t: int) -> dict[str, Any]:
        """Name the motion and the force on it."""
        motion = basis.Psi[t, :, int(np.argmax(np.abs(left[t])))] / module.mechanism.reduction.col_scale
        freedom = module.freedom_names()[int(np.argmax(np.abs(motion)))]
        return {"what": "inertia", "condition": np.inf, "freedom": freedom, "force": force[t]}

    check(MASSLESS, module, force, np.maximum(size, slipping / FORCED), words)
