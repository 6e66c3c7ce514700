"""Computed torque on a Gough-Stewart platform that carries a UR5: what must the controller know?

The platform leans while the arm reaches out. Start and reference differ by some millimetres and degrees. A
controller that knows all that acts lets the error decay as chosen; one that knows rigid bodies only is left
with what friction and rotors ask for.
"""

from __future__ import annotations

import numpy as np
from pictures import COLOURS, INK, figure, options, plain, row, save, snapshots

import hybridyn
from hybridyn.scenes.controllers import ComputedTorque
from hybridyn.scenes.references import MotorAxes, RestPosture, from_points
from hybridyn.simulation.result import SimulationResult

KP, KD = 400.0, 40.0  # critically damped: errors decay with 20 1/s
REACH = {"shoulder_lift_joint": -0.7, "elbow_joint": 0.9, "wrist_1_joint": -1.2, "shoulder_pan_joint": 0.5}
LEAN = {"m1_leg1_slide": 0.04, "m1_leg2_slide": 0.04, "m1_leg4_slide": -0.03, "m1_leg5_slide": -0.03}
OFF = {"m1_leg1_slide": 0.004, "m1_leg3_slide": -0.003, "shoulder_lift_joint": -1.26, "elbow_joint": 1.57}
KNOWN = {"all that acts": "model", "rigid bodies only": None}


def main(words: list[str] | None = None) -> None:
    """Simulate both, and compare."""
    asked = options(__doc__, words)
    robot = hybridyn.load("stewart_ur5")
    axes = MotorAxes.of(robot)
    home = dict(zip(robot.motors, axes.positions(robot.home), strict=True))
    wanted = from_points(robot, [RestPosture(0.0, {}, {}), RestPosture(0.8, REACH | LEAN, {})], robot.home)
    q0, v0, _ = hybridyn.assemble(robot, motors={name: (OFF.get(name, x),) for name, x in home.items()})
    times = np.linspace(0.0, 0.05, 6) if asked.short else np.linspace(0.0, 1.2, 121)
    runs: dict[str, SimulationResult] = {}
    late: dict[str, np.ndarray] = {}
    for what, effects in KNOWN.items():
        law = ComputedTorque(robot, wanted, KP, KD, effects)
        run = hybridyn.simulate(
            robot,
            q0,
            v0,
            (0.0, times[-1]),
            effort=law,
            effects="model",
            rtol=1e-5,
            atol=1e-7,
            output_times=times,
        )
        runs[what] = run
        late[what] = np.array([axes.error(wanted.at(t)[0], q) for t, q in zip(run.t, run.q, strict=True)])
        print(f"{what}: left at the end {np.abs(late[what][-1, :6]).max() * 1e3:.2g} mm, "
              f"{np.degrees(np.abs(late[what][-1, 6:]).max()):.2g} degrees")  # fmt: skip
    knows, blind = late.values()
    expected = (1 + 20 * times) * np.exp(-20 * times)
    assert np.allclose(knows, knows[0] * expected[:, None], atol=1e-4), "errors decay as chosen"
    assert np.abs(blind[-1]).max() > np.abs(knows[-1]).max()

    run = runs["all that acts"]
    picture = figure(8.4, 5.6)
    moments = [0, len(times) // 3, len(times) - 1]
    views = row(picture, 3, 0.46, 0.5, views=True)
    snapshots(views, robot, [run.q[i] for i in moments], meshes=True)
    for axis, i in zip(views, moments, strict=True):
        axis.set_title(f"{run.t[i]:.2f} s", fontsize=9, color=INK)
    legs, arm, load = row(picture, 3, 0.09, 0.32)
    for colour, (what, error) in zip((COLOURS[0], COLOURS[5]), late.items(), strict=True):
        legs.semilogy(times, np.abs(error[:, :6]).max(axis=1) * 1e3, color=colour, label=f"knows {what}")
        arm.semilogy(times, np.degrees(np.abs(error[:, 6:]).max(axis=1)), color=colour)
    legs.legend(fontsize=7, frameon=False)
    plain(legs, "largest error, legs", "[mm]")
    plain(arm, "largest error, arm", "[degrees]")
    for k in range(6):
        load.plot(
            times, run.tau[:, 6 + k], color=COLOURS[k], lw=1, label=robot.motors[6 + k].removesuffix("_joint")
        )
    load.legend(fontsize=6, frameon=False)
    plain(load, "torques of the arm", "[N m]")
    print(save(picture, asked, "stewart_ur5_computed_torque"))


if __name__ == "__main__":
    main()
