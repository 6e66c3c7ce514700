"""Scene files: what they say, and one line with file, line and key for each way of being wrong."""

# ruff: noqa: E501

import re
from pathlib import Path

import pytest

from hybridyn.description.side_cars.toml_file import line_of
from hybridyn.errors import HybridynError, ModelError
from hybridyn.scenes.scene_file import read_scene
from hybridyn.scenes.stage import stage
from tests import ROOT
from tests.comparing import refused
from tests.files import save

HEAD = f'duration = 1.0\n[robot]\nfile = "{ROOT}/urdf/five_bar.urdf.xacro"\n'
PD = '[controller]\nkind = "pd"\nkp = 1.0\nkd = 1.0\n'
REFERENCE = "[controller.reference]\n"


def written(folder: Path, text: str) -> Path:
    return save(folder, HEAD + text, "scene.toml")


def refusal(folder: Path, text: str, words: str, **place: object) -> ModelError:
    return refused(lambda: stage(written(folder, text)), HybridynError, re.escape(words), **place)


def test_a_scene_is_read_with_its_defaults(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, "")).scene
    assert (scene.duration, scene.robot.base, scene.effects.use) == (1.0, None, "default")
    assert scene.controller is None
    assert (scene.solver.method, scene.solver.projection) == ("dopri5", "stages")


@pytest.mark.parametrize(
    ("text", "line", "key", "words"),
    [
        ('[solver]\nmetod = "rk4"\n', 5, "solver.metod", "did you mean 'method'"),
        ('[controler]\nkind = "pd"\n', 4, "controler", "did you mean 'controller'"),
        ('[solver]\nmethod = "rk5"\n', 5, "solver.method", "'rk4'"),
        ('[solver]\nmethod = "rk4"\n', 4, "solver", "give step"),
        ("[solver]\nbaumgarte = 5.0\n", 4, "solver", "projection"),
        ('[controller]\nkind = "pdd"\n', 5, "controller.kind", "did you mean 'pd'"),
        ("[controller]\nkp = 1.0\n", 4, "controller.kind", "must be one of"),
        ('[controller]\nkind = "pd"\nkp = 1.0\n[controller.reference]\ntable = "x"\n', 4, "controller.kd", "missing"),
        (PD + "kpp = 1\n" + REFERENCE + 'table = "x"\n', 8, "controller.kpp", "did you mean 'kp'"),
        (PD + REFERENCE, 8, "controller.reference", "give one of table, points"),
        ('[controller]\nkind = "pd"\nkp = { a = -1.0 }\nkd = 1\n', 6, "controller.kp.a", "greater than or equal"),
        ("[effects.damper]\ncoefficient = { m1_left_drive = -1 }\n", 5, "effects.damper.coefficient.m1_left_drive",
         "greater than or equal"),
        ('[[effects.payload]]\nlink = "m1_tool"\nmass = 1\n[[effects.payload]]\nlink = "m1_tool"\nmass = -1\n', 9,
         "effects.payload.1.mass", "greater than or equal"),
        ('[[events]]\njoint = "a"\nat = 1\n[[events]]\njoint = "a"\naat = 1\n', 9, "events.1.aat", "did you mean 'at'"),
        ("[initial]\nplatforms = { m1_tool = { xx = 1 } }\n", 5, "initial.platforms.m1_tool.xx", "'yaw'"),
        ("[output]\nrate = 1\ntimes = [1, 2]\n", 4, "output", "not both"),
        ("[output]\ntimes = [1, 0.5]\n", 4, "output", "grow"),
        ('[motion]\ntable = "x"\n' + PD + REFERENCE + 'table = "x"\n', None, "", "not both"),
    ],
)  # fmt: skip
def test_what_the_tables_refuse(tmp_path: Path, text: str, line: int | None, key: str, words: str) -> None:
    error = refusal(tmp_path, text, words, line=line, element=key or "")
    assert str(error).startswith(f"{tmp_path}/scene.toml:" + (f"{line}: '{key}'" if line else ""))


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("[initial]\njoints = { m1_left_driv = 0.1 }\n", 5, "did you mean 'm1_left_drive'"),
        ('[effects]\nuse = ["default", "damping"]\n', 5, "no effect 'damping'"),
        ('[effects]\nuse = "spring"\n', 5, "no numbers"),
        ("[effects.spring]\nstiffness = { m1_left_drve = 1.0 }\n", 5, "did you mean 'm1_left_drive'"),
        ('[[effects.payload]]\nlink = "m1_tol"\nmass = 1.0\n', 5, "did you mean 'm1_tool'"),
        ('[[effects.wrench]]\nlink = "m1_tol"\nwrench = [0, 0, 0, 0, 0, 0]\n', 5, "did you mean 'm1_tool'"),
        ('[[events]]\njoint = "m1_left_driv"\nat = 0.0\n', 5, "did you mean 'm1_left_drive'"),
        ('[[events]]\nlink = "m1_tol"\nat = 0.0\n', 5, "did you mean 'm1_tool'"),
        (PD + REFERENCE + 'table = "short.csv"\n', 9, "the table runs from 0 s to 0.5 s, the scene from 0 to 1 s"),
        (PD + REFERENCE + 'table = "none.csv"\n', 9, "none.csv"),
        ('[controller]\nkind = "efforts"\ntable = "short.csv"\n', 6, "m1_left_drive/effort"),
        ('[controller]\nkind = "efforts"\ntable = "efforts.csv"\n', 6, "from 0 s to 0.5 s"),
        ('[controller]\nkind = "efforts"\nefforts = { m1_left_driv = 1 }\n', 4, "did you mean 'm1_left_drive'"),
        ("[initial.rates.joints]\nm1_left_drive = 1.0\nm1_left_elbow = 5.0\n", 6, "would open loops"),
        ("[initial.rates]\nplatforms = { m1_tool = { x = 1.0 } }\n", 5, "its pose is not given"),
        ("[initial]\nplatforms = { m1_tool = { x = 9.0, z = 9.0 } }\n", 4, "m1_"),
        ("[output]\ntimes = [0.5, 2.0]\n", 5, "after the end"),
        ('[controller]\nkind = "python"\nfile = "law.py"\n', 6, "allow_python"),
        ('[controller]\nkind = "python"\nfile = "../law.py"\n', 6, "beside the scene"),
        ("[initial.rates.joints]\nm1_left_elbw = 5.0\n", 5, "did you mean 'm1_left_elbow'"),
        ('[controller]\nkind = "pd"\nkp = { m1_left_drive = 1 }\nkd = 1\n[[controller.reference.points]]\ntime = 0\n',
         4, "'m1_right_drive' has no number"),
        (PD + "[[controller.reference.points]]\ntime = 0\njoints = { m1_left_elbow = 1 }\n", 10, "not a motor"),
    ],
)  # fmt: skip
def test_what_the_robot_refuses(tmp_path: Path, text: str, line: int, words: str) -> None:
    (tmp_path / "short.csv").write_text(
        "time,m1_left_drive/position,m1_left_drive/velocity,m1_left_drive/acceleration,"
        "m1_right_drive/position,m1_right_drive/velocity,m1_right_drive/acceleration\n0,0,0,0,0,0,0\n0.5,0,0,0,0,0,0\n"
    )
    (tmp_path / "efforts.csv").write_text("time,m1_left_drive/effort,m1_right_drive/effort\n0,0,0\n0.5,0,0\n")
    assert str(refusal(tmp_path, text, words)).startswith(f"{tmp_path}/scene.toml:{line}: ")


def test_no_toml_no_robot_no_text(tmp_path: Path) -> None:
    refusal(tmp_path, "x =\n", ":4: not readable as TOML")
    path = save(tmp_path, b"\xff", "other.toml")
    refused(lambda: read_scene(path), ModelError, "UTF-8")
    path.write_text('duration = 1.0\n[robot]\nfile = "none.urdf"\n')
    refused(lambda: stage(path), ModelError, r"other.toml:3: 'robot.file': .*none.urdf")


def test_a_shipped_robot_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file beside the scene wins, whatever lies in the working directory."""
    folder, elsewhere = tmp_path / "scenes", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    (elsewhere / "five_bar").write_text("no robot")
    monkeypatch.chdir(elsewhere)
    path = save(folder, 'duration = 1.0\n[robot]\nfile = "five_bar"\n', "scene.toml")
    ready = stage(path)
    assert Path(ready.source.robot).samefile(ROOT / "urdf/five_bar.urdf.xacro")
    assert ready.robot.name == "five_bar"
    (folder / "five_bar").write_text((ROOT / "urdf/delta.urdf.xacro").read_text())
    assert read_scene(path).robot == str(folder / "five_bar")
    path.write_text('duration = 1.0\n[robot]\nfile = "fivebar"\n')
    refused(lambda: stage(path), ModelError, r"scene.toml:3: 'robot.file': .*no shipped robot.*'five_bar'")


def test_lines_of_arrays_of_tables() -> None:
    text = '[[a.b]]\nx = 1\n[[a.b]]\n"x" = 2\n[a.b.c]\ny = 3\n[d]\nz = [\n  1,\n]\n'
    places = {("a", "b", 0, "x"): 2, ("a", "b", 1, "x"): 4, ("a", "b", 1, "c", "y"): 6, ("d", "z", 0): 8}
    assert {keys: line_of(text, keys) for keys in places} == places
    assert line_of(text, ("e",)) is None
