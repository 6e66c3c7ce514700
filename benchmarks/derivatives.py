"""Derivatives of both models beside Pinocchio's, of robots with loops and of serial arms.

Run `python -m benchmarks.derivatives [robots]`. Times are per sample [us], of single calls and of batches of
`SAMPLES`. Pinocchio's `computeConstraintDynamicsDerivatives` needs `constraintDynamics`, which is called
before and not counted; arms have `computeRNEADerivatives` and `computeABADerivatives`. Ratios are to
Pinocchio's time of the same robot and model. Operations are those of one sample, beside those of the model.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import pinocchio as pin

import hybridyn
from benchmarks.cases import case_of
from benchmarks.methods import NotMeasuredError
from benchmarks.peers.pinocchio_loops import loops
from benchmarks.timing import interleaved, one_thread
from hybridyn.compiled.code.kernels import kernel_graph
from hybridyn.compiled.derivatives import Derivatives
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.program import Call, Program
from hybridyn.compiled.programs.whole_robot import programs
from hybridyn.spatial import Array

ROBOTS = ("ur5", "five_bar", "gough_stewart", "lx4")
#: Samples in a batch, and how often it is measured.
SAMPLES, ROUNDS = 32, 15
#: Pinocchio's proximal iterations, as accurate as they get.
ACCURACY, MU, ITERATIONS = 1e-14, 1e-12, 3

Calls = dict[str, Callable[[], object]]


def main() -> int:
    """Measure the robots that are named, and print a table."""
    one_thread()
    print(f"{'robot':<15}{'model':<6}{'what':<44}{'us':>9}{'ratio':>8}{'operations':>12}")
    for name in sys.argv[1:] or ROBOTS:
        robot = case_of(name).load()
        q, v, a, tau = random_states(robot, SAMPLES)
        given = {"idm": (q, v, a), "ddm": (q, v, tau)}
        for model in ("idm", "ddm"):
            measure(robot, name, model, given[model])
    return 0


def measure(robot: hybridyn.HybridRobot, name: str, model: str, given: tuple[Array, ...]) -> None:
    """Print the rows of one model of a robot."""
    derivatives = Derivatives(robot, model)
    library = derivatives.library
    assert library is not None
    one = [np.ascontiguousarray(x[0]) for x in given]
    calls: Calls = {"pinocchio": peer(robot, model, one)} if not closed(robot, model) else {}
    program = f"{model}_jacobian"
    calls["one call"] = lambda: library.programs[program].single(*one)
    calls["one call, checked arrays from Python"] = lambda: derivatives(*one)
    calls["batch"] = lambda: library.batch(program, *given)
    times = dict(zip(calls, interleaved(list(calls.values()), ROUNDS), strict=True))
    least = {what: time.least / (SAMPLES if what == "batch" else 1) for what, time in times.items()}
    count = operations(derivatives.program), operations(programs(robot, models=(model,))[model])
    for what, time in least.items():
        ratio = f"{time / least['pinocchio']:8.3f}" if "pinocchio" in least else " " * 8
        shown = f"{count[0]:12}" if what == "one call" else ""
        print(f"{name:<15}{model:<6}{what:<44}{1e6 * time:9.2f}{ratio}{shown}", flush=True)
    print(f"{name:<15}{model:<6}{'the model itself':<44}{'':17}{count[1]:12}", flush=True)


def closed(robot: hybridyn.HybridRobot, model: str) -> bool:
    """Return whether Pinocchio has no such derivatives: those of the inverse model of a robot with loops."""
    return model == "idm" and bool(robot.description.closures)


def peer(robot: hybridyn.HybridRobot, model: str, given: list[Array]) -> Callable[[], object]:
    """Return the call of Pinocchio's derivatives at one sample."""
    try:
        own = loops(robot)
    except NotMeasuredError:
        return lambda: None
    q, v, x = given
    if not robot.description.closures:
        call = pin.computeRNEADerivatives if model == "idm" else pin.computeABADerivatives
        numbers = x if model == "idm" else own.efforts(x)
        return lambda: call(own.model, own.data, q, v, numbers)
    pin.initConstraintDynamics(own.model, own.data, own.constraints, own.constraint_data)
    settings = pin.ProximalSettings(ACCURACY, MU, ITERATIONS)
    closures = (own.constraints, own.constraint_data, settings)
    pin.constraintDynamics(own.model, own.data, q, v, own.efforts(x), *closures)
    return lambda: pin.computeConstraintDynamicsDerivatives(own.model, own.data, *closures)


def operations(program: Program) -> int:
    """Return the number of operations of one sample; a product fused with a sum counts as two."""
    counts = [
        sum({"input": 0, "constant": 0, "fma": 2}.get(node.name, 1) for node in kernel_graph(kernel).nodes)
        for kernel in program.kernels
    ]
    return sum(step.copies * counts[step.kernel] for step in program.steps if isinstance(step, Call))


if __name__ == "__main__":
    raise SystemExit(main())
