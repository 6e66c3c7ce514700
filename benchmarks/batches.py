"""Batches on a GPU: samples a second of `hybridyn.warp`, beside compiled models on all cores and MuJoCo Warp.

    python -m benchmarks.batches                 writes benchmarks/results/batches.csv; speeds need a GPU
    python -m benchmarks.batches cpu             tries every row once, of few samples, and writes nothing

Each row has the share of the device's limits: bytes that a sample reads and writes, at the speed of a copy;
and operations of its kernels (a fused product counts as one), at the speed of a kernel of such products. Rows
of `close` and `step` count no operations, as the number of Newton steps is not known. Steps of `compile` are
those of one trajectory on one core, as `simulate` takes them in C, and its closings are calls on one core.
MuJoCo Warp steps the converted robot with its default solver; its error is the largest opening of a loop
after the steps [m].
"""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from tempfile import TemporaryDirectory
from time import perf_counter
from timeit import repeat
from typing import Any

import numpy as np

import hybridyn
from benchmarks.cases import ROOT
from benchmarks.results import today
from hybridyn.compiled.code.kernels import kernel_graph
from hybridyn.compiled.program import Call
from hybridyn.warp_batch.functions import wp

ROBOTS = ("five_bar", "gough_stewart", "lx4")
FIELDS = (
    "device", "date", "engine", "robot", "model", "dtype", "samples", "per_second", "of_memory",
    "of_arithmetic", "error", "seconds",
)  # fmt: skip


def main() -> int:
    """Measure, or say that nothing was measured."""
    device = ["cuda:0", *sys.argv[1:]][-1]
    if wp is None:
        sys.exit("not measured: Warp is not installed")
    wp.config.log_level = wp.LOG_WARNING  # the rows alone are written
    measured = device == "cpu" or wp.is_cuda_available()
    on, rows = wp.get_device(device if measured else "cpu"), []
    sizes = (64,) if on.is_cpu else tuple(2**k for k in range(10, 21, 2))
    for name in ROBOTS:
        speeds = (*models(on, name, sizes), *mujoco_warp(on, name, sizes)) if measured else ()
        for one in (*builds(name), *speeds):
            rows.append({"device": on.name, "date": today()} | one)
            print(", ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    if device != "cpu":
        with (ROOT / "benchmarks/results/batches.csv").open("w", newline="") as file:
            table = csv.DictWriter(file, FIELDS)
            table.writeheader()
            table.writerows(rows)
    if not measured:
        print("the speed is not measured: Warp finds no GPU")
    return 0


def best(call: Callable[..., Any], *given: Any, **more: Any) -> float:
    """Return the shortest of some times of a call [s], of few if it takes long, after one that builds."""
    run = partial(repeat, lambda: (call(*given, **more), wp.synchronize()), number=1)
    run(repeat=1)
    once = min(run(repeat=1))
    return once if once > 0.2 else min(once, *run(repeat=4))


def builds(name: str) -> Iterator[dict[str, Any]]:
    """Measure how long NVRTC takes for two kinds of GPU, which need not be there [s]."""
    batch = hybridyn.warp(hybridyn.load(name), device="cpu")
    for model in ("idm", "ddm", "close", "step_constant"):
        with TemporaryDirectory() as folder:
            start = perf_counter()
            for kernel in batch.made(model).kernels:
                wp.compile_aot_module(kernel.module, arch=[80, 90], module_dir=folder, use_ptx=False)
        yield dict(zip(FIELDS[2:6], ("NVRTC", name, model, "float64"), strict=True)) | {
            "seconds": perf_counter() - start
        }


def row(engine: str, robot: str, model: str, dtype: str, samples: int, seconds: float) -> dict[str, Any]:
    """Return a row of the table, of the time of all samples."""
    return dict(zip(FIELDS[2:8], (engine, robot, model, dtype, samples, samples / seconds), strict=True))


def models(on: Any, name: str, sizes: tuple[int, ...]) -> Iterator[dict[str, Any]]:
    """Measure the models of a robot in both precisions, and compiled ones on all cores."""
    robot = hybridyn.load(name)
    yield compiled_steps(robot, name, 2 * sizes[0])
    for dtype in ("float64", "float32"):
        batch = hybridyn.warp(robot, dtype=dtype, device=on)
        threaded = hybridyn.compile(robot, threads=os.cpu_count() or 1, dtype=dtype, wait=True)
        copied, fused = limits(on, dtype)
        for count in sizes:
            q, v, a, tau = states(batch, count)
            x = wp.array(q.numpy()[:, robot.motor_q], dtype=q.dtype, device=on)
            given = {"idm": (q, v, a), "ddm": (q, v, tau), "close": (x,), "step": (q, v, 1e-3)}
            for model, arrays in given.items():
                more = {"tau": tau} if model == "step" else {}
                seconds = best(getattr(batch, model), *arrays, **more)
                native = batch.made("step_constant" if more else model).native
                width = sum(size for _, size in (*native.inputs, *native.outputs)) + 1
                found = row("hybridyn.warp", name, model, dtype, count, seconds)
                found["of_memory"] = count * width * np.dtype(dtype).itemsize / seconds / copied
                if model in ("idm", "ddm"):
                    found["of_arithmetic"] = count * operations(threaded, model) / seconds / fused
                    if dtype == "float64":  # to the host, states closed in single precision are open
                        host = best(getattr(threaded, model), *(x.numpy() for x in arrays))
                        yield row("compile", name, model, dtype, count, host)
                if model == "close":  # from home, like the batch, one after the other
                    few = x.numpy()[:64]
                    yield row("compile", name, model, dtype, len(few), best(closings, threaded, few))
                yield found


def states(batch: Any, count: int) -> list[Any]:
    """Draw q, v, a and efforts of which both models are certain: the first such stands in for the others."""
    q, v, a, _ = batch.random_states(count)
    tau, inverse = batch.idm(q, v, a)
    _, direct = batch.ddm(q, v, tau)
    certain = np.maximum(inverse.numpy(), direct.numpy()) <= 1.0
    rows = np.where(certain, np.arange(count), certain.argmax())
    return [wp.array(x.numpy()[rows], dtype=x.dtype, device=x.device) for x in (q, v, a, tau)]


def closings(compiled: hybridyn.CompiledRobot, positions: np.ndarray) -> None:
    """Close the loops at some positions of the motors, each from home."""
    for one in positions:
        compiled.close(one, last=compiled.robot.home)


def compiled_steps(robot: hybridyn.HybridRobot, name: str, steps: int) -> dict[str, Any]:
    """Measure the steps of a compiled simulation, as those of a batch, of a robot that its motors hold."""
    compiled, still, h = hybridyn.compile(robot, wait=True), np.zeros(robot.nv), 1e-3
    hold = compiled.idm(robot.home, still, still)
    given = {"effort": hold, "method": "rk4", "step": h, "compiled": compiled}
    seconds = best(hybridyn.simulate, robot, robot.home, still, (0.0, steps * h), **given)
    return row("compile", name, "step", "float64", steps, seconds)


def operations(compiled: hybridyn.CompiledRobot, model: str) -> int:
    """Return the number of operations of a sample."""
    program = compiled.programs[model]
    counts = [len(kernel_graph(kernel).nodes) for kernel in program.kernels]
    return sum(counts[step.kernel] * step.copies for step in program.steps if isinstance(step, Call))


def limits(on: Any, dtype: str) -> tuple[float, float]:
    """Measure bytes that are copied, and fused products that are computed, in a second."""
    number, count, length = getattr(wp, dtype), 2**14 if on.is_cpu else 2**22, 4096

    def products(x: wp.array(dtype=number)):  # type: ignore[no-untyped-def, valid-type]
        i = wp.tid()
        y = x[i] * number(0.5)
        for _ in range(length):
            y = y * number(0.5) + number(1.0)
        x[i] = y

    kernel = wp.kernel(products, module="unique", enable_backward=False)
    x, y = (wp.zeros(count, dtype=number, device=on) for _ in range(2))
    copied = 2 * count * np.dtype(dtype).itemsize / best(wp.copy, x, y)
    return copied, count * length / best(wp.launch, kernel, dim=count, inputs=[x], device=on)


def mujoco_warp(on: Any, name: str, sizes: tuple[int, ...]) -> Iterator[dict[str, Any]]:
    """Measure steps of MuJoCo Warp, where it is installed, on the robot that `convert` writes for it."""
    if find_spec("mujoco_warp") is None:
        return
    import mujoco
    import mujoco_warp as mjw  # type: ignore[import-not-found, unused-ignore]

    file = ROOT / "build" / "batches" / f"{name}.xml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.unlink(missing_ok=True)
    hybridyn.convert(hybridyn.load(name), file)
    model = mujoco.MjModel.from_xml_path(str(file))
    with wp.ScopedDevice(on):
        there = mjw.put_model(model)
        for count in sizes:
            most = 6 * model.neq + 2 * model.nv
            data = mjw.put_data(model, mujoco.MjData(model), nworld=count, njmax=most)
            seconds = best(mjw.step, there, data)
            error = float(np.abs(data.efc.pos.numpy()).max(initial=0.0))
            yield row("mujoco_warp", name, "step", "float32", count, seconds) | {"error": error}


if __name__ == "__main__":
    raise SystemExit(main())
