"""A linear quadratic regulator holds a Gough-Stewart platform: how far from its posture is it still linear?

The robot is linearised about a leaning posture in the coordinates of its motors. Its legs push like stilts:
without feedback the platform falls. The regulator's gains come from the derivatives of the direct model along
the loops; the response of the whole robot is compared with that of the linear model.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from pictures import COLOURS, figure, options, plain, row, save, snapshots
from scipy.linalg import expm, solve_continuous_are

import hybridyn

POSE = {"x": 0.03, "y": -0.02, "roll": 0.15, "pitch": -0.1, "yaw": 0.1}
OFFSETS = (0.002, 0.02, 0.06)  # of the longest leg, at the start [m]
POSITION, RATE, FORCE = 0.01, 0.1, 100.0  # what counts alike in the cost [m, m/s, N]
STEP = 1e-5  # of finite differences [m, m/s]


class Platform:
    """The robot in the coordinates of its motors: m, their positions, and u, their rates."""

    def __init__(self, robot: hybridyn.HybridRobot, posture: np.ndarray) -> None:
        self.robot, self.compiled, self.posture = robot, hybridyn.compile(robot), posture

    def accelerations(self, m: np.ndarray, u: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Compute u_dot, shape (T, 6), closing the loops from the motors."""
        q, v, _ = self.compiled.close(m, u, last=self.posture)
        return self.compiled.ddm(q, v, tau)[..., self.robot.motor_v]

    def linear(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute A and B of x_dot = A x + B tau about the posture at rest, x = (m, u)."""
        v, still, one = np.zeros(self.robot.nv), np.zeros((6, 6)), np.eye(6)
        J = hybridyn.ddm_jacobian(self.robot, self.posture, v, tau, coordinates="motors")
        return np.block([[still, one], [J["q"], J["v"]]]), np.vstack([still, J["tau"]])

    def by_differences(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute the same by central differences of the compiled model, all in one batch."""
        return self._differences(tau, self.accelerations)

    def one_by_one(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute the same by central differences of single calls."""

        def model(*rows: np.ndarray) -> np.ndarray:
            return np.array([self.accelerations(*each) for each in zip(*rows, strict=True)])

        return self._differences(tau, model)

    def _differences(
        self, tau: np.ndarray, model: Callable[..., np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute A and B by central differences of accelerations."""
        steps = np.vstack([np.eye(18), -np.eye(18)]) * np.repeat([STEP, STEP, 1.0], 6)
        x = np.concatenate([self.posture[self.robot.motor_q], np.zeros(6), tau]) + steps
        values = model(x[:, :6], x[:, 6:12], x[:, 12:])
        rows = ((values[:18] - values[18:]).T / 2) / np.repeat([STEP, STEP, 1.0], 6)
        return np.vstack([np.eye(12)[6:], rows[:, :12]]), np.vstack([np.zeros((6, 6)), rows[:, 12:]])


def seconds(call: object, *arguments: np.ndarray) -> float:
    """Return the least time of a call."""
    assert callable(call)
    times = []
    for _ in range(20):
        start = time.perf_counter()  # clocks of processor time may stand still so long
        call(*arguments)
        times.append(time.perf_counter() - start)
    return min(times)


def main(words: list[str] | None = None) -> None:
    """Linearise, regulate and compare."""
    asked = options(__doc__, words)
    robot = hybridyn.load("gough_stewart")
    height = hybridyn.kinematics(robot, robot.home, np.zeros(robot.nv))["m1_platform"].pose[2]
    pose = POSE | {"z": height}
    posture = hybridyn.assemble(robot, platforms={"m1_platform": (pose, dict.fromkeys(pose, 0.0))})[0]
    platform = Platform(robot, posture)
    still = np.zeros(robot.nv)
    tau = platform.compiled.gravity(posture)
    A, B = platform.linear(tau)
    for exact, difference in zip((A, B), platform.by_differences(tau), strict=True):
        assert np.allclose(difference, exact, rtol=0, atol=1e-6 * np.abs(exact).max())
    spent = seconds(platform.linear, tau)
    ratios = [seconds(call, tau) / spent for call in (platform.by_differences, platform.one_by_one)]
    falls = np.linalg.eigvals(A).real.max()
    assert falls > 0.1, "without feedback the platform falls"
    Q, R = np.diag(np.repeat([POSITION, RATE], 6) ** -2.0), np.eye(6) / FORCE**2
    K = np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))
    closed = A - B @ K
    decay = -np.linalg.eigvals(closed).real.max()
    print(
        f"without feedback it falls with {falls:.2g} 1/s; regulated, all decays with {decay:.2g} 1/s at least"
    )
    print(f"central differences take {ratios[0]:.1f} times as long as the derivatives in one batch,")
    print(f"{ratios[1]:.0f} times as long call by call")

    times = np.linspace(0.0, 0.05 if asked.short else 0.6, 6 if asked.short else 121)
    at, columns = platform.robot.motor_q, platform.robot.motor_v
    offset = np.array([1.0, -0.6, 0.3, -0.8, 0.5, -0.2])
    runs, linear, worst = [], [], []
    for size in OFFSETS:
        m = posture[at] + size * offset
        q0 = platform.compiled.close(m, last=posture)[0]

        def law(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            return tau - K @ np.concatenate([q[at] - posture[at], v[columns]])

        run = hybridyn.simulate(
            robot, q0, still, (0.0, times[-1]), effort=law, compiled=platform.compiled, rtol=1e-7, atol=1e-9,
            output_times=times,
        )  # fmt: skip
        runs.append(run)
        start = np.concatenate([size * offset, np.zeros(6)])
        linear.append(np.array([expm(closed * t) @ start for t in times]))
        worst.append(np.abs(run.q[:, at] - posture[at] - linear[-1][:, :6]).max() / size)
    print("off the linear model, of the offset:", ", ".join(f"{100 * x:.2g} %" for x in worst))
    assert worst[0] < worst[-1] < 0.5, "the smaller the offset, the more linear"
    assert asked.short or np.abs(runs[-1].q[-1, at] - posture[at]).max() < 0.05 * OFFSETS[-1]

    picture = figure(8.4, 5.4)
    views = row(picture, 2, 0.44, 0.5, views=True)
    snapshots(views, robot, [runs[-1].q[0], posture], meshes=True)
    for axis, text in zip(views, (f"{1e3 * OFFSETS[-1]:.0f} mm off", "its posture"), strict=True):
        axis.set_title(text, fontsize=9)
    axes = row(picture, 3, 0.09, 0.3)
    for axis, run, line, size, off in zip(axes, runs, linear, OFFSETS, worst, strict=True):
        for k in range(6):
            axis.plot(times, 1e3 * (run.q[:, at[k]] - posture[at[k]]), color=COLOURS[k], lw=1.2)
            axis.plot(times, 1e3 * line[:, k], color=COLOURS[k], lw=0.8, ls="--")
        plain(axis, f"legs, {1e3 * size:g} mm: linear to {100 * off:.1g} %", "[mm]")
    print(save(picture, asked, "platform_lqr"))


if __name__ == "__main__":
    main()
