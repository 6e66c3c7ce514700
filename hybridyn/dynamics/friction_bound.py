"""Bound how much frictions feed on one another, in time linear in the number of modules.

The answer w = B n of `friction_response` is made of two causal systems: beta = S n inwards, and
w = P n + R beta outwards. The law's change is at most |Y w| for a change w of wrenches. So frictions feed on
one another by at most |Y B| <= |Y P| + |Y R M| |M^-1 S|, in the norm that weighs each joint's friction. M
measures beta by what frictions reach of it. Each of the three is the gain of one causal system: that of an
outward one, x_o = A x + C z and y = E x + F z, is below gamma where the recursion of the bounded real lemma
stays positive definite from the outermost module to the base,

    P = E^T E + A^T P_o A + L K^-1 L^T,  K = gamma^2 - F^T F - C^T P_o C > 0,  L = E^T F + A^T P_o C.

S has the gain of its adjoint, which runs outwards. Source: e.g. Green & Limebeer (1995), chapter 3.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..effects.load_friction import OnLoads
from ..spatial import Array, Mask
from .friction_response import Response, rows_of_base

#: A gain is sought between powers of this number, then by so many bisections: to a tenth.
LADDER, HALVINGS = 8.0, 4
#: Gains below this are as good as none.
LEAST_GAIN = 1e-12
#: Part of gamma^2 by which K has to be positive, against rounding.
CLEAR = 1e-9
#: Part of the largest beta beta^T below which a direction counts as not reached by friction.
UNREACHED = 1e-12


class Outward(NamedTuple):
    """One module of an outward system: x_o = A x + C z, y = E x + F z; shapes (T, ...)."""

    A: Array
    C: Array
    E: Array
    F: Array


def feedback(law: OnLoads, modules: Sequence[Response], length: float) -> tuple[Array, Array]:
    """Bound by how many times itself friction changes friction.

    Args:
        law: The law and its joints.
        modules: How every module answers.
        length: What makes forces comparable with moments [m].

    Returns:
        The bound, shape (T,), and the weight of each joint, shape (T, joints): with changes c of frictions,
        the norm is that of c / weight.
    """
    force = np.array([length] * 3 + [1.0] * 3)
    weight = np.ones((len(modules[0].inward), len(law.joints)))
    reached = [np.zeros((len(weight), x.carried.shape[1] // 6, 6, 6)) for x in modules]
    systems: list[tuple[Outward, Outward, Outward]] = []
    for k in reversed(range(len(modules))):
        x, outputs = modules[k], modules[k].carried.shape[1]
        own = weight[:, x.joints] = _balance(law, x)
        root, inverse = _roots(reached[k], force)
        z = np.zeros((len(own), *2 * (outputs + len(x.joints),)))  # per what is measured by friction
        z[:, :outputs, :outputs], z[:, outputs:, outputs:] = root, own[:, :, None] * np.eye(len(x.joints))
        of_z = law.lipschitz(x.joints, x.of_z, own)
        inward, driven, of_z = np.matmul(x.inward, z), np.matmul(x.driven, z), np.matmul(of_z, z)
        E = law.lipschitz(x.joints, x.of_base, own)
        adjoint = np.swapaxes(x.inward[..., :outputs], 1, 2), np.swapaxes(inverse, 1, 2)
        nothing = np.zeros((len(own), len(x.joints), outputs))
        systems.insert(0, (
            Outward(x.carried, driven[..., outputs:], E, of_z[..., outputs:]),
            Outward(x.carried, driven[..., :outputs], E, of_z[..., :outputs]),
            Outward(*adjoint, np.swapaxes(inward[..., outputs:], 1, 2), nothing),
        ))  # fmt: skip
        if x.parent >= 0:
            reached[x.parent][:, x.parent_output] += np.matmul(inward, np.swapaxes(inward, 1, 2))
    direct, through, handed = (_gain(modules, system) for system in zip(*systems, strict=True))
    return direct + through * handed, weight


def _roots(reached: Array, force: Array) -> tuple[Array, Array]:
    """Return a root M of what frictions reach of beta, and its inverse, shapes (T, 6 outputs, 6 outputs).

    M measures beta by the friction that causes it. Both are zero for an output on which nothing rubs.

    Args:
        reached: Sum of beta beta^T over unit frictions, shape (T, outputs, 6, 6).
        force: What makes a wrench a moment, shape (6,).
    """
    T, outputs = reached.shape[:2]
    values, vectors = np.linalg.eigh(reached * force[:, None] * force)
    values = np.sqrt(np.maximum(values, UNREACHED * values.max(axis=2, keepdims=True, initial=0.0)))
    inverted = np.where(values > 0, 1.0, 0.0) / np.where(values > 0, values, 1.0)
    root, inverse = np.zeros((2, T, outputs, 6, outputs, 6))
    for o in range(outputs):
        root[:, o, :, o] = vectors[:, o] * values[:, o, None] / force[:, None]
        inverse[:, o, :, o] = np.swapaxes(vectors[:, o] * inverted[:, o, None] * force[:, None], 1, 2)
    size = (T, 6 * outputs, 6 * outputs)
    return root.reshape(size), inverse.reshape(size)


def _balance(law: OnLoads, x: Response) -> Array:
    """Return weights with which a module's frictions feed on each other alike in both ways, (T, joints)."""
    L = law.between(x.joints, x.of_z[..., x.carried.shape[1] :])
    felt, caused = L.sum(axis=2), L.sum(axis=1)
    useful = (felt > 0) & (caused > 0)
    return np.sqrt(np.where(useful, felt, 1.0) / np.where(useful, caused, 1.0))


def _gain(modules: Sequence[Response], system: Sequence[Outward]) -> Array:
    """Compute an upper bound of the gain of an outward system, at most a tenth too large, shape (T,)."""
    high = np.ones(len(modules[0].inward))
    if not any((x.E.any() and x.C.any()) or x.F.any() for x in system):
        return 0 * high
    while not (ok := _holds(modules, system, high)).all():
        high = np.where(ok, high, LADDER * high)
    while (ok := _holds(modules, system, high / LADDER) & (high > LEAST_GAIN)).any():
        high = np.where(ok, high / LADDER, high)
    low = high / LADDER
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        ok = _holds(modules, system, middle)
        high, low = np.where(ok, middle, high), np.where(ok, low, middle)
    return high


def _holds(modules: Sequence[Response], system: Sequence[Outward], gamma: Array) -> Mask:
    """Return whether the gain is surely below gamma, shape (T,)."""
    T = len(gamma)
    beyond = [np.zeros((T, x.A.shape[1], x.A.shape[1])) for x in system]
    holds: Mask = np.ones(T, dtype=bool)
    square = np.square(gamma)[:, None]
    for k in reversed(range(len(system))):
        A, C, E, F = system[k]
        P_o = beyond[k]
        P_C, E_T = np.matmul(P_o, C), np.swapaxes(E, 1, 2)
        losses = np.matmul(np.swapaxes(F, 1, 2), F) + np.matmul(np.swapaxes(C, 1, 2), P_C)
        values, vectors = np.linalg.eigh(losses)
        holds &= (values < (1 - CLEAR) * square).all(axis=1)
        if (parent := modules[k].parent) >= 0:
            L = np.matmul(np.matmul(E_T, F) + np.matmul(np.swapaxes(A, 1, 2), P_C), vectors)
            left = np.maximum(square - values, CLEAR * square)
            P = np.matmul(E_T, E) + np.matmul(np.swapaxes(A, 1, 2), np.matmul(P_o, A))
            P += np.matmul(L / left[:, None], np.swapaxes(L, 1, 2))
            at = rows_of_base(modules[k])
            beyond[parent][:, at, at] += np.where(holds[:, None, None], P, 0.0)
    return holds
