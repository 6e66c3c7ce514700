"""Measures, parameters, controllers and engines of other packages, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import ModelError
from hybridyn.scenes.scene_file import read_scene
from hybridyn.scenes.stage import play, stage
from hybridyn.studies.compare.compare import compare
from hybridyn.studies.compare.methods import methods_of
from hybridyn.studies.sweep.evaluation import Designer
from hybridyn.studies.sweep.measures import unit_of
from hybridyn.studies.sweep.reading import identity, read_study
from hybridyn.tables.opening import read_columns
from tests import ROOT
from tests.extending.packages import files, install
from tests.robots.robot_texts import TREE
from tests.support.comparing import close_to, refused
from tests.support.files import save

SUMS = 1e-11  # sums of parts that are larger than the whole


def study(folder: Path) -> Path:
    """Write the study of the page, and a trajectory of seven rows."""
    rows = (ROOT / "models" / "five_bar" / "traj.csv").read_text().splitlines()
    save(folder, "\n".join([*rows[:8], ""]), "swing.csv")
    return save(folder, files()["study.toml"].text, "study.toml")


def test_a_study_varies_and_measures(workshop: Path, tmp_path: Path) -> None:
    """The heat of the heavier robot's efforts, as they are linear in its mass and inertia."""
    source = read_study(study(tmp_path))
    designer, robot = Designer(source), hybridyn.load("five_bar")
    rows = [designer(i, np.array([factor])) for i, factor in enumerate((1.0, 2.0))]
    assert [row.message for row in rows] == ["", ""]
    table = hybridyn.load("five_bar").motors
    time, *columns = read_columns(
        str(tmp_path / "swing.csv"),
        ["time", *(f"{m}/{x}" for m in table for x in ("position", "velocity", "acceleration"))],
    ).T
    motors = {m: tuple(columns[3 * i : 3 * i + 3]) for i, m in enumerate(table)}
    q, v, a = hybridyn.assemble(robot, motors=motors)
    light, bare = (
        hybridyn.idm(robot.with_parameters({"bulk:m1_left_lower": x}), q, v, a, effects="model")
        for x in (1.0, 1e-9)
    )
    for row, tau in zip(rows, (light, 2 * light - bare), strict=True):
        square = tau**2
        heat = np.max(np.diff(time) @ (square[1:] + square[:-1]) / 2)
        close_to(np.array(row.measures), np.array([heat, np.abs(tau).max()]), 1e-7)  # a mass of 1e-9
    assert unit_of("heat", robot.description) == "N2 m2 s"
    assert identity(source, np.array([1.0]))["measure heat"] == "workshop 1.0"


def test_statistics_import_no_package(packages: Path, tmp_path: Path) -> None:
    """A package that cannot be imported harms no study that does not name it."""
    install(packages, "odd", {"measures": {"odd": "odd:ODD"}}, {"odd.py": "1 / 0"})
    path, column = study(tmp_path), "peak m1_left_drive/effort"
    text = path.read_text().replace('["heat", "peak_effort"]', f"{{ most = '{column}' }}")
    text = text.replace("bulk:m1", "mass:m1")
    row = Designer(read_study(save(tmp_path, text, "one.toml")))(0, np.array([0.3]))
    assert row.message == ""
    assert row.measures[0] > 0
    text = text.replace(column, "pek_effort")
    refused(lambda: read_study(save(tmp_path, text, "two.toml")), ModelError, "'odd'.*cannot be imported")


def test_compiled_models_take_the_parameter(workshop: Path, interpreted: None) -> None:
    robot = hybridyn.load("five_bar")
    q, zero = robot.home[None], np.zeros((1, robot.nv))
    model = hybridyn.compile(robot, parameters=["bulk:m1_left_lower"], wait=False)
    heavier = robot.with_parameters({"bulk:m1_left_lower": 1.5})
    found = model.idm(q, zero, zero, parameters=np.array([[1.5]]))
    close_to(found, hybridyn.idm(heavier, q, zero, zero), SUMS)


def test_a_scene_has_the_controller(workshop: Path, tmp_path: Path) -> None:
    """The energy that the springs hold and the robot's stays."""
    short = files()["centring.toml"].text.replace("duration = 0.5", "duration = 0.05")
    ready = stage(read_scene(save(tmp_path, short, "scene.toml")))
    run = play(ready)
    whole = hybridyn.energy(ready.robot, run.q, run.v).total
    held = 2.0 * (run.q[:, ready.robot.motor_q] ** 2).sum(axis=1)
    assert np.ptp(held) > 0.01
    np.testing.assert_allclose(whole + held, whole[0] + held[0], atol=1e-6 * np.ptp(held))


SCENES = {
    "unknown key": ("stiffness = 4.0", "stifness = 4.0", "scene.toml:.*'controller.stifness': unknown key"),
    "wrong type": ("stiffness = 4.0", "stiffness = 'x'", "'controller.stiffness': should be a valid number"),
    "missing key": ("stiffness = 4.0", "", "'stiffness' is missing"),
    "unknown kind": ('"centring"', '"centering"', r"must be one of .*'centring'.*did you mean 'centring'"),
}


@pytest.mark.parametrize("name", SCENES)
def test_wrong_keys_of_a_controller_are_refused(name: str, workshop: Path, tmp_path: Path) -> None:
    old, new, words = SCENES[name]
    text = files()["centring.toml"].text.replace(old, new)
    refused(lambda: stage(read_scene(save(tmp_path, text, "scene.toml"))), ModelError, words)


def test_an_engine_is_compared(workshop: Path, tmp_path: Path) -> None:
    """A tree: the textbook's accelerations are right; the robot with loops, it refuses."""
    tree = hybridyn.load(save(tmp_path, f"<robot name='r'>{TREE}</robot>"))
    ours, theirs = compare(tree, ["textbook"], samples=2).verdicts
    assert (theirs.engine, theirs.version, theirs.refusal) == ("textbook", "1.0", "")
    assert theirs.agrees(ours.freedoms, 1e-9)
    assert compare(hybridyn.load("five_bar"), ["textbook"], samples=1).verdicts[1].refusal
    (method,) = methods_of("textbook", "ddm")
    solve = method.prepare(tree)({})
    q, v, tau = tree.home, np.full(tree.nv, 0.3), np.full(tree.nv, 0.2)
    every = np.zeros(tree.nv)
    every[tree.motor_v] = tau[: len(tree.motors)]
    close_to(solve(q, v, every), hybridyn.ddm(tree, q, v, every[tree.motor_v]), SUMS)


ODD = """
def name(*given): return RESULT
def kinded(robot, kind: float): return RESULT
"""
MISTAKES = {
    "measure": ("measures", "odd:ODD", "0", "measure 'odd' of the package 'odd' is .*make it a"),
    "parameter fails": (
        "parameters",
        "odd:name",
        "1 / 0",
        "parameter 'odd'.*fails: ZeroDivisionError",
    ),
    "no parameter": ("parameters", "odd:name", "3", "fails: TypeError: int is no Entry"),
    "no controller": (
        "controllers",
        "odd:ODD",
        "0",
        "controller 'odd' of the package.*no function",
    ),
    "controller's key": ("controllers", "odd:kinded", "0", "has an argument 'kind'.*rename the argument"),
    "controller fails": ("controllers", "odd:name", "1 / 0", "fails: ZeroDivisionError"),
    "no law": ("controllers", "odd:name", "3", "must return a function of"),
    "engine": ("engines", "odd", "0", "engine 'odd' of the package 'odd' has no ways and no METHODS"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_what_cannot_be_used_is_one_sentence(name: str, packages: Path, tmp_path: Path) -> None:
    kind, value, result, words = MISTAKES[name]
    text = f"ODD = 3\n{ODD.replace('RESULT', result)}"
    install(packages, "odd", {kind: {"odd": value}}, {"odd.py": text})
    scene = "duration = 1\nrobot.file = 'five_bar'\n[controller]\nkind = 'odd'\n"
    robot = hybridyn.load("five_bar")
    ask = {
        "measures": lambda: unit_of("odd", robot.description),
        "parameters": lambda: robot.with_parameters({"odd:m1_left_lower": 1.0}),
        "controllers": lambda: stage(read_scene(save(tmp_path, scene, "scene.toml"))),
        "engines": lambda: compare(robot, ["odd"]),
    }[kind]
    assert "\n" not in str(refused(ask, ModelError, words))
