"""The 6-D helpers against Pinocchio, and rotations where they are hard: tiny, and half a turn."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from hybridyn.compiled.equations.expressions import pack, unpack
from hybridyn.spatial import (
    compose,
    crf,
    crm,
    cross,
    hat,
    motion_matrix,
    motion_to_base,
    motion_to_body,
    quaternion_from_rotation,
    rotate,
    rotate_back,
    rotation_from_axis_angle,
    rotation_from_quaternion,
    rotation_from_vector,
    rotation_vector,
    samples_inside,
    select,
    spatial_inertia,
    wrench_to_base,
)
from tests.support.comparing import ROUNDING, close_to, refused

SAMPLES = 50
HALF_TURN = (
    1e-7  # near half a turn an error of 1e-16 in R tilts the axis of its quaternion by no more than 1e-15
)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def placements(rng: np.random.Generator) -> list[pin.SE3]:
    return [pin.SE3(pin.exp3(rng.normal(size=3) * 2), rng.normal(size=3)) for _ in range(SAMPLES)]


def test_twists_and_wrenches_change_frame_as_in_pinocchio(rng: np.random.Generator) -> None:
    M, x = placements(rng), rng.normal(size=(SAMPLES, 6))
    R, p = np.array([m.rotation for m in M]), np.array([m.translation for m in M])
    there = np.array([m.actInv(pin.Motion(t)).vector for m, t in zip(M, x, strict=True)])
    close_to(motion_to_body(R, p, x), there, ROUNDING)
    close_to(motion_to_base(R, p, there), x, ROUNDING)
    close_to(np.einsum("tij,tj->ti", motion_matrix(R, p), x), there, ROUNDING)
    back = np.array([m.act(pin.Force(t)).vector for m, t in zip(M, x, strict=True)])
    close_to(wrench_to_base(R, p, x), back, ROUNDING)
    close_to(motion_to_body(R[0], p[0], x[0]), there[0], ROUNDING)


def test_spatial_products_are_pinocchios(rng: np.random.Generator) -> None:
    V, U = rng.normal(size=(2, SAMPLES, 6))
    pairs = list(zip(V, U, strict=True))
    close_to(crm(V, U), np.array([pin.Motion(a).cross(pin.Motion(b)).vector for a, b in pairs]), ROUNDING)
    close_to(crf(V, U), np.array([pin.Motion(a).cross(pin.Force(b)).vector for a, b in pairs]), ROUNDING)
    close_to(cross(V[:, :3], U[:, :3]), np.cross(V[:, :3], U[:, :3]), ROUNDING)
    close_to(np.einsum("tij,tj->ti", hat(V[:, :3]), U[:, :3]), np.cross(V[:, :3], U[:, :3]), ROUNDING)


def test_vector_product_does_not_depend_on_memory_order(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 7, 3))
    inside = samples_inside((7, 3))
    inside[:] = a
    assert np.array_equal(cross(inside, b), cross(a, b))
    assert np.array_equal(cross(a[0], b), cross(np.tile(a[0], (7, 1)), b))
    axes = np.random.default_rng(5).normal(size=(200, 3, 3))  # of other orders in memory, few and many
    many = cross(axes[:, :1], axes.swapaxes(1, 2))
    assert np.array_equal(many, np.cross(axes[:, :1], axes.swapaxes(1, 2)))
    assert np.array_equal(many[:7], cross(axes[:7, :1], axes[:7].swapaxes(1, 2)))
    x = samples_inside((7, 4, 3))
    x[:] = rng.normal(size=(7, 4, 3))
    assert np.array_equal(select(x, np.array([2, 0])), x[:, [2, 0]])


def test_inertia_is_pinocchios(rng: np.random.Generator) -> None:
    A = rng.normal(size=(3, 3))
    com, inertia = rng.normal(size=3), A @ A.T
    close_to(spatial_inertia(1.7, com, inertia), pin.Inertia(1.7, com, inertia).matrix(), ROUNDING)


def test_rotations_about_axes(rng: np.random.Generator) -> None:
    axis, angle = np.array([0.6, 0.0, -0.8]), rng.uniform(-7, 7, SAMPLES)
    R = rotation_from_axis_angle(axis, np.cos(angle), np.sin(angle))
    close_to(R, np.array([pin.AngleAxis(t, axis).matrix() for t in angle]), ROUNDING)
    axes = np.eye(3)
    one = rotation_from_axis_angle(axes, np.cos(angle[:3]), np.sin(angle[:3]))
    close_to(
        one, np.array([pin.AngleAxis(t, a).matrix() for t, a in zip(angle, axes, strict=False)]), ROUNDING
    )
    close_to(compose(R, R), R @ R, ROUNDING)
    x = rng.normal(size=(SAMPLES, 3))
    close_to(rotate_back(R, rotate(R, x)), x, ROUNDING)


def test_quaternions_of_any_length_and_sign(rng: np.random.Generator) -> None:
    quat = rng.normal(size=(SAMPLES, 4))
    unit = quat / np.linalg.norm(quat, axis=1, keepdims=True)
    R = rotation_from_quaternion(quat)
    close_to(R, np.array([pin.Quaternion(x).matrix() for x in unit]), ROUNDING)
    back = quaternion_from_rotation(R)
    assert (back[:, 3] >= 0).all()
    close_to(back, unit * np.sign(unit[:, 3:]), ROUNDING)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-9, 2e-9, 1e-5, 1.0, 3.0, np.pi - 1e-3])
def test_rotation_vectors_come_back(rng: np.random.Generator, angle: float) -> None:
    axis = rng.normal(size=(SAMPLES, 3))
    r = angle * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    back = rotation_vector(rotation_from_vector(r))
    assert np.abs(back - r).max() <= ROUNDING * max(angle, 1e-3)  # R holds small angles to rounding of one


@pytest.mark.parametrize("short", [HALF_TURN, 1e-10, 1e-15, 0.0])
def test_rotation_vectors_near_half_a_turn(rng: np.random.Generator, short: float) -> None:
    """Length and axis stay right up to half a turn, where either sign of the axis is the same rotation."""
    axis = np.concatenate([rng.normal(size=(SAMPLES, 3)), np.eye(3), -np.eye(3), [[1, 1, 0], [0, -1, 1]]])
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    R = rotation_from_vector((np.pi - short) * axis)
    r = rotation_vector(R)
    length = np.linalg.norm(r, axis=1)
    close_to(length, np.full(len(axis), np.pi - short), 10 * ROUNDING)
    close_to(np.abs(np.einsum("ti,ti->t", r, axis)), length, 10 * ROUNDING)
    close_to(rotation_from_vector(r), R, 10 * ROUNDING)


@pytest.mark.parametrize("batch", [(), (2,)])
@pytest.mark.parametrize(
    ("function", "shapes"),
    [
        (cross, [(3,), (3,)]),
        (hat, [(3,)]),
        (compose, [(3, 3), (3, 3)]),
        (rotate, [(3, 3), (3,)]),
        (rotate_back, [(3, 3), (3,)]),
        (motion_to_body, [(3, 3), (3,), (6,)]),
        (wrench_to_base, [(3, 3), (3,), (6,)]),
        (motion_matrix, [(3, 3), (3,)]),
        (crm, [(6,), (6,)]),
        (crf, [(6,), (6,)]),
        (lambda x: rotation_from_quaternion(x / np.sqrt(np.sum(x * x, axis=-1, keepdims=True))), [(4,)]),
    ],
)
def test_symbols_give_the_same_as_numbers(
    function: Callable[..., Any],
    shapes: list[tuple[int, ...]],
    batch: tuple[int, ...],
    rng: np.random.Generator,
) -> None:
    numbers = [rng.normal(size=(*batch, *shape)) for shape in shapes]
    columns = [ca.SX.sym("x", x.size) for x in numbers]
    symbols = [unpack(column).reshape(x.shape) for column, x in zip(columns, numbers, strict=True)]
    written = ca.Function("f", columns, [pack(function(*symbols))])
    wanted = function(*numbers)
    close_to(np.array(written(*(x.ravel() for x in numbers))).reshape(wanted.shape), wanted, ROUNDING)


@pytest.mark.parametrize("function", [quaternion_from_rotation, rotation_vector])
def test_comparisons_of_symbols_are_refused(function: Callable[..., Any]) -> None:
    refused(
        lambda: function(unpack(ca.SX.sym("R", 9)).reshape(1, 3, 3)), RuntimeError, "truth value of a CasADi"
    )


def test_products_of_symbols_are_those_of_numbers(rng: np.random.Generator) -> None:
    """With leading axes that broadcast; products with zeros leave no symbol."""
    R, p, x = rng.normal(size=(2, 3, 3)), rng.normal(size=(2, 1, 3)), rng.normal(size=3)
    columns = [ca.SX.sym("R", R.size), ca.SX.sym("p", p.size), ca.SX.sym("x", 3)]
    S, s, y = (unpack(column).reshape(of.shape) for column, of in zip(columns, (R, p, x), strict=True))
    for function, numbers, symbols in (
        (compose, (R, R), (S, S)),
        (rotate, (R[:, None], p), (S[:, None], s)),
        (rotate_back, (R, x), (S, y)),
        (cross, (p, x), (s, y)),
    ):
        found = ca.Function("found", columns, [pack(function(*symbols))])
        right = function(*numbers)
        close_to(np.array(found(*(of.ravel() for of in (R, p, x)))).reshape(right.shape), right, ROUNDING)
    assert rotate(np.diag([1.0, 0.0, 1.0]), y)[1] == 0.0
