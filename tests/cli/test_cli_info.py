"""`hybridyn info`: equal modules told once, ranks of rounded files, passive motions, a singular home."""

import re
from pathlib import Path

import pytest

import hybridyn
from hybridyn.cli.info import lines
from hybridyn.figures.module_tree import cards
from hybridyn.studies.check import loops
from hybridyn.studies.check.loops import home_residuals
from tests import ROOT
from tests.structure.test_rank_evidence import pinned
from tests.support.files import expanded, save

SNAKE, FIVE_BAR = ROOT / "urdf/snake.urdf.xacro", ROOT / "urdf/five_bar.urdf.xacro"


def test_equal_modules_are_told_once(run) -> None:
    out = run("info", SNAKE).out
    assert re.search(
        r"m3_platform ... m11_platform  modules 3-11, .* like module 2\s+\(m2_platform\); 27 motors",
        out,
        re.S,
    )
    assert "m2_leg1_slide*" in out
    assert "m5_leg1_slide*" not in out
    assert "m12_leg1_slide*" in out  # the last one carries another end


def test_every_module_is_told_once_or_folded() -> None:
    robot = hybridyn.load(SNAKE)
    residuals = home_residuals(robot)
    text = "\n".join(lines(cards(robot, residuals, ()), 100))
    told = [module.name for module in robot.modules if re.search(rf"─ {module.name}  module", text)]
    assert len(told) + 9 == len(robot.modules)
    residuals[6] = 0.1  # no module that is open is hidden by its equals
    assert "some OPEN at home" in " ".join("\n".join(lines(cards(robot, residuals, ()), 100)).split())


def test_motions_without_a_motor(run) -> None:
    out = run("info", FIVE_BAR, "--motors", "m1_left_drive").out
    assert re.search(r"passive +the motion of joint 'm1_right_\w+' has no motor", out)
    assert "1 fewer than freedoms" in out


def test_the_rank_of_a_rounded_file_is_reported(run, tmp_path: Path) -> None:
    """Six digits of an axis: what closes in the plane to rounding no longer does exactly."""
    assert "rank  " not in run("info", FIVE_BAR).out
    path = save(
        tmp_path, expanded(FIVE_BAR).replace('<axis xyz="0 1 0"/>', '<axis xyz="1e-7 1 2e-7"/>', 1), "r.urdf"
    )
    out = run("info", path).out
    found = re.search(r"rank +2; relative singular values count from (\S+) up, and not up to\s+(\S+):", out)
    assert found is not None, out
    assert 1e-9 < float(found[2]) < 1e-5 < float(found[1])


def test_what_was_decided_about_a_rank_is_told_by_info_alone(
    run, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = pinned(tmp_path, 8e-5)
    for command, told in (("home", False), ("info", True), ("home", False)):
        caplog.clear()
        run(command, path, "--motors", "drive")
        assert ("count as independent" in caplog.text) == told


def test_a_singular_home_is_told_where_the_module_is(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loops, "SINGULAR_POSTURE", 2.0)
    out = run("info", FIVE_BAR).out
    assert "module's size; SINGULAR" in out
    assert "its closures lose rank at the home posture" in " ".join(out.split())
