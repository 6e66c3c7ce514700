"""Robots of micrometres and of thousands of kilometres, of milligrams and of kilotons: units never mix.

Claim: lengths scaled by 2^+-20 (about 1e+-6) and masses by 2^+-20, every result scales as dimensional
analysis says, to 1e-12 of its largest entry (the issue's number); what is refused is refused alike, with the
same residual. Powers of two are exact in binary floating point, so a robot that mixes units nowhere gives the
same bits; any rounding that differs betrays a sum of metres and radians, of newtons and newton metres.
"""

from collections.abc import Callable
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hybridyn import HybridynError, assemble, ddm, idm, simulate
from hybridyn.description import Description
from hybridyn.errors import AssemblyError, ModelError
from hybridyn.scenes.start import _check_rates
from tests.hard.claims import Claim, apart
from tests.hard.scaling import Scale
from tests.judges.remarks import findings
from tests.oracle import Base
from tests.robots.mechanisms import KINDS, home_posture, random_mechanism, random_states, random_wrenches
from tests.robots.posing import of_joints, of_link
from tests.robots.shipped import ROBOTS, shipped, states_near_home
from tests.support.samples import slow

SAME = 1e-12  # the number; measured: not one bit differs
BIG, SMALL = 2.0**20, 2.0**-20
EXTREMES = [Scale(BIG, BIG), Scale(SMALL, SMALL)]
OTHERS = [Scale(BIG, SMALL), Scale(SMALL, BIG), Scale(BIG), Scale(SMALL), Scale(mass=BIG), Scale(mass=SMALL)]
CHOSEN = ("delta_bars", "gear_rack", "serial_all")
Results = dict[str, Any]


def described(kind: str, base: Base) -> tuple[Description, dict[str, np.ndarray], tuple[np.ndarray, ...]]:
    """Return a robot, wrenches on it, and two states."""
    if kind in KINDS:
        description = random_mechanism(0, kind=kind)
        wrenches = random_wrenches(description, 0)
        return description, wrenches, random_states(description, base, 0, 2, wrenches=wrenches)
    description = shipped(kind)
    return description, {}, states_near_home(description, base, 0, 2)


def attempt(f: Callable[[], Results]) -> Results:
    """Return what f gives, or how far open it says that loops are."""
    try:
        return f()
    except AssemblyError as error:
        return {"residual": np.array(float(error.residual or 0.0)), "words": str(error).split(":")[0]}
    except HybridynError as error:
        return {"refused": type(error).__name__}


def held(claim: Claim, case: str, what: str, given: list[tuple[Results, Results]]) -> None:
    """Claim that scaled results, each beside the unscaled ones, are the same."""
    worst = 0.0
    for actual, expected in given:
        assert actual.keys() == expected.keys(), f"{case}, {what}: {actual} and {expected}"
        for name, value in expected.items():
            if isinstance(value, str | list):
                assert actual[name] == value, f"{case}, {what}, {name}"
            else:
                worst = max(worst, apart(np.asarray(actual[name]), np.asarray(value)))
    claim(case, f"{what}: difference between a robot and the same scaled", worst, SAME)


# -------------------------------------------------------------------- load, idm, ddm


def dynamics(kind: str, base: Base, scale: Scale) -> Results:
    """Return what loading remarks, accelerations and efforts with reactions, scaled back."""
    description, wrenches, (q, v, a) = described(kind, base)
    robot = scale.robot(description, base)
    of_q, of_v, of_tau, of_W = scale.of_q(robot), scale.of_v(robot), scale.of_tau(robot), scale.of_wrench
    tau = 20 * np.random.default_rng(0).normal(size=(len(q), len(robot.motors)))
    state, on = (q * of_q, v * of_v), {name: wrench * of_W for name, wrench in wrenches.items()}
    few = base == "floating" or len(robot.motors) < robot.mobility
    how = {"wrenches": on, "weights": 1 / of_tau**2, "passive": "solved" if few else "given"}
    out: Results = {"findings": findings(robot), "mobility": str([m.mobility for m in robot.modules])}
    moved, reactions = ddm(robot, *state, tau * of_tau, wrenches=on, reactions=True)
    out["a"] = moved / of_v
    if base == "fixed":
        out["base"] = reactions.base / of_W
    out |= {f"F of {name}": wrench / of_W for name, wrench in reactions.modules.items() if base == "fixed"}
    efforts = attempt(lambda: {"tau": idm(robot, *state, a * of_v, **how) / of_tau})
    opened = state[0].copy()
    opened[:, -1] *= 1.01
    refused = attempt(lambda: {"a": ddm(robot, opened, state[1], tau * of_tau) / of_v})
    out |= {f"idm {k}": x for k, x in efforts.items()} | {f"open {k}": x for k, x in refused.items()}
    return out


@pytest.mark.parametrize(
    ("kind", "base", "scales"),
    [
        *((kind, base, EXTREMES) for base in ("fixed", "floating") for kind in CHOSEN),
        *(
            slow(kind, base, EXTREMES + OTHERS)
            for kind in (*KINDS, *ROBOTS)
            for base in ("fixed", "moving", "floating")
        ),
    ],
    ids=lambda x: str(len(x)) if isinstance(x, list) else None,
)
def test_scaled_robots_are_loaded_and_computed_alike(
    kind: str, base: Base, scales: list[Scale], claim: Claim
) -> None:
    """Findings, mobility, ddm, idm and what they refuse: three drawn kinds of robots, fixed and floating.

    The slow cases are every recipe and every shipped robot, on every base, at eight scales.
    """
    plain = dynamics(kind, base, Scale())
    held(
        claim, f"{kind}, {base} base", "idm, ddm", [(dynamics(kind, base, scale), plain) for scale in scales]
    )


# -------------------------------------------------------------------- assemble


def postures(description: Description, scale: Scale, base: Base = "fixed") -> Results:
    """Assemble along a path, from a pose, from a part of one, and out of reach; scaled back."""
    plain = Scale().robot(description, base)
    q, v, a = (x[:1] for x in states_near_home(description, base, 3, 1))
    robot = scale.robot(description, base)
    units = scale.of_q(robot), scale.of_v(robot), scale.of_v(robot)
    kinds = dict(zip(robot.joints, robot.kinds, strict=True))
    slide = {name: scale.length if kinds[name] == "prismatic" else 1.0 for name in robot.motors}
    s = np.linspace(0.0, 1.0, 20)
    start = of_joints(plain, plain.home[None], np.zeros((1, plain.nv)), np.zeros((1, plain.nv)))
    end = of_joints(plain, q, v, a)
    along = {m: (start[m][0] + (end[m][0] - start[m][0]) * s) * slide[m] for m in robot.motors}
    out: Results = {}

    def entered(name: str, f: Callable[[], tuple[np.ndarray, ...]]) -> None:
        found = attempt(lambda: {k: x / unit for k, x, unit in zip("qva", f(), units, strict=True)})
        out.update({f"{name} {k}": x for k, x in found.items()})

    entered("path", lambda: assemble(robot, motors={m: (x, x, x) for m, x in along.items()}))
    far = {m: ((end[m][0][0] + 5.0) * slide[m], 0.0, 0.0) for m in robot.motors}
    entered("far", lambda: assemble(robot, motors=far))
    module = plain.modules[-1]
    pose, twist, acceleration = (x[0] for x in of_link(plain, q, v, a, module.outputs[0], module.base))
    pose[:3] *= scale.length
    key = f"{module.outputs[0]}@{module.base}"
    inner = {m: (along[m][-1], 0.0, 0.0) for k in plain.modules[:-1] for m in k.motors}
    moved = (pose, twist * scale.of_twist, acceleration * scale.of_twist)
    entered("pose", lambda: assemble(robot, motors=inner, platforms={key: moved}))
    lifted = {"z": pose[2]}
    entered("partial", lambda: assemble(robot, motors=inner, platforms={key: (lifted, None, None)}))
    return out


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rps3", slow("tanev")])
def test_scaled_robots_are_assembled_and_followed_alike(name: str, claim: Claim) -> None:
    """Motors along a path, a whole pose, too small a part of one, motors out of reach: same words too."""
    description = shipped(name)
    plain = postures(description, Scale())
    pairs = [(postures(description, scale), plain) for scale in EXTREMES]
    held(claim, name, "assemble", pairs)


@pytest.mark.slow
def test_a_walk_around_a_fold_is_the_same_at_every_scale(claim: Claim) -> None:
    """Long steps, which are walked in smaller ones: the step that counts as none has no unit."""
    description = shipped("gough_stewart")

    def walked(scale: Scale) -> Results:
        robot = scale.robot(description)
        home = of_joints(robot, robot.home[None], np.zeros((1, robot.nv)), np.zeros((1, robot.nv)))
        s = np.array([0.0, 1.0, -1.0, 1.0])
        reach = 0.19 * scale.length * np.array([1, 1, -1, -1, 1, -1])
        motors = {m: home[m][0][0] + d * s for m, d in zip(robot.motors, reach, strict=True)}
        return attempt(lambda: {"q": assemble(robot, motors=motors)[0] / scale.of_q(robot)})

    plain = walked(Scale())
    held(claim, "gough_stewart, long steps", "assemble", [(walked(scale), plain) for scale in EXTREMES])


# -------------------------------------------------------------------- simulate


def simulated(name: str, base: Base, method: str, scale: Scale, at_rest: bool = False) -> Results:
    """Let a robot fall for a moment, without efforts; scaled back, with what was spent."""
    description = shipped(name) if name in ROBOTS else random_mechanism(0, kind=name)
    robot = scale.robot(description, base)
    of_q, of_v = scale.of_q(robot), scale.of_v(robot)
    if at_rest:
        q, v = home_posture(description, base), np.zeros(robot.nv)
    else:
        states = states_near_home if name in ROBOTS else random_states
        q, v = (x[0] for x in states(description, base, 0, 1)[:2])
    step = 1e-3 if method == "conserving" else None
    between = (0.0033, 0.0133, 0.02)
    run = simulate(robot, q * of_q, v * of_v, (0.0, 0.02), method=method, step=step, output_times=between)
    return {
        "q": run.q / of_q, "v": run.v / of_v, "status": str(run.status),
        "spent": str([run.counters.steps, run.counters.rejected, run.counters.iterations]),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "base", "method", "at_rest"),
    [
        ("delta", "fixed", "dopri5", False),
        slow("five_bar", "fixed", "implicit", False),
        ("gough_stewart", "floating", "dopri5", False),
        ("rps3", "fixed", "conserving", True),
        slow("serial_all", "floating", "conserving", False),
    ],
)
def test_scaled_robots_move_alike(name: str, base: Base, method: str, at_rest: bool, claim: Claim) -> None:
    """A short scene: the same steps, the same motion. Tolerances are in radians and module lengths."""
    plain = simulated(name, base, method, Scale(), at_rest)
    pairs = [(simulated(name, base, method, scale, at_rest), plain) for scale in EXTREMES]
    held(claim, f"{name}, {base} base, {method}", "simulate", pairs)


def test_rates_that_open_loops_are_refused_at_every_scale() -> None:
    """A slide of a robot of micrometres that is asked for a wrong rate, beside a turn."""
    description = shipped("gough_stewart")
    for scale in (Scale(), *EXTREMES):
        robot = scale.robot(description)
        v = states_near_home(description, "fixed", 0, 1)[1][0] * scale.of_v(robot)
        right = {name: v[robot.joint_index[name]] for name in ("m1_leg1_slide", "m1_leg2_cross_y")}
        wrong = right | {"m1_leg1_slide": right["m1_leg1_slide"] * (1 + 1e-3)}
        for rates, expected in ((right, False), (wrong, True)):
            initial = SimpleNamespace(rates=SimpleNamespace(joints=rates))
            source = SimpleNamespace(
                scene=SimpleNamespace(initial=initial), error=lambda _, words: ModelError(words)
            )
            with pytest.raises(ModelError, match="open loops") if expected else nullcontext():
                _check_rates(source, robot, v)  # type: ignore[arg-type]
