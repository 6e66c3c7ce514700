"""Solve for friction that depends on reactions, which depend on friction.

Wrenches of joints are linear in efforts: w = w_0 + B n, where n is the friction of each joint and B holds the
wrenches that unit frictions cause. The law asks for n = N(w). As |N_i(w) - N_i(w')| <= N_i(w - w'), the law
changes by at most L |change of n|, where L[i, j] = N_i(column j of B). If the spectral radius of L is below
1, there is one solution, and n -> N(w_0 + B n) leads to it from anywhere. So it does if any norm of N(B .) is
below 1: `friction_bound` bounds one without writing B out.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ..description.names import listed
from ..effects.load_friction import OnLoads
from ..errors import AT_SAMPLE, ActuationError, ModelError
from ..spatial import Array
from .friction_bound import feedback
from .friction_response import Response, answer
from .reactions import Reactions, undetermined

#: Spectral radius from which friction is refused: at 1, to rounding, joints may jam.
JAM = 1.0 - 64 * np.finfo(float).eps
#: Steps of Newton's method or of the contraction, of which some ten are usual.
STEPS = 200
#: Bound of the ratio below which the contraction is taken: at most some fifty sweeps.
SURE = 0.5
#: What the contraction leaves of the first error, in the norm that weighs joints.
FAR_DIGIT = 1e-18
#: A residual below this part of the largest friction is rounding.
SETTLED = 4 * np.finfo(float).eps


def settle(
    law: OnLoads, v: Array, reactions_under: Callable[[Array], Reactions], answers: Callable[[Array], Array]
) -> Array:
    """Compute the efforts of friction that grows with load.

    Args:
        law: The law and its joints.
        v: Rates, shape (T, nv).
        reactions_under: Computes the reactions under efforts of joints, shape (T, nv).
        answers: Computes the wrenches that unit frictions cause, shape (T, joints, 6, joints), from their
            efforts, shape (T, nv, joints).

    Returns:
        Shape (T, nv), [N or N m].

    Raises:
        ModelError: The motion does not determine a wrench on which friction depends.
        ActuationError: Joints may jam: several frictions, or none, satisfy the law.
    """
    D = law.directions(v)
    start = reactions_under(np.zeros_like(v))
    check_determined(law, start)
    B = answers(D)
    check_jamming(law, B)
    out: Array = np.einsum("tij,tj->ti", D, solve_friction(law, wrenches_of(law, start), B))
    return out


def settle_moving(law: OnLoads, start: Reactions, modules: Sequence[Response], length: float) -> Array:
    """Compute the friction of every joint in the direct model, in time linear in the number of modules.

    The contraction is taken where `feedback` bounds its ratio. Elsewhere all answers are written out, which
    takes time quadratic in the number of joints.

    Args:
        law: The law and its joints.
        start: Reactions without this friction.
        modules: How every module answers to it.
        length: Length of the robot's modules [m].

    Returns:
        Shape (T, joints), [N or N m].

    Raises:
        ModelError: The motion does not determine a wrench on which friction depends.
        ActuationError: Joints may jam: several frictions, or none, satisfy the law.
    """
    check_determined(law, start)
    w = wrenches_of(law, start)
    ratio = feedback(law, modules, length)[0].max(initial=0.0)
    if ratio >= SURE:
        B = answer(modules, np.tile(np.eye(len(law.joints)), (len(w), 1, 1)))
        check_jamming(law, B)
        return solve_friction(law, w, B)
    n = law.sizes(w)
    for _ in range(int(np.ceil(np.log(FAR_DIGIT) / np.log(max(ratio, FAR_DIGIT))))):
        last, n = n, law.sizes(w + answer(modules, n[..., None])[..., 0])
        if (np.abs(n - last) <= SETTLED * n.max(axis=1, keepdims=True, initial=0.0)).all():
            break
    return n


def wrenches_of(law: OnLoads, reactions: Reactions) -> Array:
    """Return the wrenches of the law's joints, shape (T, joints, 6)."""
    return np.stack([reactions.joints[name] for name in law.joints], axis=1)


def answers_one_by_one(law: OnLoads, D: Array, reactions_under: Callable[[Array], Reactions]) -> Array:
    """Compute the wrenches that unit frictions cause by one model call for each joint.

    Args:
        law, reactions_under: As in `settle`.
        D: Efforts per unit of each joint's friction, shape (T, nv, joints).

    Returns:
        Shape (T, joints, 6, joints).
    """
    w = wrenches_of(law, reactions_under(np.zeros(D.shape[:2])))
    unit = np.maximum(law.sizes(w).max(axis=1), 1.0)[:, None]  # so that differences keep their digits
    under = [wrenches_of(law, reactions_under(unit * D[:, :, j])) for j in range(len(law.joints))]
    return np.stack([(one - w) / unit[..., None] for one in under], axis=3)


def check_determined(law: OnLoads, reactions: Reactions) -> None:
    """Raise if a wrench on which friction depends is not determined.

    Raises:
        ModelError: The message names joints and coefficients.
    """
    vague = [
        f"{word} of '{law.joints[joint]}'"
        for word, joint, part in zip(law.words, law.of_joint, law.part, strict=True)
        if undetermined(part @ reactions.joints_shared[law.joints[joint]]).any()
    ]
    if vague:
        raise ModelError(
            f"{law.effect.name}: redundant closures share loads on which friction depends: {listed(vague)}. "
            "Leave these out, or let closures hold fewer rows (type=\"spherical\", or rows=...)",
            element=law.joints[0],
        )  # fmt: skip


def check_jamming(law: OnLoads, B: Array) -> None:
    """Raise if frictions feed on each other so much that joints may jam.

    Raises:
        ActuationError: The message names the joint that carries most of it, the sample and the ratio.
    """
    L = law.between(np.arange(len(law.joints)), B)
    values, vectors = np.linalg.eig(L)
    ratio = np.abs(values).max(axis=1)
    if not (ratio >= JAM).any():
        return
    t = int(np.argmax(ratio))
    worst = law.joints[int(np.argmax(np.abs(vectors[t][:, int(np.argmax(np.abs(values[t])))])))]
    raise ActuationError(
        f"{law.effect.name}: joint '{worst}' may jam{AT_SAMPLE}: friction adds to its own load "
        f"by {ratio[t]:.4g} times itself, and only below {JAM:g} is there one solution. Lower coefficients "
        "or keep away from this posture",
        direction=worst, size=float(ratio[t]), sample=t,
    )  # fmt: skip


def solve_friction(law: OnLoads, w: Array, B: Array) -> Array:
    """Solve n = N(w + B n), shape (T, joints), by Newton's method, kept safe by the contraction.

    Raises:
        ActuationError: The iteration does not settle.
    """
    n = law.sizes(w)
    last = np.full(len(n), np.inf)
    for _ in range(STEPS):
        under = w + np.einsum("tikj,tj->tik", B, n)
        N = law.sizes(under)
        left = np.abs(N - n).max(axis=1)
        if (left <= SETTLED * np.abs(N).max(axis=1)).all():
            return N
        slope = np.einsum("tik,tikj->tij", law.slopes(under), B)
        newton = n + np.linalg.solve(np.eye(len(law.joints)) - slope, (N - n)[..., None])[..., 0]
        n = np.where((left <= 0.5 * last)[:, None], newton, N)
        last = left
    t = int(np.argmax(left))
    raise ActuationError(
        f"{law.effect.name}: friction does not settle{AT_SAMPLE}; joint "
        f"'{law.joints[int(np.argmax(np.abs(N - n)[t]))]}' is left with {left[t]:.3g}",
        size=float(left[t]), sample=t,
    )  # fmt: skip
