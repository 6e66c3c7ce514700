"""A run that found numbers never ends without them, whatever the noise and whatever the file leaves out."""

import builtins
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import StribeckFriction
from hybridyn.errors import ModelError
from hybridyn.identification.parameters import standard_parameters
from hybridyn.identification.possible import pseudo_inertia
from hybridyn.identification.robot_with import with_parameters
from hybridyn.identification.signals import fourier
from hybridyn.structure.robot import joint_position
from tests import ROOT
from tests.identification.robots import PERIOD, SAMPLES, flight
from tests.robots.shipped import ROBOTS
from tests.support.extras import needs
from tests.support.samples import fuzz, slow
from tests.support.snippets import blocks

#: Seeds of the noise, its part of the efforts, and the band that holds the motions' harmonics [Hz].
SEEDS, NOISE, BAND = 20, 0.02, 1.3
#: Robots of which a run takes no second.
QUICK = ("tutorial", "five_bar")
#: Robots of hundreds of parameters, of which a run takes minutes.
LARGE = ("lx4", "snake")


@lru_cache(maxsize=2)
def moved(name: str, bare: bool) -> tuple[hybridyn.HybridRobot, dict[str, Any], np.ndarray]:
    """Return a robot, if `bare` without friction and rotors, its motors' times and positions, and efforts."""
    if name == "tutorial":
        own, end = (one.text for one in blocks(ROOT / "docs" / "tutorial.md", "xml")[:2])
        with TemporaryDirectory() as folder:
            file = Path(folder, "five.urdf")
            file.write_text(own.replace("</robot>", f"{end}</robot>"))
            robot = hybridyn.load(file)
        time = np.arange(SAMPLES) / SAMPLES * PERIOD
        cosine, sine = np.random.default_rng(0).normal(size=(2, 5, 2)) * 0.1 / np.arange(1, 6)[:, None]
        q, v, a = hybridyn.assemble(robot, motors=fourier(-cosine.sum(axis=0), cosine, sine, PERIOD, time))
    else:
        robot, (time, (q, v, a)) = hybridyn.load(name), flight(name, -1)
    if bare:
        standard = standard_parameters(robot, effects="model")
        values = standard.values.copy()
        for term in standard.terms:
            values[term.columns] = 0.0
        robot = with_parameters(robot, values, effects="model")
    log = {"time": time} | {f"{motor}/position": joint_position(robot, q, motor) for motor in robot.motors}
    return robot, log, hybridyn.idm(robot, q, v, a, effects="model")


def found_from(
    name: str, bare: bool, seed: int, noise: float = NOISE, **words: Any
) -> hybridyn.Identification:
    """Identify a robot from efforts with noise."""
    robot, log, tau = moved(name, bare)
    tau = tau + noise * tau.std(axis=0) * np.random.default_rng(seed).normal(size=tau.shape)
    log = log | {f"{motor}/effort": own for motor, own in zip(robot.motors, tau.T, strict=True)}
    return hybridyn.identify(robot, log, period=PERIOD, band=BAND, **words)


def judge(found: hybridyn.Identification) -> None:
    """Check that the robot can exist and is near the estimate, and that nothing went wrong on the way."""
    standard = standard_parameters(found.identified, effects="model")
    for term in standard.terms:
        assert (standard.values[term.columns] >= 0).all()
    for at in standard.tens:
        assert np.linalg.eigvalsh(pseudo_inertia(standard.values[at]))[0] > 0
    off = np.abs(found.of_robot - found.values) / found.deviation
    assert off.max() < 5  # few deviations: the truth itself is possible
    assert not any("conic program" in remark for remark in found.remarks)
    assert "## The robot with these parameters\n\n" in found.report()


@pytest.mark.parametrize(
    ("name", "bare", "seed"),
    [
        *((name, bare, seed) for name in QUICK for bare in (False, True) for seed in range(2)),
        *(
            (fuzz if name in LARGE and seed > 1 else slow)(name, bare, seed)
            for name in ("tutorial", *ROBOTS)
            for bare in (False, True)
            for seed in range(SEEDS)
            if name not in QUICK or seed > 1
        ),
    ],
)
def test_estimates_on_a_bound_are_those_of_a_robot(name: str, bare: bool, seed: int) -> None:
    """Half of all estimates of a friction that is none are negative; the robot has none, or little."""
    needs("identify")
    judge(found_from(name, bare, seed))


@pytest.mark.parametrize("name", ["tutorial", *(name if name in QUICK else slow(name) for name in ROBOTS)])
@pytest.mark.parametrize("bare", [False, True])
def test_rounding_of_estimates_is_no_error(name: str, bare: bool) -> None:
    """Without noise, a friction that is none is found to be 1e-17, of either sign."""
    found = found_from(name, bare, 0, noise=0.0)
    assert np.abs(found.values - found.of_file).max() <= 1e-9 * np.abs(found.of_file).max()
    assert np.abs(found.of_robot - found.values).max() <= 1e-9 * np.abs(found.values).max()
    assert found.identified.motors == found.robot.motors


def test_without_clarabel_the_robot_lies_on_the_line_from_the_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """The estimates stand, the robot can exist, and a remark says what would make it better."""
    whole, imported = found_from("five_bar", True, 1), builtins.__import__

    def without(name: str, *words: Any) -> Any:
        """Import all but clarabel."""
        if name == "clarabel":
            raise ImportError(name)
        return imported(name, *words)

    monkeypatch.setattr(builtins, "__import__", without)
    found = found_from("five_bar", True, 1)
    np.testing.assert_array_equal(found.values, whole.values)
    assert found.constrained
    assert any("needs clarabel" in remark for remark in found.remarks)
    for at in standard_parameters(found.identified, effects="model").tens:
        ten = standard_parameters(found.identified, effects="model").values[at]
        assert np.linalg.eigvalsh(pseudo_inertia(ten))[0] > 0


def test_numbers_without_a_robot_are_reported() -> None:
    """A URDF has no place for Stribeck's friction: the estimate stands, and the robot says why it is none."""
    robot, log, tau = moved("five_bar", False)
    log = log | {f"{motor}/effort": own for motor, own in zip(robot.motors, tau.T, strict=True)}
    friction = StribeckFriction(
        level=dict.fromkeys(robot.motors, 0.1), static=dict.fromkeys(robot.motors, 0.15),
        speed=dict.fromkeys(robot.motors, 0.1),
    )  # fmt: skip
    found = hybridyn.identify(robot, log, effects=["default", friction], period=PERIOD, band=BAND)
    assert len(found.values) == len(found.names)
    assert any("there is no robot with these numbers" in remark for remark in found.remarks)
    assert "no place for" in found.report()
    with pytest.raises(ModelError, match="no place for"):
        _ = found.identified
