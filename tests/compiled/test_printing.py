"""Kernels as C: every operation, printed functions against mpmath, every kind of number."""

import math

import casadi as ca
import mpmath
import numpy as np
import pytest

from hybridyn.compiled.code.graph import graph_of
from hybridyn.compiled.code.kernels import fused, kernel_text
from hybridyn.compiled.library.calls import Library, load
from hybridyn.compiled.program import Call, GivenPlace, Kernel, Program, ResultPlace
from hybridyn.compiled.programs.whole_robot import function_of
from tests.compiled.toys import single, toy
from tests.support.comparing import refused
from tests.support.samples import slow

ULPS = 1.0  # what the comment in sines.h promises
PROMISED = {"tanh": 1.9, "exp": 1.4}  # and those in tanh.h and exp.h
LARGEST = {"tanh": np.inf, "exp": 709.7}  # argument of a number
ROUNDING = 4e-16  # one operation
LIBRARY = 4e-15  # a function of the C library against CasADi's, which is another one
FLOAT = 1e-5  # a few roundings of floats


def one_kernel(name: str, columns: list[ca.SX], outputs: list[ca.SX]) -> Program:
    """Return a program of one call."""
    function = ca.Function(name, columns, [ca.vertcat(*outputs)])
    starts = np.cumsum([0] + [x.numel() for x in columns])
    sources = tuple(
        GivenPlace(np.arange(start, start + x.numel())[None])
        for start, x in zip(starts, columns, strict=False)
    )
    call = Call(0, 1, sources, (ResultPlace(np.arange(len(outputs))[None]),))
    ins = tuple((f"x{i}", x.numel()) for i, x in enumerate(columns))
    return Program(name, ins, (("y", len(outputs)),), (Kernel(name, function, name),), (call,), 0, 0)


X, Y = ca.SX.sym("x"), ca.SX.sym("y")

EXACT = [
    X + Y,
    X - Y,
    Y - X,
    X * Y,
    X / Y,
    -X,
    -(X * Y),
    -X - Y,
    X**2,
    2 * X,
    1 / X,
    ca.sqrt(X * X),
    ca.fabs(X),
    X * 0.1,
    ca.fmin(X, Y),
    ca.fmax(X, Y),
    ca.sign(X),
    ca.if_else(X < Y, X, Y),
    ca.if_else(X <= 0, 1, Y),
    X < Y,
    X <= Y,
    ca.eq(X, Y),
    ca.ne(X, X),
    ca.logic_not(X < Y),
    ca.logic_and(X < Y, Y > 0),
    ca.logic_or(X < Y, Y > 0),
    ca.if_else(ca.logic_and(X, Y), X, -Y),
    (X < Y) * 3 + Y,
    ca.floor(X),
    ca.ceil(X),
    ca.copysign(X, Y),
    -ca.fabs(Y),
    ca.if_else(X < Y, -X, 0),
    3.0 * (X >= Y),
    ca.logic_not(X),
    ca.fmin(X, 0.5) - 1,
]
CALLED = [
    ca.tan(X),
    ca.asin(X / 9),
    ca.acos(X / 9),
    ca.atan(X),
    ca.atan2(Y, X),
    ca.sinh(X),
    ca.cosh(X),
    ca.tanh(X),
    ca.asinh(X),
    ca.acosh(1 + X * X),
    ca.atanh(X / 9),
    ca.exp(X),
    ca.log(1 + X * X),
    ca.erf(X),
    ca.sin(-X),
    ca.cos(-X),
    ca.sin(X) - ca.cos(X),
    ca.fabs(X) ** Y,
    ca.fmod(X, Y),
    ca.expm1(X),
    ca.log1p(X * X),
    ca.hypot(X, Y),
    ca.remainder(X, Y),
    ca.fabs(X) ** 1.5,
]
EVERY = one_kernel("every", [X, Y], EXACT + CALLED)

ANGLE = ca.SX.sym("angle")
SINES = one_kernel("sines", [ANGLE], [ca.sin(ANGLE), ca.cos(ANGLE)])
SMOOTH = one_kernel("smooth", [ANGLE], [ca.tanh(ANGLE), ca.exp(ANGLE)])

#: Rows narrower than a vector, as wide, and no multiple of it; the output is each number plus one.
WIDTHS = (5, 8, 21)
COLUMNS = [ca.SX.sym(f"x{width}", width) for width in WIDTHS]
ROWS = one_kernel("rows", COLUMNS, [x + 1 for column in COLUMNS for x in ca.vertsplit(column)])


@pytest.fixture(
    scope="module",
    params=[("float64", 8), slow(("float64", 4)), slow(("float64", 2)), ("float64", 1)],
    ids=str,
)
def library(request: pytest.FixtureRequest) -> Library:
    """Return the programs; by default on vectors and on plain numbers."""
    number, lanes = request.param
    return load([EVERY, SINES, SMOOTH, ROWS], dtype=number, lanes=lanes)


def points() -> np.ndarray:
    rng = np.random.default_rng(1)
    xy = rng.normal(size=(60, 2)) * 2
    xy[:4] = [[0.0, 1.5], [2.0, 2.0], [-3.0, 0.0], [0.0, -1.0]]
    return xy


def test_every_operation_is_casadis(library: Library) -> None:
    xy = points()
    function = EVERY.kernels[0].function
    wanted = np.array(function.map(len(xy))(xy[:, 0], xy[:, 1])).T
    ((got,), _) = library.batch("every", xy[:, :1], xy[:, 1:])
    n = len(EXACT)
    np.testing.assert_allclose(got[:, :n], wanted[:, :n], rtol=ROUNDING, atol=0)
    np.testing.assert_allclose(got[:, n:], wanted[:, n:], rtol=LIBRARY, atol=LIBRARY)


def angles() -> np.ndarray:
    rng = np.random.default_rng(2)
    near = rng.integers(-60000, 60000, size=300) * (math.pi / 2)
    some = [
        rng.uniform(-4, 4, 600),
        rng.uniform(-1e5, 1e5, 600),
        near,
        np.nextafter(near, 1e9),
        near + rng.normal(size=300) * 1e-9,
        10.0 ** rng.uniform(-300, 0, 50),
        np.arange(-12, 12) * math.pi / 4,
        rng.uniform(-1e6, 1e6, 200),
        [0.0, 5e-324, 1e6, -1e6, 6381956970095103 * 2.0**-33],
    ]
    return np.concatenate(some)


def test_rows_of_any_width_arrive_and_numbers_that_are_not_finite_are_seen(library: Library) -> None:
    samples, sick = 19, 11
    given = np.random.default_rng(4).normal(size=(samples, sum(WIDTHS)))
    others = np.arange(samples) != sick
    for k in range(given.shape[1]):
        x = given.copy()
        x[sick, k] = (np.nan, np.inf, -np.inf)[k % 3]
        columns = (np.ascontiguousarray(part) for part in np.split(x, np.cumsum(WIDTHS)[:-1], axis=1))
        ((got,), guard) = library.batch("rows", *columns)
        np.testing.assert_array_equal(got, x + 1)
        assert np.isnan(guard[sick])
        assert (guard[others] == 0).all()


def test_sine_and_cosine_are_right_to_a_unit_in_the_last_place(library: Library) -> None:
    x = angles()
    ((got,), _) = library.batch("sines", x[:, None])
    with mpmath.workdps(60):
        for k, f in enumerate((mpmath.sin, mpmath.cos)):
            for value, result in zip(x.tolist(), got[:, k].tolist(), strict=True):
                exact = f(mpmath.mpf(value))
                unit = math.ulp(float(exact))
                assert abs(mpmath.mpf(result) - exact) <= ULPS * unit, (f.__name__, value)


def test_far_angles_and_no_numbers_are_the_c_librarys(library: Library) -> None:
    x = np.array([1e7, -3e9, 1e22, 1e300, np.inf, -np.inf, np.nan, 0.3, 1.1])
    ((got,), guard) = library.batch("sines", x[:, None])
    assert np.isnan(got[4:7]).all()
    for value, (s, c) in zip(x[:4].tolist(), got[:4].tolist(), strict=True):
        assert s == pytest.approx(math.sin(value), rel=ROUNDING)
        assert c == pytest.approx(math.cos(value), rel=ROUNDING)
    ((alone,), _) = library.batch("sines", x[7:, None])
    assert (got[7:] == alone).all()
    assert np.isnan(guard[4:7]).all()


@pytest.mark.parametrize("name", PROMISED)
@pytest.mark.parametrize("count", [300, slow(25_000)])
def test_tanh_and_exp_are_right_to_the_last_place(library: Library, name: str, count: int) -> None:
    rng = np.random.default_rng(5)
    seams = np.concatenate([[0.9, 20.0], np.arange(1, 50) * (math.log(2) / 4)])  # where other parts begin
    sizes = [rng.uniform(0, most, count) for most in (1.5, 20, 746)]
    sizes += [10.0 ** rng.uniform(-323, 308, count), seams, np.nextafter(seams, 0), np.nextafter(seams, 99)]
    x = np.concatenate([sign * size for sign in (1, -1) for size in sizes])
    x = x[x < LARGEST[name]]
    ((got,), _) = library.batch("smooth", x[:, None])
    with mpmath.workdps(60):
        for value, result in zip(x.tolist(), got[:, [*PROMISED].index(name)].tolist(), strict=True):
            exact = getattr(mpmath, name)(mpmath.mpf(value))
            assert abs(mpmath.mpf(result) - exact) <= PROMISED[name] * math.ulp(float(exact)), value


def test_tanh_and_exp_keep_signs_limits_and_what_is_no_number(library: Library) -> None:
    x = np.array([0.0, -0.0, 5e-324, -5e-324, np.inf, -np.inf, np.nan, 711.0, -747.0, 0.9])
    ((got,), guard) = library.batch("smooth", x[:, None])
    tanh = np.array([0.0, -0.0, 5e-324, -5e-324, 1.0, -1.0, np.nan, 1.0, -1.0])
    np.testing.assert_array_equal(got[:-1, 0], tanh)
    np.testing.assert_array_equal(np.signbit(got[:6, 0]), np.signbit(tanh[:6]))
    np.testing.assert_array_equal(got[:-1, 1], [1.0, 1.0, 1.0, 1.0, np.inf, 0.0, np.nan, np.inf, 0.0])
    ((alone,), _) = library.batch("smooth", x[-1:, None])
    assert (got[-1] == alone[0]).all()
    assert np.isnan(guard[4:7]).all()


def test_floats_keep_seven_digits() -> None:
    program = toy(4, 6)
    sines = load([SINES, SMOOTH, program], dtype="float32")
    x = np.random.default_rng(3).uniform(-100, 100, 50).astype(np.float32)
    ((got,), _) = sines.batch("sines", x[:, None])
    assert got.dtype == np.float32
    exact = np.stack([np.sin(x.astype(float)), np.cos(x.astype(float))], axis=1)
    assert np.abs(got - exact).max() <= 2.0**-24
    ((smooth,), _) = sines.batch("smooth", x[:, None] / 32)
    exact = np.stack([f(x.astype(float) / 32) for f in (np.tanh, np.exp)], axis=1)
    np.testing.assert_allclose(smooth, exact, rtol=2.0**-24, atol=0)
    q, v = np.random.default_rng(4).normal(size=(2, 20, 18)) * 0.3
    v = v[:, :1]
    (a, _), _ = sines.batch(program.name, q, v)
    wanted = np.array(function_of(program).map(len(q))(q.T, v.T)[0]).T
    np.testing.assert_allclose(a, wanted, rtol=FLOAT, atol=FLOAT)
    assert (single(sines, program.name, q[3], v[3])[0][0] == a[3]).all()


def test_wider_numbers_are_there_for_reference() -> None:
    """The rounding of doubles shows as the difference."""
    program = toy(4, 6)
    q, v = np.random.default_rng(4).normal(size=(2, 20, 18))
    (a, _), _ = load([program], lanes=1).batch(program.name, q, v[:, :1])
    (wide, _), _ = load([program], dtype="float128").batch(program.name, q, v[:, :1])
    assert 0 < np.abs(wide - a).max() < 1e-12


def test_signs_and_equal_operations_cost_nothing() -> None:
    a, b, c = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("c")
    f = ca.Function("f", [a, b, c], [ca.vertcat((a - b) * c, (-c) * (b - a), -(a * b) - c, c + b * a)])
    names = [node.name for node in graph_of(f).nodes]
    assert sorted(names) == sorted(["input"] * 3 + ["sub", "mul", "mul", "add", "neg"])
    names = [node.name for node in fused(graph_of(f)).nodes]
    assert names.count("fma") == 1
    assert names.count("mul") == 1


def test_a_product_that_something_else_reads_is_not_fused() -> None:
    a, b, c = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("c")
    f = ca.Function("f", [a, b, c], [ca.vertcat(a * b + c, ca.sin(a * b))])
    names = [node.name for node in fused(graph_of(f)).nodes]
    assert "fma" not in names
    assert names.count("mul") == 1


def test_what_nobody_reads_is_not_printed() -> None:
    a, b = ca.SX.sym("a"), ca.SX.sym("b", 3)
    f = ca.Function("f", [a, b], [ca.vertcat(ca.sin(a), 0), ca.SX(0, 1)])
    text = kernel_text(fused(graph_of(f)))
    assert "x1[" not in text
    assert text.count("SINCOS") == 1
    assert "y0[1] = C(0.0)" in text


def test_sparse_outputs_are_refused() -> None:
    a = ca.SX.sym("a")
    sparse = ca.SX(2, 1)
    sparse[0] = a
    refused(lambda: graph_of(ca.Function("f", [a], [sparse])), ValueError, "sparse")
