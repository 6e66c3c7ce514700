"""Which drives does an LX4 need that swings a payload around in a circle?

Four stacked Gough-Stewart platforms lean over, each by the same angle, and let the direction of leaning go
round once in two seconds. Peak and RMS force of every leg, with payloads from nothing to 20 kg at the top,
against a drive from a catalogue.
"""

from __future__ import annotations

import numpy as np
from pictures import COLOURS, INK, figure, options, plain, save, snapshots

import hybridyn
from hybridyn.effects import Payload
from hybridyn.studies.sizing import MotorLoad, Sizing, motor_rows

LEAN = 0.12  # of each platform [rad]
ROUND = 2.0  # [s]
PLATFORMS = ("m1_platform", "m2_platform@m1_platform", "m3_platform@m2_platform", "m4_platform@m3_platform")
PEAK, RATED = 1100.0, 500.0  # force of the drive, for a moment and for ever [N]


def motion(robot: hybridyn.HybridRobot, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, rates and accelerations of every joint: platforms lean, the direction goes round."""
    poses = hybridyn.kinematics(robot, robot.home, np.zeros(robot.nv))
    heights = np.diff([0.0, *(poses[f"m{k}_platform"].pose[2] for k in range(1, 5))])
    w = 2 * np.pi / ROUND
    roll, pitch = LEAN * np.cos(w * t), LEAN * np.sin(w * t)
    still = 0 * t
    targets = {}
    for name, height in zip(PLATFORMS, heights, strict=True):
        where = {"x": still, "y": still, "z": still + height, "roll": roll, "pitch": pitch, "yaw": still}
        rate = dict.fromkeys(where, still) | {"roll": -w * pitch, "pitch": w * roll}
        change = dict.fromkeys(where, still) | {"roll": -(w**2) * roll, "pitch": -(w**2) * pitch}
        targets[name] = (where, rate, change)
    return hybridyn.assemble(robot, platforms=targets)


def loads(robot: hybridyn.HybridRobot, t: np.ndarray) -> list[MotorLoad]:
    """Return what the motion asks of each motor."""
    q, v, a = motion(robot, t)
    sizing = Sizing(robot)
    sizing.add(t, 1, *motor_rows(robot, q, v), hybridyn.idm(robot, q, v, a, effects="model"))
    return list(sizing.loads())


def main(words: list[str] | None = None) -> None:
    """Size it, and draw."""
    asked = options(__doc__, words)
    robot = hybridyn.load("lx4")
    t = np.linspace(0.0, ROUND, 21 if asked.short else 401)
    masses = (0.0, 20.0) if asked.short else (0.0, 5.0, 10.0, 15.0, 20.0)
    peak, rms, speed = [], [], 0.0
    for mass in masses:
        loaded = hybridyn.with_effects(robot, [Payload("m4_platform", mass)]) if mass else robot
        motors = loads(loaded, t)
        peak.append([max(abs(x.effort.value) for x in motors[6 * k : 6 * k + 6]) for k in range(4)])
        rms.append([max(x.rms_effort for x in motors[6 * k : 6 * k + 6]) for k in range(4)])
        speed = max(abs(x.speed.value) for x in motors)
        print(f"{mass:4.0f} kg: peak {max(peak[-1]):6.0f} N, RMS {max(rms[-1]):6.0f} N, {speed:.3f} m/s")
    most = np.interp(RATED, np.max(rms, axis=1), masses)
    print(f"a drive of {RATED:.0f} N ({PEAK:.0f} N for a moment) carries {most:.0f} kg for ever")
    assert np.all(np.diff(peak, axis=0)[:, 0] > 0), "the lowest module must feel the payload"

    picture = figure(8.4, 4.2)
    view = picture.add_axes((0.0, 0.02, 0.27, 0.9))
    snapshots([view], robot, [motion(robot, t)[0][0]], turn=0.25, lift=0.15)
    view.set_title("LX4, leaning", fontsize=9, color=INK)
    left, right = picture.add_axes((0.33, 0.12, 0.28, 0.8)), picture.add_axes((0.695, 0.12, 0.29, 0.8))
    for k in range(4):
        left.plot(
            masses, np.array(peak)[:, k] / 1e3, "o-", ms=3, color=COLOURS[k], label=f"module {k + 1}, peak"
        )
        left.plot(masses, np.array(rms)[:, k] / 1e3, "--", lw=1, color=COLOURS[k])
    left.axhline(PEAK / 1e3, color=COLOURS[5], lw=1)
    left.text(0, PEAK / 1e3, "drive, peak", fontsize=7, va="bottom", color=COLOURS[5])
    left.axhline(RATED / 1e3, color=COLOURS[5], lw=1, ls="--")
    left.text(0, RATED / 1e3, "drive, rated", fontsize=7, va="bottom", color=COLOURS[5])
    left.set_ylim(0.0, 1.4)
    left.legend(fontsize=7, frameon=False, ncol=2, loc="upper left")
    plain(left, "largest force in a leg (dashed: RMS)", "[kN]", "payload [kg]")
    q, v, a = motion(loaded, t)
    force, rate = hybridyn.idm(loaded, q, v, a, effects="model"), motor_rows(loaded, q, v)[1]
    for k in range(4):
        right.plot(rate[:, 6 * k : 6 * k + 6], force[:, 6 * k : 6 * k + 6] / 1e3, color=COLOURS[k], lw=0.8)
    plain(right, f"force over speed, every leg, {masses[-1]:.0f} kg", "[kN]", "speed [m/s]")
    print(save(picture, asked, "lx4_motor_sizing"))


if __name__ == "__main__":
    main()
