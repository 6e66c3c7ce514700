"""What time integration costs for a scene: method, step or tolerance, projection."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..errors import HybridynError
from ..joints import TreeJoint
from ..robot import HybridRobot
from ..scene import Stage
from ..simulate import simulate
from ..spatial import Array
from .points import Point, Study, timed

STEPS = (16e-3, 8e-3, 4e-3, 2e-3, 1e-3)
"""Steps of the methods with a fixed step [s]."""

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9)
"""Relative tolerances of the method that chooses its steps."""

TIGHT = 1e-12


class _Setting(NamedTuple):
    """One configuration of the integrator: its line, its words, and `simulate`'s arguments."""

    line: str
    words: str
    options: dict[str, Any]


def settings() -> Iterator[_Setting]:
    """Give the configurations that are tried."""
    for projection in ("stages", "steps", "never"):
        suffix = "" if projection == "stages" else f", projected {projection}"
        for rtol in TOLERANCES:
            options = {"method": "dopri5", "rtol": rtol, "atol": rtol * 1e-2, "projection": projection}
            usual = " (usual)" if rtol == 1e-7 and not suffix else ""
            yield _Setting(f"dopri5{suffix}", f"rtol {rtol:.0e}{usual}", options)
        for step in STEPS:
            options = {"method": "rk4", "step": step, "projection": projection}
            yield _Setting(f"rk4{suffix}", f"step {step:g} s", options)
    for method in ("implicit", "conserving"):
        for step in STEPS:
            yield _Setting(method, f"step {step:g} s", {"method": method, "step": step})


def study_runs(ready: Stage, duration: float, progress: Callable[[str], None]) -> Study:
    """Measure integrators on a scene.

    The error of a run is the distance of its last posture from the reference's: the largest displacement of a
    joint, in radians or module lengths. The reference is dopri5 at a relative tolerance of 1e-12; its own
    error is its distance from a run a hundred times as loose.

    Args:
        ready: The scene.
        duration: Time to simulate [s].
        progress: Told what is measured next.

    Raises:
        HybridynError: The scene cannot be simulated at all.
    """
    progress("reference")
    robot = ready.robot
    exact = _run(ready, duration, {"method": "dopri5", "rtol": TIGHT, "atol": TIGHT * 1e-2})
    loose = _run(ready, duration, {"method": "dopri5", "rtol": 100 * TIGHT, "atol": TIGHT})
    points = []
    for setting in settings():
        progress(f"{setting.line}, {setting.words}")
        fragment = "\n".join(["[solver]", *(f"{k} = {_toml(x)}" for k, x in setting.options.items())])
        try:
            q, seconds = timed(lambda options=setting.options: _run(ready, duration, options), 1)  # type: ignore[misc]
            points.append(Point(setting.line, setting.words, distance(robot, q, exact), seconds, fragment))
        except HybridynError as failure:
            points.append(Point(setting.line, setting.words, np.inf, np.inf, fragment, str(failure)))
    words = f"dopri5 at a relative tolerance of {TIGHT:g}"
    question = f"error of the last posture (after {duration:g} s) against time of the run"
    return Study(question, points, words, distance(robot, loose, exact), "per run")


def _run(ready: Stage, duration: float, options: dict[str, Any]) -> Array:
    """Give the last posture of a run, shape (nq,).

    Raises:
        HybridynError: The run did not reach its end.
    """
    result = simulate(
        ready.robot,
        ready.q0,
        ready.v0,
        np.array([0.0, duration]),
        effort=ready.effort,
        effects=ready.effects,
        **options,
    )
    if result.status != "finished":
        raise HybridynError(f"the run ended at {result.t[-1]:g} s: {result.status}")
    return np.asarray(result.q[-1])


def distance(robot: HybridRobot, q0: Array, q1: Array) -> float:
    """Give the largest displacement of a joint between two postures, in radians or module lengths."""
    worst = 0.0
    unit = {joint: m.mechanism.length for m in robot.modules for joint in m.joints}
    for name, kind, at in zip(robot.joints, robot.kinds, robot.q_slices, strict=True):
        joint = TreeJoint(name, kind, 0, np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]))  # type: ignore[arg-type]
        move = joint.difference(q0[None, at], q1[None, at])[0]
        sliding = {"prismatic": 1, "planar": 2, "floating": 3}.get(kind, 0)
        length = unit.get(name, 1.0)
        worst = max(
            worst, np.abs(move[:sliding]).max(initial=0.0) / length, np.abs(move[sliding:]).max(initial=0.0)
        )
    return float(worst)


def _toml(value: object) -> str:
    """Write a value as TOML does."""
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
