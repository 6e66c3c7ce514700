"""Compiled closed-loop quantities beside Pinocchio's algorithms for the open tree of the same robot.

Run `python -m benchmarks.quantities [robots]`. Times are per sample of a batch of `SAMPLES` [us]. Pinocchio's
`crba` and `nonLinearEffects` know no closures: their results are those of the open tree, which the loops turn
into M by dq/du on both sides. They are called from Python, sample by sample.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import pinocchio as pin

import hybridyn
from benchmarks.timing import interleaved, one_thread
from hybridyn.compiled.equations.states import moving_states

ROBOTS = ("five_bar", "gough_stewart", "lx4")
#: Samples in a batch, and how often it is measured.
SAMPLES, ROUNDS = 1_000, 9


def main() -> int:
    """Measure the robots that are named, and print a table."""
    one_thread()
    for name in sys.argv[1:] or ROBOTS:
        compiled = hybridyn.compile(hybridyn.load(name))
        calls = calls_of(compiled)
        for call in calls.values():
            call()
        for what, time in zip(calls, interleaved(list(calls.values()), ROUNDS), strict=True):
            print(f"{name:<15}{what:<30}{1e6 * time.least / SAMPLES:9.2f}", flush=True)
        assert compiled.recomputed == 0
    return 0


def calls_of(compiled: hybridyn.CompiledRobot) -> dict[str, Callable[[], object]]:
    """Return what is measured, by name."""
    robot = compiled.robot
    model, data, link = robot.model, robot.model.createData(), list(robot.bodies.place)[-1]
    q, v, _ = moving_states(robot, SAMPLES, 1)
    pairs = list(zip(q, v, strict=True))
    return {
        "mass_matrix": lambda: compiled.mass_matrix(q),
        "crba (open tree)": lambda: [pin.crba(model, data, x) for x in q],
        "bias": lambda: compiled.bias(q, v),
        "nonLinearEffects (open tree)": lambda: [pin.nonLinearEffects(model, data, *pair) for pair in pairs],
        "coriolis": lambda: compiled.coriolis(q, v),
        "gravity": lambda: compiled.gravity(q),
        "motion_map": lambda: compiled.motion_map(q),
        "motion_map with its rate": lambda: compiled.motion_map(q, v),
        "link_jacobian": lambda: compiled.link_jacobian(q, link),
        "energy": lambda: compiled.energy(q, v),
    }


if __name__ == "__main__":
    raise SystemExit(main())
