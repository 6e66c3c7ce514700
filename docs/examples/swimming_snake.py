"""A snake without ground turns round: it bends, lets the bend travel around its body, and straightens.

No force acts from outside, so momentum and centre of mass stay where they are, and yet it ends up turned
about its own axis: the way in which a cat lands on its feet.
"""

from __future__ import annotations

import numpy as np
from pictures import COLOURS, INK, figure, options, plain, row, save, snapshots

import hybridyn
from hybridyn.scenes.controllers import ComputedTorque
from hybridyn.scenes.references import Reference

STAYS = 1e-3  # how far integration with a relative tolerance of 1e-4 may move the centre of mass [m]
BEND = 0.015  # how far each leg of a module goes in or out [m]
RAMP, ROUND = 0.3, 0.9  # bending takes one, the bend's way around the body the other [s]


def wave(t: np.ndarray, modules: int) -> np.ndarray:
    """Return positions, rates and accelerations of the legs, shape (3, T, motors)."""
    fine = 1e-4  # derivatives of a smooth function, by differences
    return np.array([f(t, modules, fine) for f in (_place, _rate, _change)])


def _place(t: np.ndarray, modules: int, fine: float = 0.0) -> np.ndarray:
    """Return the legs' positions, shape (T, motors)."""
    del fine
    grow, shrink = _step(t / RAMP), _step((t - RAMP - ROUND) / RAMP)
    angle = 2 * np.pi * _step((t - RAMP) / ROUND)
    legs = np.tile(2 * np.pi * np.arange(3) / 3, modules)
    out: np.ndarray = BEND * (grow - shrink)[:, None] * np.cos(angle[:, None] - legs)
    return out


def _rate(t: np.ndarray, modules: int, fine: float) -> np.ndarray:
    return (_place(t + fine, modules) - _place(t - fine, modules)) / (2 * fine)


def _change(t: np.ndarray, modules: int, fine: float) -> np.ndarray:
    return (_place(t + fine, modules) - 2 * _place(t, modules) + _place(t - fine, modules)) / fine**2


def _step(x: np.ndarray) -> np.ndarray:
    """Go from 0 to 1 while x does, at rest at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def turned(run_q: np.ndarray) -> np.ndarray:
    """Return by how much the root is turned from where it began, shape (T,), [degrees]."""
    out: np.ndarray = np.degrees(2 * np.arctan2(np.linalg.norm(run_q[:, 3:6], axis=1), np.abs(run_q[:, 6])))
    return out


def main(words: list[str] | None = None) -> None:
    """Let it swim, and draw."""
    asked = options(__doc__, words)
    modules = 2 if asked.short else 4
    robot = hybridyn.load("snake", base="floating", gravity=(0, 0, 0), xacro_args={"n": modules})
    end = 2 * RAMP + ROUND
    knots = np.linspace(0.0, end, 151)
    wanted = Reference(knots, wave(knots, modules), True, robot.home)
    law = ComputedTorque(robot, wanted, 400.0, 40.0)
    times = np.linspace(0.0, 0.06, 4) if asked.short else np.linspace(0.0, end, 76)
    run = hybridyn.simulate(
        robot, robot.home, np.zeros(robot.nv), (0.0, times[-1]),
        effort=law, rtol=1e-4, atol=1e-5, output_times=times,
    )  # fmt: skip
    centre = hybridyn.centre_of_mass(robot, run.q)
    momentum = hybridyn.momentum(robot, run.q, run.v)
    angle = turned(run.q)
    moved = np.linalg.norm(centre - centre[0], axis=1)
    print(f"turned by {angle[-1]:.1f} degrees; its centre of mass moved by {moved.max():.1e} m")
    assert moved.max() < STAYS

    picture = figure(8.4, 5.2)
    moments = [round(i * (len(times) - 1) / 4) for i in range(5)]
    views = row(picture, 5, 0.47, 0.47, views=True)
    snapshots(views, robot, [run.q[i] for i in moments], lift=0.2)
    for axis, i in zip(views, moments, strict=True):
        axis.set_title(f"{run.t[i]:.2f} s", fontsize=9, color=INK)
    left, middle, right = row(picture, 3, 0.1, 0.3)
    for k in range(3):
        left.plot(run.t, run.tau[:, k], color=COLOURS[k], lw=1, label=robot.motors[k])
    left.legend(fontsize=7, frameon=False)
    plain(left, "forces of the first module", "[N]")
    middle.plot(run.t, angle, color=COLOURS[3])
    plain(middle, "turned from where it began", "[degrees]")
    right.semilogy(run.t[1:], np.abs(momentum[1:, 3:]).max(axis=1) + 1e-18, color=COLOURS[4])
    plain(right, "angular momentum: none", "[kg m$^2$/s]")
    print(save(picture, asked, "swimming_snake"))


if __name__ == "__main__":
    main()
