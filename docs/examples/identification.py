"""How well are masses found through closed loops, from noisy motors alone?

The bodies of an LX4 and of a Delta are up to 30 % heavier or lighter than their files say. Each robot plays
an exciting motion; the log has 2 % noise on efforts and 1e-5 m or rad on encoders. The identified robot then
predicts the efforts of another motion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pictures import COLOURS, INK, figure, options, plain, row, save, snapshots

import hybridyn
from hybridyn.identification.parameters import standard_parameters
from hybridyn.identification.robot_with import with_parameters

NOISE, ENCODERS = 0.02, 1e-5
PERIOD, BAND, RATE = 5.0, 2.0, 200.0
WORDS = {"effects": "model", "symmetric": True}


class Study(NamedTuple):
    """What was found of a robot.

    Attributes:
        robot: The robot of the file.
        found: Its identification.
        true: Its true base parameters, shape (rank,).
        errors: RMS error of efforts of the other motion over their RMS, by the file and as identified.
        postures: Postures of the exciting motion.
    """

    robot: hybridyn.HybridRobot
    found: hybridyn.Identification
    true: np.ndarray
    errors: np.ndarray
    postures: list[np.ndarray]


def perturbed(
    robot: hybridyn.HybridRobot, rng: np.random.Generator
) -> tuple[hybridyn.HybridRobot, np.ndarray]:
    """Return a robot with heavier and lighter bodies, and its standard parameters; equal legs stay equal."""
    standard = standard_parameters(robot, **WORDS)
    values = standard.values.copy()
    for at in sorted({tuple(at) for at in standard.bodies.values()}):
        values[list(at)] *= 1 + rng.uniform(-0.3, 0.3)
    return with_parameters(robot, values, **WORDS), values


def recorded(
    motion: hybridyn.Excitation,
    true: hybridyn.HybridRobot,
    compiled: hybridyn.CompiledRobot,
    rng: np.random.Generator,
) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Return the log of a motion, the true efforts without noise, and postures."""
    time = np.arange(round(PERIOD * RATE)) / RATE
    x, x_dot, x_ddot = motion.at(time)
    q, v, a = compiled.assemble(motors=(x, x_dot, x_ddot))
    tau = hybridyn.idm(true, q, v, a, effects="model")
    noisy = tau + NOISE * tau.std(axis=0) * rng.normal(size=tau.shape)
    seen = x + ENCODERS * rng.normal(size=x.shape)
    log = {"time": time}
    for i, motor in enumerate(true.motors):
        log[f"{motor}/position"], log[f"{motor}/effort"] = seen[:, i], noisy[:, i]
    return log, tau, q


def study(name: str, evaluations: int) -> Study:
    """Excite, log, identify, and predict a motion that was not used."""
    robot, rng = hybridyn.load(name), np.random.default_rng(7)
    compiled = hybridyn.compile(robot, "model")
    true, values = perturbed(robot, rng)
    motions = [
        hybridyn.excitation(robot, **WORDS, period=PERIOD, evaluations=n, seed=seed, compiled=compiled)
        for seed, n in ((0, evaluations), (1, 1))
    ]
    log, _, q = recorded(motions[0], true, compiled, rng)
    second, tau, _ = recorded(motions[1], true, compiled, rng)
    found = hybridyn.identify(
        robot, log, **WORDS, period=PERIOD, band=BAND, validate=second, compiled=compiled
    )
    time = second["time"]
    states = compiled.assemble(motors=motions[1].at(time))
    errors = [
        np.linalg.norm(hybridyn.idm(one, *states, effects="model") - tau, axis=0)
        / np.linalg.norm(tau, axis=0)
        for one in (robot, found.identified)
    ]
    base = hybridyn.base_parameters(robot, **WORDS).combination @ values
    away = (found.values - base) / found.deviation
    print(
        f"{name}: {len(base)} base parameters, condition {found.condition:.3g}; "
        f"errors over deviations {np.sqrt(np.mean(away**2)):.2f} (RMS), {np.abs(away).max():.1f} at most"
    )
    print(
        f"  efforts of another motion: {errors[0].mean():.2%} off by the file, {errors[1].mean():.3%} as "
        f"identified; residuals that are no noise: {int(found.fit.coloured.sum())} of {len(robot.motors)}, "
        f"in the other motion {int(found.validation.coloured.sum())}"
    )
    assert errors[1].mean() < errors[0].mean() / 5
    return Study(robot, found, base, np.array(errors), [q[0], q[len(q) // 3]])


def main(words: list[str] | None = None) -> None:
    """Study both robots, and draw what was found."""
    asked = options(__doc__, words)
    studies = [study(name, 2 if asked.short else 60) for name in ("lx4", "delta")]
    picture = figure(8.4, 5.6)
    for one, low in zip(studies, (0.58, 0.09), strict=True):
        view, *unused = row(picture, 3, low, 0.36, views=True)
        snapshots([view], one.robot, one.postures[1:])
        empty, parameters, motors = row(picture, 3, low, 0.34)
        for axis in (*unused, empty):
            axis.remove()
        size = np.maximum(np.abs(one.true), 1e-6 * np.abs(one.true).max())
        claimed, made = 100 * one.found.deviation / size, 100 * np.abs(one.found.values - one.true) / size
        parameters.loglog(claimed, made, ".", color=COLOURS[1])
        ends = np.array([claimed.min(), claimed.max()])
        parameters.loglog(ends, ends, "--", color="#b8bec6", lw=1)
        plain(parameters, "errors of base parameters", "made [%]", "standard deviation claimed [%]")
        for errors, colour, label in zip(
            one.errors, ("#b8bec6", COLOURS[1]), ("file", "identified"), strict=True
        ):
            at = np.arange(1, len(errors) + 1)
            motors.semilogy(at, 100 * errors, "o-", ms=3, lw=0.8, color=colour, label=label)
        motors.legend(fontsize=7, frameon=False)
        plain(motors, "errors of efforts, other motion", "[%]", "motor")
        view.set_title(one.robot.name, fontsize=9, color=INK)
    print(save(picture, asked, "identification"))


if __name__ == "__main__":
    main()
