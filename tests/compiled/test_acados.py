"""The direct model as acados calls it: built without acados, and called through CasADi."""

import ctypes
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.acados import SIGNATURES
from hybridyn.compiled.exporting import export
from hybridyn.compiled.library.building import NATIVE
from hybridyn.structure.building import build_robot
from tests.compiled.test_export import STRICT, compiler
from tests.robots.effect_cases import CASES
from tests.robots.shipped import shipped
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

#: Rounding, and the condition of loops and of the mass matrix.
ROUNDING = 1e-11
LIBRARY = ("-shared", "-fPIC", "-O0")
OF_CASADI = "-Dcasadi_int=long long int"


def built(robot: hybridyn.HybridRobot, folder: Path, *words: str) -> Path:
    """Export a robot as "bar", and build it."""
    export(robot, folder, name="bar", acados=True)
    file = folder / "bar.so"
    assert compiler(*STRICT, *LIBRARY, *words, "-o", file, folder / "bar.c", "-lm") == ""
    return file


@pytest.fixture(scope="module")
def for_casadi(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Build each robot once, with the integers of CasADi."""

    @cache
    def library(name: str) -> Path:
        fast = ("-O1", *NATIVE) if name != "five_bar" else ()  # equal legs in vectors
        return built(build_robot(shipped(name)), tmp_path_factory.mktemp(name), OF_CASADI, *fast)

    return library


@pytest.mark.parametrize("name", ["five_bar", slow("gough_stewart"), slow("lx4")])
def test_casadi_calls_what_acados_calls(
    name: str, for_casadi: Callable[[str], Path], request: pytest.FixtureRequest
) -> None:
    """The judges are the general path and the derivatives over motors, which CasADi runs."""
    robot, file = build_robot(shipped(name)), for_casadi(name)
    request.getfixturevalue("interpreted")
    ode, forward, adjoint, hessian = (ca.external(f"bar_{word}", str(file)) for word in SIGNATURES)
    m, random = len(robot.motors), np.random.default_rng(0)
    x = 5e-3 * random.normal(size=2 * m) + np.append(robot.home[robot.motor_q], np.zeros(m))
    u, p, weights = random.normal(size=m), robot.home, random.normal(size=2 * m)
    Sx, Su = random.normal(size=(2 * m, 2 * m)), random.normal(size=(2 * m, m))
    q, v, _ = hybridyn.assemble(robot, motors=(x[:m], x[m:], np.zeros(m)), guess=p)
    f = np.append(x[m:], hybridyn.ddm(robot, q, v, u)[robot.motor_v])
    J = hybridyn.ddm_jacobian(robot, q, v, u, coordinates="motors")
    A = np.block([[np.zeros((m, m)), np.eye(m)], [J["q"], J["v"]]])
    B = np.vstack([np.zeros((m, m)), J["tau"]])
    of_weights = np.hstack([A, B]).T @ weights
    second = hybridyn.SecondDerivatives(robot, "ddm", coordinates="motors")
    S = np.block([[Sx, Su], [np.zeros((m, 2 * m)), np.eye(m)]])
    lower = (S.T @ second.hessian(q, v, u, weights[m:]) @ S).T[np.triu_indices(3 * m)]

    close_to(ode(x, u, p).full().ravel(), f, ROUNDING)
    found = [y.full() for y in forward(x, Sx, Su, u, p)]
    close_to(found[0].ravel(), f, ROUNDING)
    close_to(found[1], A @ Sx, ROUNDING)
    close_to(found[2], A @ Su + B, ROUNDING)
    close_to(adjoint(x, weights, u, p).full().ravel(), of_weights, ROUNDING)
    both = hessian(x, Sx, Su, weights, u, p)
    close_to(both[0].full().ravel(), of_weights, ROUNDING)
    close_to(both[1].full().ravel(), lower, ROUNDING)


def test_acados_finds_shapes_and_memory_and_what_fails(for_casadi: Callable[[str], Path]) -> None:
    """Dense arrays of known shapes; NaN and 1 where no posture follows. Its own integers compile, too."""
    robot, file = build_robot(shipped("five_bar")), for_casadi("five_bar")
    assert compiler(*STRICT, "-fsyntax-only", file.with_suffix(".c")) == ""
    header = file.with_name("bar_acados.h").read_text()
    assert "#ifndef casadi_int\n#define casadi_int int\n" in header
    library = ctypes.CDLL(str(file))
    f = library.bar_expl_vde_forw
    sizes = [ctypes.c_longlong() for _ in range(4)]
    assert library.bar_expl_vde_forw_work(*map(ctypes.byref, sizes)) == 0
    assert [size.value for size in sizes[:3]] == [5, 3, 0]
    found = []
    for side, n in (("in", library.bar_expl_vde_forw_n_in()), ("out", library.bar_expl_vde_forw_n_out())):
        pattern = getattr(library, f"bar_expl_vde_forw_sparsity_{side}")
        pattern.restype = ctypes.POINTER(ctypes.c_longlong)
        found.append([tuple(pattern(i)[:3]) for i in range(n)])
        assert not pattern(n)
    square, tall, column = (4, 4, 1), (4, 2, 1), (4, 1, 1)
    assert found == [[column, square, tall, (2, 1, 1), column], [column, square, tall]]

    pointer = ctypes.POINTER(ctypes.c_double)
    work = np.zeros(sizes[3].value)

    def called(x: np.ndarray, p: np.ndarray) -> tuple[int, np.ndarray]:
        """Return the status and the first result; other results and the seeds are left out."""
        given = [np.array(x), None, None, np.zeros(2), np.array(p)]
        out = np.zeros(4)
        arg = (pointer * 5)(*(None if y is None else y.ctypes.data_as(pointer) for y in given))
        res = (pointer * 3)(out.ctypes.data_as(pointer), None, None)
        return f(arg, res, None, work.ctypes.data_as(pointer), 0), out

    status, out = called(np.array([0.1, 0.2, 1.0, 0.0]), robot.home)
    assert status == 0
    assert out[:2].tolist() == [1.0, 0.0]
    for wrong in (np.nan, 1e9):
        status, out = called(np.array([wrong, 0.0, 0.0, 0.0]), robot.home)
        assert status == 1
        assert np.isnan(out).all()


def test_what_acados_cannot_have_is_refused(tmp_path: Path) -> None:
    robot = build_robot(shipped("five_bar"))
    make = partial(export, robot, tmp_path, acados=True)
    for more in ({"dtype": "float32"}, {"parameters": ["mass:m1_tool"]}, {"wrenches": ["m1_tool"]}):
        refused(partial(make, **more), hybridyn.ModelError, "functions for acados need double precision")
    still = hybridyn.load("five_bar", motors=[])
    refused(partial(export, still, tmp_path, acados=True), hybridyn.ModelError, "need motors")
    floating = build_robot(shipped("five_bar"), base="floating")
    refused(partial(export, floating, tmp_path, acados=True), hybridyn.ModelError, "fixed base")
    refused(partial(make, CASES["stop"](robot)), hybridyn.ModelError, "'stop' has no second derivative")
