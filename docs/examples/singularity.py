"""A five-bar is driven through a parallel singularity: its lower links fold onto each other.

There no effort of the motors can hold the tool, and what would hold it grows without bound on the way. A
robot that moves does not care: the direct model goes through, and the inverse model finds the efforts again
on either side.
"""

from __future__ import annotations

import numpy as np
from pictures import COLOURS, INK, figure, options, plain, row, save, snapshots

import hybridyn

EFFORT = np.array([-3.0, 2.5])  # both motors swing their arms inwards [N m]
RECOVERED = 1e-6  # of the effort, wherever the measure of the singularity is above 1e-3


def main(words: list[str] | None = None) -> None:
    """Throw it, and compare."""
    asked = options(__doc__, words)
    robot = hybridyn.load("five_bar")
    times = np.linspace(0.0, 0.21, 22 if asked.short else 421)
    run = hybridyn.simulate(
        robot, robot.home, np.zeros(robot.nv), (0.0, times[-1]),
        effort=EFFORT, rtol=1e-6 if asked.short else 1e-9, output_times=times,
    )  # fmt: skip
    watch = hybridyn.near_singularity(robot, 0.0, what="motors").function
    measure = np.array([watch(t, q, v) for t, q, v in zip(run.t, run.q, run.v, strict=True)])
    found = hybridyn.idm(robot, run.q, run.v, run.a)
    held = hybridyn.idm(robot, run.q, 0 * run.v, 0 * run.a)
    lost = np.abs(found - EFFORT).max(axis=1)
    crossing = int(measure.argmin())
    print(f"measure of singularity: {measure[0]:.2f} at home, {measure.min():.1e} at {run.t[crossing]:.3f} s")
    print(
        f"efforts found again to {lost.max():.1e} N m; to hold it still there: {np.abs(held).max():.3g} N m"
    )
    assert lost[measure > 1e-3].max() < RECOVERED * np.abs(EFFORT).max()

    picture = figure(8.0, 5.4)
    rows = [0, crossing // 2, crossing, len(run.t) - 1]
    views = row(picture, 4, 0.5, 0.44, views=True)
    snapshots(views, robot, [run.q[i] for i in rows], turn=-np.pi / 2, lift=0.05)
    for axis, i in zip(views, rows, strict=True):
        axis.set_title(f"{run.t[i]:.3f} s" + (": singular" if i == crossing else ""), fontsize=9, color=INK)
    left, right = row(picture, 2, 0.09, 0.34)
    left.semilogy(run.t, measure, color=COLOURS[2])
    plain(left, "how far from losing a motion", "least / largest singular value")
    right.semilogy(run.t, np.abs(held[:, 0]), color=COLOURS[5], label="what would hold it still")
    right.semilogy(run.t, np.abs(found[:, 0]), color=COLOURS[0], lw=2.5, label="what moves it, found by idm")
    right.semilogy(run.t, np.maximum(lost, 1e-16), color=COLOURS[7], lw=0.8, label="error of that")
    right.legend(fontsize=7, frameon=False, loc="center right")
    plain(right, "effort of the left motor", "[N m]")
    print(save(picture, asked, "singularity"))


if __name__ == "__main__":
    main()
