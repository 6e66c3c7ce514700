"""Guards of the models: what each compares, its limit, and what it says.

A guard accepts a sample if value <= limit * scale. An error names the first sample that is refused, a warning
the worst one. `check` finds the sample and composes the words.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import AT_SAMPLE, ActuationError, AssemblyError, HybridynError, SingularityError
from ..linkage.reduction import RANK_TOLERANCE, Basis
from ..logs import warn
from ..spatial import Array, Index
from ..structure.module import Module

EPS = float(np.finfo(float).eps)
#: Rounding of a sum of forces, relative to its largest term times the number of terms.
NOISE = 8 * EPS
#: A closure row is lost at a posture if its pivot is below this part of the largest: the pivot is rounding.
LOST_PIVOT = 1e-13
#: Parts of rows that no pivot removes are rounding of a file up to so many times the rounding in its loops.
OF_ROUNDING = 25.0
#: Below this pivot ratio, the correct digits of the efforts are checked.
NEAR_LOST_PIVOT = 1e-6
#: Motors whose least share in a motion is below this are at a parallel (type 2) singularity: the least
#: singular value of S_a Psi in scaled coordinates, Psi orthonormal, so that the largest possible one is 1.
SINGULAR_MOTOR_MAP = 1e-10
#: Smallest squared pivot ratio of the motors' map if only the accelerations of motors are given. The errors
#: of the motion grow with the condition number of this map, and the errors of the efforts with its square.
SINGULAR_ACCELERATION_MAP = 1e-10
#: Largest generalised force that may remain without a motor, as a part of the largest term.
UNDRIVEN = 1e-6
#: Largest force that may act on a motion without inertia, as a part of the largest term.
FORCED = 1e-9
#: Rounding below this part of the effect of the robot's weight is harmless.
HARMLESS = 1e-6
#: Links whose Delassus matrix has a smaller reciprocal condition cannot be moved in some direction.
IMMOVABLE = 1e-10


class Guard(NamedTuple):
    """One guard.

    Attributes:
        limit: Largest ratio of value to scale that is accepted.
        raises: Class of the error; None if a warning is logged.
        data: Words that the error carries as attributes.
        says: The sentence, after the name of the module. Its fields are the words of `check`.
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
    "{limit:.0e}): more motions than its {module.mobility} freedoms are instantaneously possible there. Move "
    'the posture away from it, or, for the inverse model, pass on_singular="least-norm"',
)
MORE_RANK = Guard(
    1.0,
    SingularityError,
    SINGULAR,
    "its closures have more than their rank of {rank}{at} (relative pivot {value:.1e}, limit {scale:.0e}): "
    "this posture lies in another mode of the linkage, with fewer freedoms than {module.mobility}. Give "
    "a home posture in this mode ([home] in model.toml)",
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
LOST_MOTORS = Guard(
    1 / SINGULAR_MOTOR_MAP,
    SingularityError,
    SINGULAR,
    "its {joints} lose a direction{at} ({reason}; condition number {condition:.1e}, limit "
    "{limit:.0e}; {kind} '{worst}' is affected most). Move the trajectory away from it, or {advice}",
)
NO_MOTOR = Guard(
    UNDRIVEN,
    ActuationError,
    ("direction", "size", "sample"),
    "{motors} for {freedoms}; no motor can produce the {size:.3g} {unit} that the motion of "
    "{direction} needs{at} (largest term {term:.3g} {unit}). {advice}",
)
OPEN_MOTIONS = Guard(
    0.0,
    SingularityError,
    SINGULAR,
    "{joints} for {freedoms} leave the motion of {freedom} open{at}. {advice}",
)
NOT_CLOSED = Guard(
    1.0,
    AssemblyError,
    ("residual", "sample"),
    "closure '{closure}': the {what} do not close the loops{at}: {how} by {residual:.2g} "
    "(limit {scale:.2g}, relative to the module's length {module.mechanism.length:g} m). Take q, v, a from "
    "hybridyn.assemble",
)
FIXED_LINKS = Guard(
    1 / IMMOVABLE,
    SingularityError,
    SINGULAR,
    "links {links}: they cannot be moved in every direction{at} (condition number "
    "{condition:.1e}, limit {limit:.0e}), and have no operational-space inertia. Take hybridyn.delassus, its "
    "inverse, which always exists",
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
    module: Module | None,
    value: Array,
    scale: Array | float = 1.0,
    words: Callable[[int], dict[str, Any]] = lambda t: {},
    samples: Index | None = None,
) -> None:
    """Raise or warn if a guard refuses a sample.

    Args:
        guard: The guard.
        module: The module that it is about, or None.
        value: What is compared, shape (T,).
        scale: What it is compared with, in the same unit, shape (T,).
        words: Words of the sentence for sample t; besides them, these are known: sample, samples (how many
            are refused), at (" at sample 7"), scale, ratio and condition (of value to scale), limit, module.
        samples: Numbers of the samples in messages, shape (T,), where they are some of many.

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
        "sample": t if samples is None else int(samples[t]), "samples": len(refused), "scale": least,
        "at": AT_SAMPLE, "ratio": ratio, "condition": ratio, "limit": guard.limit, "module": module,
    } | words(t)  # fmt: skip
    message = (f"module '{module.name}': " if module else "") + guard.says.format(**known)
    if guard.raises is None:
        warn(message)
        return
    error: Callable[..., HybridynError] = guard.raises
    raise error(message, module=module and module.name, **{name: known[name] for name in guard.data})


def check_closure_rank(module: Module, basis: Basis) -> None:
    """Raise if the closures of a module lose rank at a sample, or have more of it than the module.

    Raises:
        SingularityError: The message names module, sample and condition number.
    """
    check_mode(module, basis)
    if module.mechanism.reduction.rank:
        check(CLOSURES, module, np.ones(len(basis.pivot)), basis.pivot, lambda t: {"what": "closures"})


def check_mode(module: Module, basis: Basis) -> None:
    """Raise if the closures of a module have more than its rank at a sample.

    Raises:
        SingularityError: The message names module and sample.
    """
    m = module.mechanism
    most = max(m.rank_tolerance, RANK_TOLERANCE, OF_ROUNDING * m.rounding)
    rank = {"what": "closures", "rank": m.reduction.rank}
    check(MORE_RANK, module, basis.surplus, most, lambda t: rank | {"value": float(basis.surplus[t])})


def check_digits(module: Module, what: str, unit: str, left: Array, size: Array, natural: float) -> None:
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
