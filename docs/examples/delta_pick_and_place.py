"""How fast may a Delta pick and place a part of 0.5 kg?

Up, across and down along one smooth path, and back without the part. The inverse model is quick enough to
look for the shortest cycle that the motors' limits allow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pictures import COLOURS, INK, figure, options, plain, row, save, snapshots

import hybridyn
from hybridyn.effects import Payload
from hybridyn.studies.sizing import motor_rows

PART = 0.5  # [kg]
ACROSS, LIFT, FLOOR = 0.3, 0.06, -0.68  # of the path [m]
UP, OVER, DOWN = (0.0, 0.4), (0.15, 0.85), (0.6, 1.0)  # parts of the half cycle


class Cycle(NamedTuple):
    """One cycle: times, postures and what the motors do."""

    t: np.ndarray
    q: np.ndarray
    tool: np.ndarray
    tau: np.ndarray
    speed: np.ndarray


def step(s: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """Go from 0 to 1 within a span of s, at rest at both ends: value and two derivatives, shape (3, T)."""
    width = span[1] - span[0]
    x = np.clip((s - span[0]) / width, 0.0, 1.0)
    value = x**3 * (10 - 15 * x + 6 * x**2)
    return np.array([value, 30 * x**2 * (1 - x) ** 2 / width, 60 * x * (1 - x) * (1 - 2 * x) / width**2])


def half(rows: int, duration: float, direction: float) -> tuple[dict[str, np.ndarray], ...]:
    """Return x, y and z of the tool on the way there (1) or back (-1), with rates and accelerations."""
    s = np.linspace(0.0, 1.0, rows)
    x = direction * ACROSS * (step(s, OVER) - [[0.5], [0], [0]])
    z = LIFT * (step(s, UP) - step(s, DOWN)) + [[FLOOR], [0], [0]]
    units = (1.0, 1 / duration, 1 / duration**2)
    return tuple({"x": x[k] * u, "y": 0 * s, "z": z[k] * u} for k, u in enumerate(units))


def cycle(empty: hybridyn.HybridRobot, full: hybridyn.HybridRobot, duration: float, rows: int) -> Cycle:
    """Compute a cycle of a given duration [s]: there with the part, back without."""
    parts = []
    for robot, direction in ((full, 1.0), (empty, -1.0)):
        path = half(rows, duration / 2, direction)
        q, v, a = hybridyn.assemble(robot, platforms={"m1_platform": path})
        tool = np.column_stack([path[0]["x"], path[0]["z"]])
        parts.append((q, tool, hybridyn.idm(robot, q, v, a, effects="model"), motor_rows(robot, q, v)[1]))
    t = np.linspace(0.0, duration / 2, rows)
    there, back = parts
    return Cycle(
        np.concatenate([t, t + duration / 2]), *(np.concatenate(x) for x in zip(there, back, strict=True))
    )


def main(words: list[str] | None = None) -> None:
    """Find the shortest cycle, and draw it."""
    asked = options(__doc__, words)
    empty = hybridyn.load("delta")
    full = hybridyn.with_effects(empty, [Payload("m1_platform", PART)])
    limits = {joint.name: joint for joint in empty.description.joints}
    effort = np.array([limits[name].effort for name in empty.motors])
    speed = np.array([limits[name].velocity for name in empty.motors])
    rows = 26 if asked.short else 126
    slow, fast = 2.0, 0.1
    while slow - fast > (0.3 if asked.short else 2e-3):
        middle = (slow + fast) / 2
        tried = cycle(empty, full, middle, rows)
        possible = bool((np.abs(tried.tau) <= effort).all() and (np.abs(tried.speed) <= speed).all())
        slow, fast = (middle, fast) if possible else (slow, middle)
    best = cycle(empty, full, slow, rows)
    print(
        f"shortest cycle {slow:.3f} s: {60 / slow:.0f} parts a minute; peak {np.abs(best.tau).max():.1f} N m"
    )
    assert (np.abs(best.tau) <= effort).all()

    picture = figure(8.4, 5.2)
    moments = [0, rows // 2, rows - 1]
    views = row(picture, 3, 0.48, 0.46, views=True)
    snapshots(views, empty, [best.q[i] for i in moments], turn=-np.pi / 2 + 0.6, lift=0.35)
    for axis, words_ in zip(views, ("pick", "on the way", "place"), strict=True):
        axis.set_title(words_, fontsize=9, color=INK)
    left, right, path = row(picture, 3, 0.1, 0.32)
    path.plot(best.tool[:, 0], best.tool[:, 1], color=COLOURS[0])
    plain(path, "path of the platform", "z [m]", "x [m]")
    for k, name in enumerate(empty.motors):
        left.plot(best.t, best.tau[:, k], color=COLOURS[k])
        right.plot(best.t, best.speed[:, k], "--" if k == 2 else "-", color=COLOURS[k], label=name[3:7])
    for axis, limit in ((left, effort[0]), (right, speed[0])):
        axis.axvspan(0, slow / 2, color="#f1f3f5", zorder=0)
        for sign in (-1, 1):
            axis.axhline(sign * limit, color=COLOURS[5], lw=1, ls="--")
    right.legend(fontsize=7, frameon=False, loc="upper left")
    plain(left, f"torque, {slow:.3f} s a cycle", "[N m]")
    plain(right, "speed; grey: with the part", "[rad/s]")
    print(save(picture, asked, "delta_pick_and_place"))


if __name__ == "__main__":
    main()
