"""What losses that grow with load cost in compiled models: time and operations over the models without.

Every joint with a motor rubs, or has a gear that loses. Times are of batches, by processor time, all models
in turn; errors are those against the general path.
"""

from __future__ import annotations

from functools import partial
from time import process_time

import numpy as np

import hybridyn
from benchmarks.cases import case_of
from benchmarks.results import Row
from benchmarks.timing import interleaved
from hybridyn.compiled import operations
from hybridyn.compiled.equations.settling import NEWTON
from hybridyn.compiled.equations.sweeps_needed import friction_sweeps
from hybridyn.effects import GearEfficiency, LoadFriction, choose

ROBOTS = ("five_bar", "gough_stewart", "lx4")
#: Friction coefficient of slides, friction coefficient times radius of hinges [m], efficiency of gears.
NORMAL, RADIAL, EFFICIENCY = 0.05, 2e-3, 0.9
WIDTH = 0.05


def measure(case: str, samples: int = 1_000, rounds: int = 20) -> list[Row]:
    """Measure both models of a robot with load friction and with gears, against those without.

    Args:
        case: A shipped robot.
        samples: Of a batch.
        rounds: Measurements of each.
    """
    one = case_of(case)
    robot = one.load()
    kinds = dict(zip(robot.joints, robot.kinds, strict=True))
    law = LoadFriction(
        normal={motor: NORMAL for motor in robot.motors if kinds[motor].slides},
        radial={motor: RADIAL for motor in robot.motors if kinds[motor].hinge},
        width=WIDTH,
    )
    gears = GearEfficiency(dict.fromkeys(robot.motors, EFFICIENCY), width=WIDTH)
    laws = {"none": None, "load friction": ["default", law], "gears": ["default", gears]}
    models = {name: hybridyn.compile(robot, on, wait=True) for name, on in laws.items()}
    q, v, a = one.states(robot, samples)
    tau = models["none"].idm(q, v, a)
    rubs, one_module = choose(robot, laws["load friction"]), len(robot.modules) == 1
    steps = {"load friction": NEWTON if one_module else friction_sweeps(robot, rubs, "float64")}
    rows: list[Row] = []
    for model, last in (("idm", a), ("ddm", tau)):
        calls = [partial(getattr(compiled, model), q, v, last) for compiled in models.values()]
        times = [least for least, _ in interleaved(calls, rounds, clock=process_time)]
        counted = [operations(robot, choose(robot, on), model) for on in laws.values()]
        for (name, on), time, count, call in zip(laws.items(), times, counted, calls, strict=True):
            if name == "none":
                continue
            few = slice(0, 4)
            exact = getattr(hybridyn, model)(robot, q[few], v[few], last[few], effects=on)
            error = float(np.abs(call()[few] - exact).max() / np.abs(exact).max())
            iterations = float(steps.get(name, 0)) if model == "ddm" else 0.0  # motors balance it
            rows.append(Row(
                case, model, name, batch=samples, error=error, us=1e6 * time / samples, value=time / times[0],
                operations=count / counted[0], iterations=iterations,
            ))  # fmt: skip
    return rows
