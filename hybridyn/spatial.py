"""Conventions of the package, and batched 6-D operations that Pinocchio offers for single samples only.

- Units are SI, angles in radians.
- Spatial vectors are Pinocchio's: linear part first, in body coordinates, at the body frame's origin. A twist
  is [v; omega], a wrench [f; m].
- A *placement* (R, p) of frame B in frame A: columns of R are B's axes in A, p is B's origin in A.
- `V_dot` is the *spatial* acceleration (Pinocchio's `data.a`): linear part = classical acceleration of the
    origin minus omega x v. Users' tables hold classical accelerations, which are converted on input.
- `X` moves a twist from a base frame to a body frame: X = [R^T, -R^T hat(p); 0, R^T], Eq. (26); a wrench
  moves back to the base frame through X^T.
- Every function takes leading batch axes. Products and rotations take objects (symbols) like numbers, by
    `symbols`; what needs comparisons refuses them.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

#: Array of floats of any shape.
Array = NDArray[np.float64]
#: Indices of rows, columns, bodies or samples, shape (k,).
Index = NDArray[np.intp]
#: Boolean mask of rows, columns or samples, True where selected.
Mask = NDArray[np.bool_]
#: Added to squared lengths to avoid 0 / 0; it changes no bit of any length that matters.
TINY = 1e-300
#: Largest number accepted in states and loads: the sixth power is finite, so no product of them overflows.
LARGEST = 1e50


#: For each number of axes, the order that brings the samples from the first to the last place, and back.
_SAMPLES_LAST = [((*range(1, n), 0), (n - 1, *range(n - 1))) if n else ((), ()) for n in range(8)]
#: Entries up to which a product of vectors with equally many axes takes its time for calls of NumPy.
_FEW = 10_000
#: The same where the numbers of axes differ.
_COPIED = 300
#: The components after each of x, y, z, then those before; and the reverse.
_PLUS_MINUS, _MINUS_PLUS = np.array([1, 2, 0, 2, 0, 1]), np.array([2, 0, 1, 1, 2, 0])


#: NumPy's `einsum` without its search for arrays of other packages, a fifth of the time of a small product.
einsum: Callable[..., Any] = inspect.unwrap(np.einsum)

#: Silences CasADi's warning where NumPy functions take its symbols.
numpy_on_symbols = partial(warnings.catch_warnings, action="ignore", category=FutureWarning)


def _of_numbers_or_symbols(function: np.ufunc) -> Callable[..., Any]:
    """Return a function that takes arrays of numbers, and arrays of objects entry by entry."""

    def apply(*x: Array) -> Any:
        """Apply the function."""
        if x[0].dtype != object:
            return function(*x)
        from .symbols import by_entry

        return by_entry(function.__name__, *x)

    return apply


cos, sin, sqrt, arctan2 = map(_of_numbers_or_symbols, (np.cos, np.sin, np.sqrt, np.arctan2))


def slices(lengths: Iterable[int]) -> list[slice]:
    """Return consecutive slices of the given lengths, starting at zero."""
    return [slice(a, b) for a, b in pairwise(accumulate(lengths, initial=0))]


def indices(parts: Iterable[slice]) -> Index:
    """Return the indices in slices, one after the other."""
    return np.array([i for at in parts for i in range(at.start, at.stop)], dtype=int)


def samples_inside(shape: tuple[int, ...], dtype: DTypeLike = float) -> Array:
    """Return zeros of shape (T, ...) with the samples contiguous in memory (long inner loops are fast)."""
    return np.zeros((*shape[1:], shape[0]), dtype).transpose(_SAMPLES_LAST[len(shape)][1])


def run(numbers: Index) -> Index | slice:
    """Return numbers from zero on as a slice if they are equally spaced: NumPy reads it without a copy."""
    every = numbers.tolist()
    steps = {after - before for before, after in pairwise(every)} or {1}
    step = steps.pop()
    return slice(every[0], every[-1] + 1, step) if not steps and step > 0 and every else numbers


def select(x: Array, numbers: Index | slice) -> Array:
    """Return x[:, numbers] for x of shape (T, bodies, ...), with the samples contiguous in memory."""
    if isinstance(numbers, slice):
        return x[:, numbers]
    inner, _ = _SAMPLES_LAST[x.ndim]
    chosen: Array = x.transpose(inner).take(numbers, 0)
    return chosen.transpose(_SAMPLES_LAST[chosen.ndim][1])


def symbolic(*arrays: Array) -> bool:
    """Return whether some array holds symbols."""
    for x in arrays:  # noqa: SIM110 - `any` takes as long as a product
        if x.dtype.hasobject:
            return True
    return False


def added(a: Array, b: Array) -> Array:
    """Compute a + b; NumPy's own sum of symbols takes eight times longer."""
    if symbolic(a, b):
        from .symbols import plus

        return np.asarray(plus(a, b))
    return a + b


def subtracted(a: Array, b: Array) -> Array:
    """Compute a - b, as `added` computes a + b."""
    if symbolic(a, b):
        from .symbols import minus

        return np.asarray(minus(a, b))
    return a - b


def multiplied(a: Array, b: Array) -> Array:
    """Compute a * b, as `added` computes a + b."""
    if symbolic(a, b):
        from .symbols import times

        return np.asarray(times(a, b))
    return a * b


def cross(a: Array, b: Array) -> Array:
    """Compute a x b along the last axis, shapes (..., 3), without the overhead of np.cross."""
    if symbolic(a, b):
        from .symbols import cross

        return cross(a, b)
    if a.ndim == b.ndim and a.size + b.size <= _FEW:
        x, y = a.swapaxes(0, -1), b.swapaxes(0, -1)  # components first, samples last
        products = x.take(_PLUS_MINUS, 0) * y.take(_MINUS_PLUS, 0)
        few: Array = (products[:3] - products[3:]).swapaxes(0, -1)
        return few
    if a.size + b.size <= _COPIED:
        products = a.take(_PLUS_MINUS, -1) * b.take(_MINUS_PLUS, -1)
        return products[..., :3] - products[..., 3:]
    out = np.multiply(a, b)  # allocates the result's shape and memory order
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    np.subtract(a1 * b2, a2 * b1, out=out[..., 0])
    np.subtract(a2 * b0, a0 * b2, out=out[..., 1])
    np.subtract(a0 * b1, a1 * b0, out=out[..., 2])
    return out


def along(a: Array, b: Array) -> Array:
    """Compute scalar products of vectors (..., n), shape (..., 1)."""
    out: Array = np.sum(a * b, axis=-1, keepdims=True)
    return out


def length(x: Array) -> Array:
    """Compute lengths of vectors (..., n), shape (..., 1); none is quite zero."""
    out: Array = sqrt(along(x, x) + TINY)
    return out


def compose(A: Array, B: Array) -> Array:
    """Compute A B for matrices (..., m, k) and (..., k, n); einsum keeps the memory order, unlike matmul."""
    if symbolic(A, B):
        from .symbols import compose

        return compose(A, B)
    out: Array = einsum("...ij,...jk->...ik", A, B)
    return out


def rotate(R: Array, x: Array) -> Array:
    """Compute R x for matrices (..., m, n) and vectors (..., n)."""
    if symbolic(R, x):
        return compose(R, x[..., None])[..., 0]
    out: Array = einsum("...ij,...j->...i", R, x)
    return out


def rotate_back(R: Array, x: Array) -> Array:
    """Compute R^T x for matrices (..., m, n) and vectors (..., m)."""
    if symbolic(R, x):
        return rotate(np.swapaxes(R, -1, -2), x)
    out: Array = einsum("...ji,...j->...i", R, x)
    return out


def congruence(B: Array, M: Array) -> Array:
    """Compute B^T M B for B of shape (..., n, N) and M of shape (..., n, n)."""
    out: Array = np.matmul(np.swapaxes(B, -1, -2), np.matmul(M, B))
    return out


def hat(x: Array) -> Array:
    """Return the skew-symmetric matrix of x, shape (..., 3, 3): its product with y is x cross y."""
    out, back = np.zeros((*x.shape, 3)).astype(np.result_type(x, float), copy=False), -x
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = back[..., 2], x[..., 1], back[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = x[..., 2], back[..., 1], x[..., 0]
    return out


def motion_to_body(R: Array, p: Array, V: Array) -> Array:
    """Compute X V: transform a twist from the base frame to a body at (R, p), shape (..., 6), Eq. (24)."""
    v, w = V[..., :3], V[..., 3:]
    return np.concatenate([rotate_back(R, added(v, cross(w, p))), rotate_back(R, w)], axis=-1)


def motion_to_base(R: Array, p: Array, V: Array) -> Array:
    """Compute X^-1 V: transform a twist from a body at (R, p) to the base frame, shape (..., 6)."""
    w = rotate(R, V[..., 3:])
    return np.concatenate([added(rotate(R, V[..., :3]), cross(p, w)), w], axis=-1)


def to_body_axes(R: Array, J: Array) -> Array:
    """Turn Jacobians, shape (T, 6, n), from base axes to axes R, shape (T, 3, 3)."""
    Rt = np.swapaxes(R, 1, 2)
    return np.concatenate([np.matmul(Rt, J[:, :3]), np.matmul(Rt, J[:, 3:])], axis=1)


def wrench_to_base(R: Array, p: Array, W: Array) -> Array:
    """Compute X^T W: transform a wrench from the body frame to the base frame, shape (..., 6)."""
    f = rotate(R, W[..., :3])
    return np.concatenate([f, added(rotate(R, W[..., 3:]), cross(p, f))], axis=-1)


def wrench_to_body(R: Array, p: Array, W: Array) -> Array:
    """Compute X^-T W: transform a wrench from the base frame to a body at (R, p), shape (..., 6)."""
    f = W[..., :3]
    return np.concatenate([rotate_back(R, f), rotate_back(R, subtracted(W[..., 3:], cross(p, f)))], axis=-1)


def motion_matrix(R: Array, p: Array) -> Array:
    """Build the motion transform X, shape (..., 6, 6), Eq. (26)."""
    Rt = np.swapaxes(R, -1, -2)
    X = np.zeros((*R.shape[:-2], 6, 6), np.result_type(R, p, float))
    X[..., :3, :3] = X[..., 3:, 3:] = Rt
    X[..., :3, 3:] = -np.matmul(Rt, hat(p))
    return X


def crm(V: Array, U: Array) -> Array:
    """Compute the spatial product of two twists, V cross U, shapes (..., 6)."""
    v, w = V[..., :3], V[..., 3:]
    return np.concatenate([added(cross(w, U[..., :3]), cross(v, U[..., 3:])), cross(w, U[..., 3:])], axis=-1)


def crf(V: Array, F: Array) -> Array:
    """Compute the spatial product of a twist and a wrench, V cross* F, shapes (..., 6)."""
    v, w, f = V[..., :3], V[..., 3:], F[..., :3]
    return np.concatenate([cross(w, f), added(cross(w, F[..., 3:]), cross(v, f))], axis=-1)


def spatial_inertia(mass: float, com: Array, inertia: Array) -> Array:
    """Build the 6-D inertia about the body frame's origin, shape (6, 6), Eq. (13).

    Args:
        mass: Mass [kg].
        com: Centre of mass, shape (3,), [m], body frame.
        inertia: Inertia about the centre of mass, shape (3, 3), [kg m^2], body axes.
    """
    c = hat(np.asarray(com, dtype=float))
    out = np.zeros((6, 6))
    out[:3, :3] = mass * np.eye(3)
    out[:3, 3:], out[3:, :3] = -mass * c, mass * c
    out[3:, 3:] = inertia + mass * c @ c.T
    return out


def rotation_from_axis_angle(axis: Array, cos: Array, sin: Array) -> Array:
    """Build rotations about unit axes (..., 3) by angles given as cosine and sine (...,)."""
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    d = 1.0 - cos
    shape, kind = np.broadcast(x, cos).shape, np.result_type(axis, cos, sin, float)
    R = samples_inside((*shape, 3, 3), kind) if shape else np.empty((3, 3), kind)
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = cos + d * x * x, d * x * y - sin * z, d * x * z + sin * y
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = d * x * y + sin * z, cos + d * y * y, d * y * z - sin * x
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = d * x * z - sin * y, d * y * z + sin * x, cos + d * z * z
    return R


def rotation_from_quaternion(quat: Array) -> Array:
    """Build rotations from quaternions x, y, z, w, shape (..., 4): symbols of length 1, numbers of any."""
    s = 2.0 if symbolic(quat) else 2.0 / np.sum(quat * quat, axis=-1)
    x, y, z, w = quat[..., 0], quat[..., 1], quat[..., 2], quat[..., 3]
    kind = np.result_type(quat, float)
    R = samples_inside((*quat.shape[:-1], 3, 3), kind) if quat.ndim > 1 else np.empty((3, 3), kind)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    wx, wy, wz = x * w, y * w, z * w
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = 1 - s * (yy + zz), s * (xy - wz), s * (xz + wy)
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = s * (xy + wz), 1 - s * (xx + zz), s * (yz - wx)
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = s * (xz - wy), s * (yz + wx), 1 - s * (xx + yy)
    return R


def quaternion_from_rotation(R: Array) -> Array:
    """Compute unit quaternions x, y, z, w with w >= 0 from rotations (..., 3, 3), stable at every angle."""
    m00, m11, m22 = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    wx, wy, wz = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    # The row of the 4x4 matrix 4 q q^T with the largest diagonal entry is a well-scaled multiple of q.
    rows = np.empty((*R.shape[:-2], 16), R.dtype)
    for i, x in enumerate((
        1 + m00 - m11 - m22, xy, xz, wx,
        xy, 1 - m00 + m11 - m22, yz, wy,
        xz, yz, 1 - m00 - m11 + m22, wz,
        wx, wy, wz, 1 + m00 + m11 + m22,
    )):  # fmt: skip
        rows[..., i] = x
    every, best = rows.reshape(-1, 4, 4), rows[..., ::5].argmax(axis=-1)
    quat = every[np.arange(len(every)), best.ravel()].reshape(*best.shape, 4)
    quat = quat / np.linalg.norm(quat, axis=-1, keepdims=True)
    out: Array = np.where(quat[..., 3:] < 0, -quat, quat)
    return out


def sines(R: Array) -> Array:
    """Compute the axes of rotations (..., 3, 3) times the sines of their angles, shape (..., 3)."""
    i, j = [2, 0, 1], [1, 2, 0]
    out: Array = 0.5 * (R[..., i, j] - R[..., j, i])
    return out


def rotation_vector(R: Array) -> Array:
    """Compute the log of rotations (..., 3, 3) as rotation vectors (..., 3), accurate up to half a turn."""
    return vector_from_quaternion(quaternion_from_rotation(R))


def vector_from_quaternion(quat: Array) -> Array:
    """Compute the log of unit quaternions x, y, z, w, shape (..., 4), as rotation vectors (..., 3)."""
    v, w = quat[..., :3], quat[..., 3:]
    sine = np.sqrt(einsum("...i,...i->...", v, v))[..., None]
    known = sine > 1e-9
    half = np.arctan2(sine, np.abs(w)) / np.where(known, sine, 1.0)
    out: Array = np.copysign(np.where(known, 2.0 * half, 2.0), w + 0.0) * v  # -0 turns as 0 does
    return out


def quaternion_from_vector(r: Array) -> Array:
    """Compute unit quaternions x, y, z, w of the exp of rotation vectors (..., 3)."""
    angle = np.linalg.norm(r, axis=-1, keepdims=True)
    axis = r / np.where(angle > 0, angle, 1.0)
    return np.concatenate([np.sin(angle / 2) * axis, np.cos(angle / 2)], axis=-1)


def rotation_from_vector(r: Array) -> Array:
    """Compute the exp of rotation vectors (..., 3) as rotations (..., 3, 3)."""
    angle = np.linalg.norm(r, axis=-1)
    axis = r / np.where(angle > 0, angle, 1.0)[..., None]
    return rotation_from_axis_angle(axis, np.cos(angle), np.sin(angle))


def in_turn(here: Array, there: Array) -> Array:
    """Return the rows of two arrays, shape (n, ...), in turn, shape (2 n, ...)."""
    return np.stack([here, there], axis=1).reshape(-1, *here.shape[1:])
