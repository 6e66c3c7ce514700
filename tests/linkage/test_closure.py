"""Every type of closure: rows and drift by finite differences, residuals up to half a turn, couplings."""

import numpy as np
import pytest

from hybridyn.description.records import Curve
from hybridyn.joints.kinds import JointKind
from hybridyn.linkage.closure_rows import directions_of, residual_of, rows_of
from hybridyn.linkage.closures import Closures, TreeClosure
from hybridyn.linkage.couplings import TreeCoupling
from hybridyn.linkage.tree import Tree, TreeJoint
from hybridyn.spatial import Array, rotation_from_axis_angle, rotation_from_vector
from hybridyn.structure.bodies import merge_fixed_joints
from hybridyn.structure.graph import body_closure
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.robots.sketch import CLOSURES, ROW_COUNT
from tests.support.comparing import ROUNDING, close_to
from tests.support.extras import needs
from tests.support.samples import some

STEP = 1e-5  # of the central differences
DIFFERENCED = 1e-8  # truncation of the central differences, relative; rounding of second ones is alike
CONSISTENT = 1e-11  # rates and accelerations that the oracle made consistent by its own rows
SAMPLES = 8
EXACTLY = 1e-15
SMALL_TURN = 1e-3
TURNED = SMALL_TURN**3  # a sine less its angle: a sixth of the cube of up to 1.8 SMALL_TURN


def two_arms() -> Tree:
    """Return two arms from one base, with every kind of joint, body 4 and body 8 at their ends."""
    rng = np.random.default_rng(0)
    kinds = ["revolute", "spherical", "prismatic", "continuous", "planar", "revolute", "floating", "revolute"]
    joints = []
    for i, kind in enumerate(kinds):
        axis = rng.normal(size=3)
        R = rotation_from_vector(rng.normal(size=3))
        parent = 0 if i == 4 else i
        joints.append(
            TreeJoint("", JointKind(kind), parent, R, rng.normal(size=3), axis / np.linalg.norm(axis))
        )
    return Tree(joints)


def closure(name: str, frames: tuple[Array, Array, Array, Array] | None = None) -> TreeClosure:
    rng = np.random.default_rng(2)
    if frames is None:
        frames = tuple(f(rng.normal(size=3)) for f in (rotation_from_vector, np.array) * 2)  # type: ignore[assignment]
    Ra, pa, Rb, pb = frames  # type: ignore[misc]
    translations, rotation = CLOSURES[name]
    return TreeClosure(name, name, 4, Ra, pa, 8, Rb, pb, translations, rotation)


def postures(tree: Tree, size: float = 1.0) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(4)
    q = tree.integrate(np.tile(tree.neutral(), (SAMPLES, 1)), size * rng.normal(size=(SAMPLES, tree.nv)))
    v, a = rng.normal(size=(2, SAMPLES, tree.nv))
    return q, v, a


def closed_there(tree: Tree, name: str) -> tuple[Closures, Array, Array, Array]:
    """Return one closure that is closed at one posture, with everything that it leaves free moved away."""
    q, v, a = (x[:1] for x in postures(tree))
    rng = np.random.default_rng(9)
    motion = tree.sweep(q)
    translations, rotation = CLOSURES[name]
    A, p = rotation_from_vector(rng.normal(size=3)), rng.normal(size=3)
    left = np.array([0.0 if i in translations else 0.4 for i in range(3)])
    z = np.array([0.0, 0.0, 1.0])
    turn = {
        "fixed": np.eye(3),
        "parallel": rotation_from_axis_angle(z, np.cos(2.2), np.sin(2.2)),
        "perpendicular": rotation_from_axis_angle(np.array([1.0, 0, 0]), 0.0, 1.0)
        @ rotation_from_vector(1.3 * z),
        "free": rotation_from_vector(rng.normal(size=3)),
    }[rotation]
    frames = []
    for body, (R, x) in ((4, (A, p)), (8, (A @ turn, p + A @ left))):
        frames += [motion.R[0, body].T @ R, motion.R[0, body].T @ (x - motion.p[0, body])]
    return Closures(tree, [closure(name, tuple(frames))], []), q, v, a


@pytest.mark.parametrize("name", CLOSURES)
def test_rows_of_symbols_are_those_of_numbers(name: str) -> None:
    """Residuals of rotations are sines there: they differ from angles by their cubes."""
    ca = needs("compiled")
    from hybridyn.compiled.equations.expressions import pack, symbols

    (translations, rotation), rng = CLOSURES[name], np.random.default_rng(3)
    A, turn = (rotation_from_vector(size * rng.normal(size=3)) for size in (1.0, SMALL_TURN))
    z = np.array([0.0, 0.0, 1.0])
    upright = rotation_from_axis_angle(np.array([1.0, 0.0, 0.0]), 0.0, 1.0)
    B = {"perpendicular": upright, "parallel": rotation_from_vector(2.0 * z)}.get(rotation, np.eye(3))
    given = [A, rng.normal(size=3), A @ turn @ B, rng.normal(size=3), *rng.normal(size=(2, 4, 3))]
    named = [symbols(f"x{i}", x.size) for i, x in enumerate(given)]

    def both(A: Array, pa: Array, B: Array, pb: Array, *columns: Array) -> tuple[Array, Array]:
        """Return residual and rows."""
        residual = residual_of(translations, rotation, (A, pa), (B, pb))
        directions = directions_of(translations, rotation, A, B[:, 2])
        return residual, rows_of(directions, (columns[0], columns[1]))

    written = both(*(x.reshape(of.shape) for (_, x), of in zip(named, given, strict=True)))
    function = ca.Function("rows", [x for x, _ in named], [pack(x) for x in written])
    found = [np.array(x).ravel() for x in function(*(x.ravel() for x in given))]
    residual, rows = both(*given)
    close_to(found[1].reshape(rows.shape), rows, ROUNDING)
    assert np.abs(found[0] - residual).max() < TURNED


# -------------------------------------------------------------------- derivatives


@pytest.mark.parametrize("name", CLOSURES)
def test_rows_are_the_derivatives_of_the_residual(name: str) -> None:
    """At a closed posture, for any velocity."""
    tree = two_arms()
    closures, q, _, _ = closed_there(tree, name)
    assert np.abs(closures.residual(q, tree.sweep(q))).max() < ROUNDING
    assert closures.rows == ROW_COUNT[name]
    q = np.tile(q, (tree.nv, 1))
    for_each = np.eye(tree.nv)
    ends = [tree.integrate(q, sign * STEP * for_each) for sign in (1, -1)]
    ahead, behind = (closures.residual(x, tree.sweep(x)) for x in ends)
    K = closures.matrix(tree.sweep(q[:1]))[0]
    assert np.abs((ahead - behind) / (2 * STEP) - K.T).max() < DIFFERENCED * np.abs(K).max()
    assert np.linalg.matrix_rank(K) == ROW_COUNT[name]


@pytest.mark.parametrize("name", CLOSURES)
def test_drift_is_the_derivative_of_the_rows(name: str) -> None:
    """At open postures too: the second derivative is that of K v along the motion."""
    tree = two_arms()
    terms = (0, 0.7), (3, -2.0), (5, 0.1)
    bent = Curve(((2, 0.9), (5, -0.4)), (0.3, -0.5, 0.2), 0.15)
    couplings = [TreeCoupling("", terms, 0.3, bent), TreeCoupling("", terms, 0.3)]
    closures = Closures(tree, [closure(name)], couplings)
    q, v, a = postures(tree)
    K_v, K_v_dot = closures.rates(tree.sweep(q, v, a), v)
    close_to(np.einsum("tij,tj->ti", closures.matrix(tree.sweep(q)), v), K_v, ROUNDING)
    gamma = closures.rates(tree.sweep(q, v), v)[1]
    K_a = np.einsum("tij,tj->ti", closures.matrix(tree.sweep(q)), a)
    on_closure = slice(0, closures.rows - 2)
    close_to((K_a + gamma)[:, on_closure], K_v_dot[:, on_closure], ROUNDING)
    assert not gamma[:, -1].any()
    along = []
    for h in (STEP, -STEP):
        end = tree.integrate(q, h * v + 0.5 * h * h * a)
        along.append(np.einsum("tij,tj->ti", closures.matrix(tree.sweep(end)), v + h * a))
    differenced = (along[0] - along[1]) / (2 * STEP)
    assert np.abs(differenced - K_a - gamma).max() < DIFFERENCED * np.abs(K_v_dot).max()


def test_groups_of_equal_closures_are_evaluated_each_by_itself() -> None:
    tree = two_arms()
    rng = np.random.default_rng(1)
    many = [
        closure(name, tuple(f(rng.normal(size=3)) for f in (rotation_from_vector, np.array) * 2))
        for name in ("fixed", "spherical", "fixed", "universal", "spherical", "revolute")
    ]
    together = Closures(tree, many, [])
    q, v, a = postures(tree)
    motion = tree.sweep(q, v, a)
    K, r, rates = together.matrix(motion), together.residual(q, motion), together.rates(motion, v)
    for one, at in zip(many, together.row_slices, strict=True):
        alone = Closures(tree, [one], [])
        wanted = alone.matrix(motion), alone.residual(q, motion), *alone.rates(motion, v)
        close_to(tuple(x[:, at] for x in (K, r, *rates)), wanted, EXACTLY)
    free = rng.random(tree.nv) < 0.5
    assert np.array_equal(together.moved_by(free).matrix(motion)[:, :, free], K[:, :, free])
    rows, cols = rng.uniform(0.5, 2, together.rows), rng.uniform(0.5, 2, tree.nv)
    close_to(together.matrix(motion, (rows, cols)), K * rows[:, None] * cols, ROUNDING)


@pytest.mark.parametrize("kind", some(k for k in KINDS if KINDS[k].loops))
def test_oracles_states_satisfy_the_rows(kind: str) -> None:
    """Residual, rates and accelerations of states that another derivation closed."""
    description = random_mechanism(4, kind=kind)
    bodies = merge_fixed_joints(description)
    tree = Tree([TreeJoint("", j.joint.kind, j.parent, j.R, j.p, j.joint.axis) for j in bodies.joints])
    number = {j.joint.name: i for i, j in enumerate(bodies.joints)}
    couplings = [
        TreeCoupling("", tuple((number[n], k) for n, k in c.terms), c.offset) for c in description.couplings
    ]
    closures = Closures(tree, [body_closure(bodies, c, description) for c in description.closures], couplings)
    q, v, a = random_states(description, "fixed", 4, 2)
    motion = tree.sweep(q, v, a)
    assert np.abs(closures.residual(q, motion)).max() < CONSISTENT
    first, _ = closures.rates(motion, v)
    K, gamma = closures.matrix(motion), closures.rates(tree.sweep(q, v), v)[1]
    assert np.abs(first).max() < CONSISTENT * np.abs(v).max()
    assert np.abs(np.einsum("tij,tj->ti", K, a) + gamma).max() < CONSISTENT * max(
        np.abs(a).max(), np.abs(gamma).max()
    )


# -------------------------------------------------------------------- residuals far from closed


def turned(rotation: str, r: Array) -> Array:
    """Return the rotation residual when B is turned by rotation vectors from A, shape (T, rows)."""
    zero = np.zeros(3)
    tree = Tree([TreeJoint("", JointKind.SPHERICAL, 0, np.eye(3), zero, np.array([0.0, 0, 1]))])
    one = TreeClosure("", "", 0, np.eye(3), zero, 1, np.eye(3), zero, (), rotation)
    q = tree.integrate(np.tile(tree.neutral(), (len(r), 1)), r)
    return Closures(tree, [one], []).residual(q, tree.sweep(q))


@pytest.mark.parametrize("short", [1e-3, 1e-6, 1e-8, 1e-9, 1e-12, 0.0])
@pytest.mark.parametrize("rotation", ["fixed", "parallel"])
def test_residual_near_half_a_turn_is_half_a_turn(rotation: str, short: float) -> None:
    """Never small, never NaN, and pointing along the turn: Newton can walk back from there."""
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    axes = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    r = (np.pi - short) * axes
    out = turned(rotation, r)
    # The axis of B tilts by the turn; about x it moves towards -y, about y towards x.
    expected = r if rotation == "fixed" else np.stack([r[:, 1], -r[:, 0]], axis=1)
    close_to(np.linalg.norm(out, axis=1), np.full(len(r), np.pi - short), 1e-8)
    if short > 1e-8:
        close_to(out, expected, 1e-8)


@pytest.mark.parametrize("short", [1e-12, 1e-9, 1e-5, 1.0])
@pytest.mark.parametrize("rotation", ["fixed", "parallel"])
def test_residual_is_the_angle(rotation: str, short: float) -> None:
    out = turned(rotation, np.array([[0.6 * short, 0.8 * short, 0.0]]))
    assert abs(np.linalg.norm(out) - short) < ROUNDING * max(1e-2, short)


def test_parallel_axes_that_should_be_perpendicular_are_not_closed() -> None:
    out = turned("perpendicular", np.array([[0.0, 0, 2.0], [np.pi, 0, 0], [np.pi / 2, 0, 0]]))
    close_to(out, np.array([[1.0], [-1.0], [0.0]]), ROUNDING)


# -------------------------------------------------------------------- couplings


def gear(kinds: list[str], terms: tuple[tuple[int, float], ...], angles: Array, offset: float = 0.0) -> Array:
    """Return a coupling's residual at joint positions, shape (T,)."""
    z = np.array([0.0, 0, 1])
    tree = Tree([TreeJoint("", JointKind(k), i, np.eye(3), np.zeros(3), z) for i, k in enumerate(kinds)])
    q = tree.integrate(np.tile(tree.neutral(), (len(angles), 1)), angles)
    return Closures(tree, [], [TreeCoupling("", terms, offset)]).residual(q, tree.sweep(q))[:, 0]


def test_a_coupling_of_joints_that_count_turns_knows_every_turn() -> None:
    angles = np.array([[0.3, 0.1], [2 * np.pi, 0.0]])
    out = gear(["revolute", "prismatic"], ((0, 2.0), (1, -3.0)), angles, 0.2)
    close_to(out, 2 * angles[:, 0] - 3 * angles[:, 1] - 0.2, ROUNDING)


@pytest.mark.parametrize("ratio", [1.0, 2.0, 0.5, -1.5, 0.7, -4 / 3])
def test_a_gear_turns_on_for_ever(ratio: float) -> None:
    """A posture of any number of turns is closed, and one that is a whole turn away is open by it."""
    turn = np.linspace(-20, 20, 101)
    kinds, terms = ["revolute"] * 2, ((0, 1.0), (1, -ratio))
    closed = np.stack([ratio * turn + 0.4, turn], axis=1)
    assert np.abs(gear(kinds, terms, closed, 0.4)).max() < 1e-12  # forty turns counted in radians
    closed[:, 1] += 2 * np.pi
    close_to(gear(kinds, terms, closed, 0.4), np.full(101, -2 * np.pi * ratio), 1e-12)
