"""Arrays of any library with DLPack come and go without a copy; functions run in kernels of users."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import random_states
from hybridyn.warp_batch import arrays as arrays_of
from hybridyn.warp_batch import functions
from tests.quantities.ankle import JOINTS, ankle
from tests.support.comparing import close_to
from tests.support.extras import needs
from tests.support.samples import slow

wp = needs("gpu")
wp.config.log_level = wp.LOG_WARNING
wp_array = wp.array


@pytest.fixture(scope="module")
def robot() -> hybridyn.HybridRobot:
    """Load a small robot."""
    return hybridyn.load("five_bar")


def as_warp(x: np.ndarray) -> Any:
    return wp.array(x, dtype=wp.float64 if x.dtype == np.float64 else wp.float32, device="cpu")


def as_torch(x: np.ndarray) -> Any:
    return pytest.importorskip("torch").from_numpy(x)


def as_jax(x: np.ndarray) -> Any:
    return pytest.importorskip("jax").numpy.asarray(x)


@pytest.mark.parametrize("kind", [np.array, as_warp, as_torch, as_jax])
def test_results_have_the_kind_of_the_first_array(robot: hybridyn.HybridRobot, kind: Any) -> None:
    batch = hybridyn.warp(robot, dtype="float32", device="cpu")  # the numbers of JAX by default
    q, v, a, tau = random_states(robot, 3)
    given = [kind(x.astype(np.float32)) for x in (q, v, tau)]
    found, guard = batch.ddm(*given)
    assert isinstance(found, type(given[0]))
    assert isinstance(guard, type(given[0]))
    close_to(np.array(found.numpy() if hasattr(found, "numpy") else found), a, 1e-4)
    one, _ = batch.ddm(given[0], v, tau)  # NumPy's beside another kind are copied
    assert (np.array(one.numpy() if hasattr(one, "numpy") else one) == found_of(found)).all()


def found_of(x: Any) -> np.ndarray:
    return np.array(x.numpy() if hasattr(x, "numpy") else x)


def test_arrays_are_read_in_place_with_their_strides(
    robot: hybridyn.HybridRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch = pytest.importorskip("torch")
    batch = hybridyn.warp(robot, device="cpu")
    q, v, a, tau = random_states(robot, 4)
    apart = torch.from_numpy(np.repeat(q, 2, axis=0))[::2]  # every other row
    across = torch.from_numpy(np.asfortranarray(v))
    seen = []
    monkeypatch.setattr(functions.wp, "launch", lambda kernel, **x: seen.append(x["inputs"]))
    back = batch._launcher.run(batch.made("ddm"), {"q": apart, "v": across, "tau": torch.from_numpy(tau)})
    assert [x.ptr for x in seen[0][:2]] == [apart.data_ptr(), across.data_ptr()]
    assert [x.ptr for x in seen[0][3:5]] == [x.data_ptr() for x in back]  # written in place
    monkeypatch.undo()
    close_to(batch.ddm(apart, across, torch.from_numpy(tau))[0].numpy(), a, 1e-10)


def test_users_kernels_call_the_functions(robot: hybridyn.HybridRobot) -> None:
    batch = hybridyn.warp(robot, device="cpu")
    ddm, idm, rows = batch.functions.ddm, batch.functions.idm, wp.array2d(dtype=wp.float64)
    assert "step_torque" in dir(batch.functions)
    with pytest.raises(AttributeError, match="no function 'dmd'"):
        _ = batch.functions.dmd

    @wp.kernel(module="unique", enable_backward=False)
    def there_and_back(
        q: rows, v: rows, tau: rows, a: rows, same: rows, worst: wp.array(dtype=wp.float64),
    ):  # type: ignore[no-untyped-def] # fmt: skip
        i = wp.tid()
        guard = ddm(q[i], v[i], tau[i], a[i])
        worst[i] = wp.max(guard, idm(q[i], v[i], a[i], same[i]))

    q, v, a, tau = random_states(robot, 5)
    out = [as_warp(np.zeros_like(x)) for x in (a, tau, tau[:, 0])]
    wp.launch(there_and_back, dim=5, inputs=[*map(as_warp, (q, v, tau)), *out], device="cpu")
    close_to(out[0].numpy(), a, 1e-10)
    close_to(out[1].numpy(), tau, 1e-10)
    assert (out[2].numpy() <= 1).all()


@pytest.mark.parametrize("dtype", ["float64", slow("float32")])
def test_the_map_of_an_ankle_is_that_of_the_general_path(tmp_path: Path, dtype: str) -> None:
    batch = hybridyn.warp(ankle(tmp_path), dtype=dtype, device="cpu")
    wanted = np.array([[0.1, -0.2], [0.3, 0.15], [-0.4, 0.1]])
    rate, effort = np.array([[0.3, -0.2]] * 3), np.array([[5.0, 2.0]] * 3)
    relation = batch.joint_map(JOINTS)
    q, motors, rates, efforts, matrix, guard = relation.to_motors(wanted, rate, effort)
    assert (guard <= 1).all()
    general = hybridyn.joint_map(batch.robot, {name: wanted[:, i] for i, name in enumerate(JOINTS)}, JOINTS)
    within = 1e-10 if dtype == "float64" else 1e-4
    close_to(q, general.q, within)
    close_to(motors, general.motor_positions, within)
    close_to(rates, general.motor_rates(rate), within)
    close_to(efforts, general.motor_efforts(effort), within)
    close_to(matrix.reshape(3, 2, 2), general.motors_per_joints, within)
    back, joints, *_, guard = relation.to_joints(motors)
    assert (guard <= 1).all()
    close_to(joints, wanted, within)
    close_to(back, q, within)
    assert dir(relation.functions) == ["map_to_joints", "map_to_motors"]
    assert callable(relation.functions.map_to_motors)
    with pytest.raises(hybridyn.ModelError, match="has no parameters"):
        hybridyn.warp(batch.robot, parameters=["mass:foot"], device="cpu").joint_map(JOINTS)


def test_maps_in_doubt_are_those_of_the_general_path(tmp_path: Path) -> None:
    batch = hybridyn.warp(ankle(tmp_path), device="cpu")
    relation = batch.joint_map(JOINTS)
    joints = np.array([[0.1, -0.2], [0.3, 0.15]])
    rate, effort = np.array([[0.3, -0.2], [0.1, 0.4]]), np.array([[5.0, 2.0], [1.0, -3.0]])
    near = np.tile(batch.robot.home, (2, 1))
    near[1] += 0.4  # open: the walk begins from a closed posture
    for side, right, x in (("motors", relation.to_motors, joints), ("joints", relation.to_joints, None)):
        x = relation.to_motors(joints)[1] if x is None else x
        wanted = right(x, rate, effort)
        refused = right(x, rate, effort, near=near)
        assert (refused[-1] <= 1).tolist() == [True, False], side
        assert np.isnan(refused[0][1]).all()
        found = right(x, rate, effort, near=near, fallback=True)
        for one, other in zip(found[:-1], wanted[:-1], strict=True):
            close_to(one, other, 1e-9)
    with pytest.raises(hybridyn.AssemblyError):
        relation.to_motors([[3.0, -3.0]], fallback=True)


REFUSED = {
    "the batch has float64": lambda b, q: b.ddm(as_warp(q.astype(np.float32)), q, q),
    "q is no array of numbers": lambda b, q: b.ddm([["a"]], q, q),
    "q has shape .3, 3.; wanted": lambda b, q: b.ddm(q[:, :3], q, q),
    "q has shape .4,.; wanted .N, 4., N at least 1": lambda b, q: b.ddm(q[0], q, q[:, :2]),
    "q has shape .0, 4.; wanted .N, 4., N at least 1": lambda b, q: b.ddm(q[:0], q[:0], q[:0, :2]),
    "v has 2 samples; wanted 3": lambda b, q: b.ddm(q, q[:2], q[:, :2]),
    "takes no base_acceleration": lambda b, q: b.ddm(q, q, q[:, :2], base_acceleration=np.zeros(6)),
    "no parameters: name them": lambda b, q: b.ddm(q, q, q[:, :2], parameters=[1.0]),
    "one state at least, not 0": lambda b, q: b.random_states(0),
    "cpu' is full: an array of 1.8e.07 GB does not fit": lambda b, q: b.random_states(2**50),
    "cpu' is full: an array of 3.69e.10 GB does not fit": lambda b, q: b._arrays.empty(2**31 - 1, 2**31 - 1),
}


@pytest.mark.parametrize("words", REFUSED)
def test_wrong_arrays_are_refused_in_one_line(robot: hybridyn.HybridRobot, words: str) -> None:
    batch = hybridyn.warp(robot, device="cpu")
    with pytest.raises(hybridyn.HybridynError, match=words) as refused:
        REFUSED[words](batch, np.tile(robot.home, (3, 1)))
    assert "\n" not in str(refused.value)


#: What Warp raises on a full device: at a launch, where it loads a module, and where it copies an array.
FULL: dict[str, Exception] = {
    "launch": RuntimeError(
        "Error launching kernel: kernel on device cuda:0: Warp CUDA error 2: out of memory "
        "(in function wp_cuda_launch_kernel, warp.cu:4000)"
    ),
    "load": Exception("Failed to load CUDA module 'm' (CUDA_ERROR_OUT_OF_MEMORY)\nmore"),
    "array": RuntimeError("Failed to allocate 1024 bytes on device 'cuda:0'"),
}


@pytest.mark.parametrize("where", FULL)
def test_a_device_that_is_full_at_the_launch_says_so(
    robot: hybridyn.HybridRobot, where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def raises(*_: Any, **__: Any) -> None:
        raise FULL[where]

    batch = hybridyn.warp(robot, device="cpu")
    q, v, _, tau = random_states(robot, 3)
    batch.ddm(q, v, tau)
    assert batch._drawn is not None
    monkeypatch.setattr(functions.wp, "array" if where == "array" else "launch", raises)
    monkeypatch.setattr(arrays_of, "_has_dlpack", lambda x: False)
    for call in (lambda: batch.ddm(q, v, tau), lambda: batch.random_states(3)):
        with pytest.raises(
            hybridyn.TrajectoryError, match=r"the device 'cpu' is full: .* fewer samples"
        ) as e:
            call()
        assert "\n" not in str(e.value)
    monkeypatch.setattr(functions.wp, "launch", lambda *_, **__: 1 / 0)
    monkeypatch.setattr(functions.wp, "array", wp_array)
    with pytest.raises(hybridyn.CompileError, match="ZeroDivisionError"):
        batch.ddm(q, v, tau)


class Elsewhere(str):
    """Another device."""

    is_cuda = False


def test_tensors_that_cannot_be_shared_or_are_elsewhere_are_refused(robot: hybridyn.HybridRobot) -> None:
    torch = pytest.importorskip("torch")
    batch = hybridyn.warp(robot, device="cpu")
    q = torch.zeros((3, 4), dtype=torch.float64, requires_grad=True)
    with pytest.raises(hybridyn.TrajectoryError, match=r"q cannot be read through DLPack: .*detach"):
        batch.ddm(q, q, q)
    batch._arrays.device = Elsewhere("cuda:7")
    with pytest.raises(hybridyn.TrajectoryError, match="q is on the device 'cpu', the batch on 'cuda:7'"):
        batch.ddm(q.detach(), q, q)


@pytest.mark.parametrize(
    ("words", "options"),
    [
        ("there is no device 'cuda:9': Warp has cpu", {"device": "cuda:9"}),
        ("dtype must be", {"dtype": "float16"}),
        ("parameter", {"parameters": ["mass:nothing"]}),
        ("not part of batches: clip the efforts", {"effects": ["default", "limits"]}),
    ],
)
def test_wrong_requests_are_refused_in_one_line(
    robot: hybridyn.HybridRobot, words: str, options: dict[str, Any]
) -> None:
    with pytest.raises(hybridyn.ModelError, match=words) as refused:
        hybridyn.warp(robot, **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("print('warp' in sys.modules)", "False"),
        (
            "import importlib.util as u\nfind = u.find_spec\n"
            "u.find_spec = lambda name, *x: None if name == 'warp' else find(name, *x)\n"
            "import hybridyn.warp_batch.creating as c\nc.find_spec = u.find_spec\n"
            "try: hybridyn.warp(hybridyn.load('five_bar'))\n"
            "except hybridyn.CompileError as error: print(error)",
            "batches need Warp: install it with",
        ),
        (
            "import warp; warp.config.log_level = warp.LOG_WARNING\n"
            "r = hybridyn.load('five_bar')\n"
            "hybridyn.warp(r, device='cpu').random_states(2)\n"
            "maps = open('/proc/self/maps').read()\n"
            "print('libcuda' in maps, 'torch' in sys.modules, 'jax' in sys.modules)",
            "False False False",
        ),
    ],
)
def test_nothing_is_imported_without_need(text: str, said: str) -> None:
    code = f"import sys, hybridyn\n[getattr(hybridyn, n) for n in hybridyn.__all__]\n{text}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].startswith(said)
