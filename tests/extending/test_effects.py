"""Laws of other packages: by object and by name, in every engine, from files, and what is refused."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import hybridyn
from hybridyn import effects as fx
from hybridyn.compiled.programs.sources import robot_key
from hybridyn.conversion.from_home import counted_from_home
from hybridyn.conversion.request import Losses
from hybridyn.description.effect_names import ON_JOINTS, ON_LINKS
from hybridyn.description.side_cars.tables import EFFECTS
from hybridyn.dynamics.link_motion import link_motions
from hybridyn.effects.catalogue import names
from hybridyn.effects.choice import choose
from hybridyn.errors import ModelError
from hybridyn.scenes import scene_file as scenes
from hybridyn.scenes.stage import stage
from tests.extending.packages import files, forget, install
from tests.robots.effect_cases import rate_of
from tests.support.command_line import call
from tests.support.comparing import close_to, refused
from tests.support.engines import engine_of
from tests.support.extras import needs
from tests.support.files import save

SUMS = 1e-11  # sums of parts that are larger than the whole
THERE_AND_BACK = 1e-9  # ddm(idm(a)) = a loses the condition of A_t
DRIFT = 1e-6  # of the solver, by its rtol of 1e-8
BALANCE = 1e-9  # of the largest power: rounding of a difference over 1e-3 s


@cache
def states() -> tuple[np.ndarray, ...]:
    """Return five states of the robot."""
    robot, rng = hybridyn.load("five_bar"), np.random.default_rng(0)
    return hybridyn.assemble(
        robot, motors={motor: tuple(rng.uniform(-0.3, 0.3, (3, 5))) for motor in robot.motors}
    )


def five_bar() -> tuple[hybridyn.HybridRobot, tuple[np.ndarray, ...]]:
    """Return a robot, and five states of it."""
    return hybridyn.load("five_bar"), states()


def both(robot: hybridyn.HybridRobot) -> tuple[Any, Any]:
    """Return the laws of the page."""
    from workshop.effects import Drag, Magnet

    return Magnet(dict.fromkeys(robot.motors, 3.0)), Drag({robot.bodies.bodies[-1].name: 5.0})


@pytest.mark.parametrize("engine", ["general", "written", "compiled"])
def test_every_engine_computes_objects(engine: str, workshop: Path) -> None:
    """The magnets hold by their formula, and the motors give what the drag takes, c |v|^3."""
    robot, (q, v, a) = five_bar()
    magnet, drag = both(robot)
    used = engine_of(engine, robot, ["default", magnet, drag])
    x, link = q[:, robot.motor_q], drag.links[0]
    held = 3.0 * x * np.exp(-((x / 0.5) ** 2))
    taken = 5.0 * np.linalg.norm(link_motions(robot, q, v, [link])[link].p_dot, axis=1) ** 3
    tau = used.idm(q, v, a)
    added = tau - hybridyn.idm(robot, q, v, a) - held
    close_to(np.sum(added * v[:, robot.motor_v], axis=1), taken, SUMS)
    close_to(used.ddm(q, v, tau), a, THERE_AND_BACK)


def test_warp_computes_objects(workshop: Path) -> None:
    needs("gpu")
    robot, (q, v, a) = five_bar()
    effects = ["default", *both(robot)]
    found, _ = hybridyn.warp(robot, effects, device="cpu").idm(q, v, a)
    close_to(found, hybridyn.idm(robot, q, v, a, effects=effects), SUMS)


def test_energy_is_that_of_the_laws(workshop: Path) -> None:
    robot, (q, v, a) = five_bar()
    acting = {"effects": ["default", *both(robot)]}
    supplied = hybridyn.power(robot, q, v, hybridyn.idm(robot, q, v, a, **acting), **acting)
    gained = rate_of(robot, lambda q, v: hybridyn.energy(robot, q, v, **acting).total, q, v, a)
    assert supplied.lost.min() > 0
    close_to(supplied.motors - supplied.lost, gained, BALANCE, np.abs(supplied.motors).max())


@pytest.mark.parametrize("engine", ["general", "compiled"])
def test_simulations_follow_them(engine: str, workshop: Path) -> None:
    """The magnets alone: the energy stays."""
    robot, (q, v, _) = five_bar()
    effects = ["default", both(robot)[0]]
    compiled = hybridyn.compile(robot, effects) if engine == "compiled" else None
    run = hybridyn.simulate(robot, q[0], v[0], [0.0, 0.1], effects=effects, compiled=compiled)
    energy = hybridyn.energy(robot, run.q, run.v, effects=effects)
    assert np.ptp(energy.kinetic) > 1e-3
    close_to(energy.total, np.full_like(energy.total, energy.total[0]), DRIFT, np.ptp(energy.kinetic))


def test_identification_finds_their_numbers(workshop: Path) -> None:
    robot, (q, v, a) = five_bar()
    magnet, drag = both(robot)
    found = hybridyn.regressor(robot, q, v, a, effects=["default", magnet])
    assert [name for name in found.names if "magnet" in name] == [f"k_magnet of {m}" for m in robot.motors]
    tau = hybridyn.idm(robot, q, v, a, effects=["default", magnet])
    close_to(found.Y @ found.values, tau, SUMS)
    refused(lambda: hybridyn.regressor(robot, q, v, a, effects=[drag]), ModelError, "has no number")


def test_a_changed_law_is_compiled_anew(
    workshop: Path, interpreted: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its numbers stay: the library that was kept, by another key, is that of another law."""
    robot, (q, v, a) = five_bar()
    magnet, _ = both(robot)
    before = hybridyn.compile(robot, ["default", magnet], wait=False).idm(q, v, a)
    key = robot_key(robot, choose(robot, ["default", magnet]))
    monkeypatch.setattr(type(magnet), "effort", lambda self, p, x, v: -p[0] * x)
    assert robot_key(robot, choose(robot, ["default", magnet])) != key
    after = hybridyn.compile(robot, ["default", magnet], wait=False).idm(q, v, a)
    close_to(after, hybridyn.idm(robot, q, v, a, effects=["default", magnet]), SUMS)
    assert np.abs(after - before).max() > 1e-3


# -------------------------------------------------------------------- by name, from files


def stated(folder: Path, more: str = "") -> Path:
    """Write the shipped five-bar with the numbers of the page beside it."""
    hybridyn.convert("five_bar", folder / "five_bar.urdf")
    save(folder, more or files()["five_bar.model.toml"].text, "five_bar.urdf.model.toml")
    return folder / "five_bar.urdf"


def test_numbers_come_from_files(workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from workshop.effects import Magnet

    robot = hybridyn.load(stated(tmp_path))
    _, (q, v, a) = five_bar()
    object_ = Magnet(dict.fromkeys(robot.motors, 3.0), 0.4)
    want = hybridyn.idm(robot, q, v, a, effects=["default", object_])
    np.testing.assert_array_equal(hybridyn.idm(robot, q, v, a, effects=["default", "magnet"]), want)
    assert choose(robot, "model").names[-1] == "magnet"
    hybridyn.convert(robot, tmp_path / "moved.urdf")
    again = hybridyn.load(tmp_path / "moved.urdf")
    close_to(hybridyn.idm(again, q, v, a, effects=["default", "magnet"]), want, SUMS)
    call(capsys, "idm", tmp_path / "moved.urdf", "--effects", "default,magnt", status=2)


def test_scenes_state_numbers(workshop: Path, tmp_path: Path) -> None:
    scene = save(tmp_path, """
        duration = 0.01
        robot.file = "five_bar"
        [effects.magnet]
        strength = { m1_left_drive = 3 }
        """, "scene.toml")  # fmt: skip
    assert stage(scenes.read_scene(scene)).effects.joints[-1].effect.strength == {"m1_left_drive": 3.0}
    text = scene.read_text().replace("m1_left_drive", "m1_lft_drive")
    refused(lambda: stage(scenes.read_scene(save(tmp_path, text, "s.toml"))), ModelError, "s.toml:5.*did you")


@pytest.mark.parametrize(("effect", "key", "lost"), [("drag", "coefficient", 0), ("magnet", "strength", 1)])
def test_only_laws_of_joints_lose_their_zero(effect: str, key: str, lost: int, workshop: Path) -> None:
    """A link may have the name of a joint."""
    own, joint = hybridyn.load("five_bar").description, "m1_left_drive"
    d = replace(own, home={joint: (0.3,)}, effects=((effect, {key: {joint: 1.0}}),))
    counted_from_home(d, losses := Losses())
    assert sum("another zero" in line for line in losses.lines()) == lost


FILES = {
    "unknown key": ("strenth = {}", "model.toml:2: 'effects.magnet.strenth': unknown key"),
    "wrong type": (
        "reach = 'far'",
        "model.toml:2: 'effects.magnet.reach': should be a valid number",
    ),
    "unknown joint": ("strength = { m1 = 1 }", r"model.toml:2: \[effects.magnet\].*no such movable"),
    "negative": ("strength = { m1_left_drive = -1 }", "magnet: joint 'm1_left_drive' has"),
}


@pytest.mark.parametrize("name", FILES)
def test_wrong_numbers_in_files_are_refused(name: str, workshop: Path, tmp_path: Path) -> None:
    line, words = FILES[name]
    path = stated(tmp_path, f"[effects.magnet]\n{line}\n")
    refused(lambda: choose(hybridyn.load(path), "model"), ModelError, words)


def test_files_need_the_package(packages: Path, tmp_path: Path) -> None:
    refused(lambda: hybridyn.load(stated(tmp_path)), ModelError, "'effects.magnet': unknown key 'magnet'")


def test_every_effect_of_files_is_known_by_what_it_acts_on() -> None:
    assert {*ON_JOINTS, *ON_LINKS} == {*EFFECTS, *scenes.EFFECTS} - {"base_motion"}


# -------------------------------------------------------------------- mistakes

LAW = """
from dataclasses import dataclass, field
import numpy as np
from hybridyn.effects import JointEffect, LinkEffect
@dataclass(frozen=True)
class Odd(JointEffect):
    k: dict[str, float] = field(default_factory=lambda: {"m1_left_drive": 2.0})
    name = "odd"
    by_joint = ("k",)
    def effort(self, p, x, v): return EFFORT
@dataclass(frozen=True)
class Push(LinkEffect):
    name = "odd"
    links = ("m1_left_upper",)
    def wrench_on(self, link, motions): return [1.0, 2.0], [0.0, 0.0, 0.0]
class NoLinks(LinkEffect):
    name = "odd"
    def wrench_on(self, link, motions): return [0.0] * 3, [0.0] * 3
class Lawless(JointEffect):
    name, by_joint = "odd", ("k",)
class Nameless(JointEffect):
    def effort(self, p, x, v): return v
class Named(Lawless):
    name = "even"
"""
#: Text after "odd = odd", text of the law's effort, and words of the error.
POINTS = {
    "absent": ("ity:Odd", "v", "effect 'odd' of the package 'odd-laws' cannot be imported.*No module"),
    "no class": (":LAW", "v", "cannot be imported from 'odd:LAW': AttributeError"),
    "no subclass": (":np", "v", "which is no subclass of JointEffect or LinkEffect"),
    "raises on import": (":Odd", "\n1/0", "cannot be imported from 'odd:Odd': ZeroDivisionError"),
    "no law": (":Lawless", "v", "the effect 'odd' of the package 'odd' has no law"),
    "no name": (":Nameless", "v", "whose name is None"),
    "other name": (":Named", "v", "whose name is 'even'"),
    "no links": (":NoLinks", "v", "acts on no link"),
    "shape": (":Odd", "v[0]", r"an effort of shape \(1,\) for positions of shape \(1, 1\)"),
    "not finite": (":Odd", "-p[0] / x", "not finite at home"),
    "fails": (":Odd", "self.c * v", "fails: AttributeError"),
    "jumps": (":Odd", "-p[0] * np.sign(v)", "jumps at rest, from -2 to 2|jumps at rest"),
    "symbols": (":Odd", "-v if (v < 2).all() else v", "does not run on symbols"),
    "wrong force": (":Push", "v", "returns no force and moment of three"),
}


@pytest.mark.parametrize("name", POINTS)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_a_law_that_cannot_be_used_is_one_sentence(name: str, packages: Path) -> None:
    module, effort, words = POINTS[name]
    text = {"odd.py": LAW.replace("EFFORT", effort)}
    install(packages, "odd-laws", {"effects": {"odd": f"odd{module}"}}, text)
    robot, (q, v, a) = five_bar()

    def all_engines() -> None:
        hybridyn.idm(robot, q, v, a, effects=["default", "odd"])
        hybridyn.compile(robot, ["default", "odd"])

    error = refused(all_engines, ModelError, words)
    assert "\n" not in str(error)


def test_names_belong_to_one_package(packages: Path) -> None:
    robot, _ = five_bar()
    install(packages, "odd-one", {"effects": {"odd": "odd:Odd"}}, {"odd.py": LAW.replace("EFFORT", "-v")})
    assert choose(robot, ["default", "odd"]).names[-1] == "odd"
    install(packages, "odd-two", {"effects": {"odd": "other:Odd"}}, {})
    forget()
    both_add = "packages 'odd-one' and 'odd-two' both add the effect 'odd': remove one of them"
    refused(names, ModelError, both_add)
    install(packages, "odd-two", {"effects": {"spring": "odd:Odd"}}, {})
    forget()
    refused(names, ModelError, "the effect 'spring' of the package 'odd-two' has a name of hybridyn's own")


@dataclass(frozen=True)
class Bent(fx.JointEffect):
    """A law that says of one of its numbers what is not so."""

    k: dict[str, float] = field(default_factory=lambda: {"m1_left_drive": 2.0})
    name: ClassVar[str] = "bent"
    by_joint = ("k",)
    symbols = ("k_bent",)

    def effort(self, p: Any, x: Any, v: Any) -> Any:
        """Return what is quadratic in k."""
        return -(p[0] ** 2) * x


class Taken(fx.Spring):
    """A law of its own under the name of another."""


OBJECTS: dict[str, tuple[Callable[[], Any], str]] = {
    "not linear": (Bent, "is not linear in k_bent"),
    "the name of another": (lambda: Taken({"m1_left_drive": 1.0}), "has the name of an effect of hybridyn's"),
}


@pytest.mark.parametrize("name", OBJECTS)
def test_an_object_that_cannot_be_used_is_one_sentence(name: str) -> None:
    make, words = OBJECTS[name]
    refused(lambda: choose(hybridyn.load("five_bar"), ["default", make()]), ModelError, words)
