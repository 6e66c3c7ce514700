"""The direct model by `aba`, the oracle and the inverse model, and where it can break: light legs, input."""

import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin
import pytest

from hybridyn import ddm, idm
from hybridyn.description import Description
from hybridyn.dynamics.direct import articulate
from hybridyn.dynamics.forward import forward
from hybridyn.dynamics.loads import all_loads
from hybridyn.effects.choice import STANDARD
from hybridyn.errors import SingularityError, TrajectoryError
from hybridyn.structure.building import build_robot
from tests import ROOT
from tests.judges.judging import BACKWARD, BASES, ORACLE, drawn, efforts, judged
from tests.judges.peers import describe, example_urdf
from tests.oracle import Base
from tests.robots.mechanisms import random_mechanism
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import ROUNDING, close_to, refused
from tests.support.engines import engine_of

# -------------------------------------------------------------------- trees, against aba

ARMS = {
    "ur5_robot": "fixed",
    "panda": "fixed",
    "talos_reduced": "floating",
    "allegro_left_hand": "floating",
    "pr2": "fixed",
}


@pytest.mark.parametrize("name", ARMS)
def test_serial_robots_against_aba(name: str) -> None:
    robot = build_robot(describe(example_urdf(f"{name}.urdf")), base=ARMS[name])
    model, data, rng = robot.model, robot.model.createData(), np.random.default_rng(3)
    q = np.array([pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)) for _ in range(3)])
    v, tau = rng.normal(size=(3, model.nv)), 10 * rng.normal(size=(3, len(robot.motors)))
    spread = np.zeros_like(v)
    spread[:, [model.joints[model.getJointId(motor)].idx_v for motor in robot.motors]] = tau
    actual = ddm(robot, q, v, tau)
    for t in range(3):
        expected = pin.aba(model, data, q[t], v[t], spread[t])
        inertia = np.triu(pin.crba(model, data, q[t]))
        inertia += np.triu(inertia, 1).T
        unit = 1 / np.sqrt(
            np.diagonal(inertia)
        )  # aba's own error follows the condition of the scaled inertia
        condition = np.linalg.cond(inertia * unit * unit[:, None])
        close_to(actual[t] / unit, expected / unit, max(1e-12, 8 * np.finfo(float).eps * condition))
        terms = np.abs(inertia) @ np.abs(actual[t])
        assert np.abs(pin.rnea(model, data, q[t], v[t], actual[t]) - spread[t]).max() < BACKWARD * terms.max()


# -------------------------------------------------------------------- motors, bases, reactions


@pytest.mark.parametrize("base", BASES)
def test_robots_without_motors_fall(base: Base) -> None:
    whole, _, (q, v, _) = drawn("five_bar", base)
    description = replace(whole, motors=())
    tau = np.zeros((2, 0))
    actual = ddm(build_robot(description, base=base), q, v, tau)
    close_to(actual, judged(description, base, q, v, tau), ORACLE)


@pytest.mark.parametrize("kind", ["serial", "gough", "stack", "branched", "on_leg", "legged", "gear_across"])
def test_reactions_are_those_of_the_inverse_model(kind: str) -> None:
    description, wrenches, (q, v, _) = drawn(kind, "fixed")
    robot, tau = build_robot(description), efforts(description, 2)
    a, direct = ddm(robot, q, v, tau, wrenches=wrenches, reactions=True)
    inverse = idm(robot, q, v, a, wrenches=wrenches, reactions=True)[1]
    assert direct.modules.keys() == inverse.modules.keys()
    assert direct.closures.keys() == inverse.closures.keys()
    scale = max(np.abs(w).max() for w in direct.modules.values())
    for ours in ("base", "modules", "closures"):
        close_to(getattr(direct, ours), getattr(inverse, ours), ORACLE, scale)


LIMIT = 1e-8  # a light leg's inertia over its mass ratio, between ratios of 1e-9 and 1e-12


def test_no_joints() -> None:
    one = random_mechanism(0, kind="serial").links[0]
    body = Description("one", (replace(one, mass=2.0, inertia=np.eye(3), com=np.zeros(3)),), ())
    still = build_robot(body)
    assert ddm(still, np.zeros((4, 0)), np.zeros((4, 0)), np.zeros((4, 0))).shape == (4, 0)
    falling = ddm(
        build_robot(body, base="floating"), np.array([0.0, 0, 0, 0, 0, 0, 1]), np.zeros(6), np.zeros(0)
    )
    close_to(falling, np.array([0, 0, -9.81, 0, 0, 0]), ROUNDING)


# -------------------------------------------------------------------- light legs


def with_legs(description: Description, ratio: float) -> Description:
    """Scale mass and inertia of all but platforms."""
    return replace(
        description,
        links=tuple(
            link
            if "platform" in link.name
            else replace(link, mass=ratio * link.mass, inertia=ratio * link.inertia)
            for link in description.links
        ),
    )


@pytest.mark.parametrize("ratio", [1e-6, 1e-12, 0.0])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_light_legs_cost_no_digits(ratio: float, base: Base) -> None:
    description = with_legs(shipped("lx4", modules="2"), ratio)
    if base == "floating" or ratio == 0:
        heavy = shipped("lx4", modules="2").links[0]
        description = replace(
            description, links=tuple(heavy if x.name == heavy.name else x for x in description.links)
        )
    q, v, _ = states_near_home(description, base, 6, 1)
    tau = efforts(description, 1)
    close_to(
        ddm(build_robot(description, base=base), q, v, tau), judged(description, base, q, v, tau), ORACLE
    )


def test_the_apparent_inertia_of_light_legs_is_proportional_to_their_mass() -> None:
    """Platforms are held by nothing but legs and motors without effort: all that the base feels is the legs.

    Any difference of terms of the platform's size would leave its rounding, 1e-16 of the platform's mass.
    """
    inertias = []
    for ratio in (1e-9, 1e-12):
        robot = build_robot(with_legs(shipped("lx4", modules="2"), ratio), base="floating")
        q, v = robot.home[None], np.zeros((1, robot.nv))
        loads = all_loads(robot, STANDARD, q, v, None, None)
        module = articulate(robot, forward(robot, q, v, None), loads, np.zeros((1, 12)), None)[0]
        assert not module.inertia.massless.any()
        I_star = module.A_t[0] / ratio
        assert np.linalg.eigvalsh(I_star)[0] > 0
        inertias.append(I_star)
    close_to(inertias[1], inertias[0], LIMIT)


# -------------------------------------------------------------------- what is wrong with the input


@pytest.mark.parametrize("engine", ["general", "compiled"])
def test_base_accelerations_belong_to_a_moving_base(engine: str) -> None:
    on = engine_of(engine, build_robot(shipped("five_bar")))
    rest = on.robot.home, np.zeros(on.robot.nv), np.zeros(2)
    given = {"base_acceleration": np.zeros(6)}
    refused(lambda: on.ddm(*rest, **given), TrajectoryError, "base_acceleration is for base='moving'")


def test_accelerations_of_a_moving_base_have_a_shape() -> None:
    robot = build_robot(shipped("five_bar"), base="moving")
    rest = np.tile(robot.home, (2, 1)), np.zeros((2, robot.nv)), np.zeros((2, 2))
    for shape, words in (((5,), r"\(5,\)"), ((3, 6), r"\(3, 6\); wanted \(6,\) or \(2, 6\)")):
        asked = partial(ddm, robot, *rest, base_acceleration=np.zeros(shape))
        refused(asked, TrajectoryError, f"base_acceleration has shape {words}")


def test_a_forced_motion_without_mass_is_named() -> None:
    description, _, (q, v, _) = drawn("sps_thin", "fixed")
    robot = build_robot(description)
    rod = next(j for j in description.joints if j.kind == "prismatic" and j.name in description.motors)
    along = np.concatenate([np.zeros(3), 5 * rod.axis])
    pushed = {rod.child: np.stack([0 * along, along])}
    lower = next(j for j in description.joints if j.child == rod.parent)
    words = f"motion of joint '{lower.name}' has no inertia, and a force of .* N m acts on it"
    asked = partial(ddm, robot, q, v, efforts(description, 2), wrenches=pushed)
    refused(asked, SingularityError, words, sample=1, module=robot.modules[0].name)


# -------------------------------------------------------------------- memory


@pytest.mark.parametrize("modules", [24, pytest.param(256, marks=pytest.mark.slow)])
def test_a_long_chain_fits_in_little_memory(modules: int) -> None:
    """24 modules, nv = 504: the Data of one Pinocchio model would take tensors of nv^3, 1 GB each."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.tools.long_chain", str(modules)],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    nv, megabytes, worst = (float(x) for x in done.stdout.split())
    assert nv == 21 * modules
    assert megabytes < 400, "the interpreter and its libraries take about a quarter of it"
    assert worst < BACKWARD
