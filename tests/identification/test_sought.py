"""What is held in an identification does not depend on what is sought, nor on the file's guess of it."""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import Payload
from hybridyn.identification.base_parameters import base_parameters
from hybridyn.identification.parameters import standard_parameters
from hybridyn.identification.sought import linear_model
from hybridyn.structure.robot import joint_position
from tests.identification.robots import flight
from tests.support.samples import slow

#: Numbers without noise.
EXACT = 1e-9
#: Guesses of what is sought, as parts of the truth.
GUESSES = (0.25, 0.999, 20.0)
#: What is sought of a payload whose centre is known.
MASS_ONLY, WITH_INERTIA = ["m of payload*"], ["m of payload*", "I* of payload*"]
TOOL = {"five_bar": "m1_tool", "rps3": "m1_platform", "delta": "m1_platform"}
#: A payload with inertia beside the link's origin.
MASS, CENTRE, INERTIA = 0.4, (0.05, -0.03, 0.08), ((3e-3, 4e-4, 0.0), (4e-4, 2e-3, 1e-4), (0.0, 1e-4, 4e-3))


def payload(name: str, mass: float, turning: float) -> Payload:
    """Return a payload of a shipped robot."""
    inertia = tuple(tuple(turning * x for x in row) for row in INERTIA)
    return Payload(TOOL[name], mass, CENTRE, inertia)


def log_of(name: str, robot: hybridyn.HybridRobot) -> dict[str, Any]:
    """Return the log of a robot that moves as a shipped one."""
    time, (q, v, a) = flight(name, -1)
    tau, log = hybridyn.idm(robot, q, v, a, effects="model"), {"time": time}
    for i, motor in enumerate(robot.motors):
        log |= {f"{motor}/position": joint_position(robot, q, motor), f"{motor}/effort": tau[:, i]}
        log[f"{motor}/velocity"], log[f"{motor}/acceleration"] = (x[:, robot.motor_v[i]] for x in (v, a))
    return log


@lru_cache(maxsize=2)
def recorded(name: str, whole: bool) -> dict[str, Any]:
    """Return the log of a robot with a payload, whose inertia is 1.5 times that of the guess if `whole`."""
    own = payload(name, MASS, 1.5 if whole else 1.0)
    return log_of(name, hybridyn.with_effects(hybridyn.load(name), ["model", own]))


@pytest.mark.parametrize("guess", GUESSES)
@pytest.mark.parametrize(
    ("name", "only"),
    [
        ("five_bar", MASS_ONLY),
        ("five_bar", WITH_INERTIA),
        slow("rps3", MASS_ONLY),
        slow("rps3", WITH_INERTIA),
        slow("delta", MASS_ONLY),
    ],
)
def test_a_payload_is_found_whatever_was_guessed(name: str, only: list[str], guess: float) -> None:
    """Its mass is found, with the centre and (or not) the inertia about it held."""
    whole = len(only) > 1
    robot = hybridyn.with_effects(hybridyn.load(name), ["model", payload(name, guess * MASS, 1.0)])
    found = hybridyn.identify(robot, recorded(name, whole), only=only)
    assert abs(found.values[0] - MASS) <= EXACT * MASS
    load = found.identified.payloads[0]
    assert abs(load.mass - MASS) <= 1e-6 * MASS  # rounding of the conic program
    np.testing.assert_allclose(load.com, CENTRE, atol=1e-9)
    assert found.fit.relative.max() <= EXACT


@pytest.mark.parametrize("guess", GUESSES)
@pytest.mark.parametrize("name", ["five_bar", slow("rps3"), slow("delta"), slow("gough_stewart")])
def test_a_body_is_found_whatever_was_guessed(name: str, guess: float) -> None:
    """The mass of a link, which the file has wrong; the robot keeps its centre and the inertia about it."""
    own = hybridyn.load(name)
    links = {link.name: link for link in own.description.links}
    log = log_of(name, own)
    for number in [*standard_parameters(own).bodies][-2:]:
        body = own.bodies.bodies[number]
        link = links[body.name]
        robot = own.with_parameters({f"mass:{link.name}": guess * link.mass})
        if (
            robot.bodies.bodies[number].name != link.name
        ):  # another link of the body is heavier than the guess
            continue
        found = hybridyn.identify(robot, log, only=[f"m of {link.name}"])
        assert abs(found.values[0] - body.mass) <= EXACT * body.mass
        new = {link.name: link for link in found.identified.description.links}[link.name]
        assert abs(new.mass - link.mass) <= 1e-6 * link.mass
        np.testing.assert_allclose(new.com, link.com, atol=1e-6)
        np.testing.assert_allclose(new.inertia, link.inertia, atol=1e-6 * np.abs(link.inertia).max())


@pytest.mark.parametrize("name", ["five_bar", "rps3"])
def test_a_payload_of_which_nothing_is_known_but_its_place_is_found(name: str) -> None:
    """The guess of its mass is zero."""
    robot = hybridyn.with_effects(hybridyn.load(name), ["model", payload(name, 0.0, 0.0)])
    point = Payload(TOOL[name], MASS, CENTRE)
    log = log_of(name, hybridyn.with_effects(hybridyn.load(name), ["model", point]))
    found = hybridyn.identify(robot, log, only=MASS_ONLY)
    assert abs(found.values[0] - MASS) <= EXACT * MASS
    load = found.identified.payloads[0]
    np.testing.assert_allclose((load.mass, *load.com), (MASS, *CENTRE), rtol=1e-9)
    np.testing.assert_allclose(load.inertia, np.zeros((3, 3)), atol=1e-15)


@pytest.mark.parametrize("name", ["five_bar", "rps3"])
def test_numbers_that_are_held_keep_what_the_file_states(name: str) -> None:
    """For any choice: with the file's numbers of what is sought, all numbers are the file's."""
    robot = hybridyn.with_effects(hybridyn.load(name), ["model", payload(name, MASS, 1.0)])
    base, rng = base_parameters(robot, effects="model"), np.random.default_rng(1)
    names, values = np.array(base.standard.names), base.standard.values
    for _ in range(10):
        some = names[rng.random(len(names)) < 0.5].tolist()
        sought = linear_model(base, known=some)
        assert sought.held.sum() == len(some)
        np.testing.assert_allclose(sought.moved(values[:, None])[:, 0] + sought.constant, values, rtol=1e-12)
        of_all = base.combination @ sought.moved(np.eye(len(names)))
        assert not of_all[:, sought.held].any()
        want = of_all @ values
        got = of_all[:, sought.model.columns] @ (sought.model.combination @ values)
        np.testing.assert_allclose(got, want, atol=1e-9 * np.abs(want).max())
