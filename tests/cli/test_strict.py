"""--strict makes each note on a robot's file an error, in every command that reads one."""

from pathlib import Path

import click
import pytest

import hybridyn
from hybridyn.cli import COMMANDS, words
from hybridyn.errors import ModelError
from hybridyn.scenes.scene_file import read_scene
from hybridyn.scenes.stage import stage
from tests.robots.robot_texts import LOOP, robot
from tests.support.comparing import refused
from tests.support.files import save

NOTED = robot("<custom_tag/>", LOOP)
SCENE = 'duration = 0.1\n[robot]\nfile = "r.urdf"\nmotors = ["drive"]\n{}\n'


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_strict_if_asked(name: str) -> None:
    command: click.Command = getattr(words, name)
    assert "strict" in [option.name for option in command.params]


@pytest.mark.parametrize("how", ["key", "call"])
def test_a_scene_is_strict(how: str, tmp_path: Path) -> None:
    save(tmp_path, NOTED, "r.urdf")
    loose = save(tmp_path, SCENE.format(""), "scene.toml")
    assert read_scene(loose).scene.robot.strict is False
    scene = save(tmp_path, SCENE.format("strict = true" if how == "key" else ""), "scene.toml")
    source = read_scene(scene, strict=how == "call")
    refused(lambda: stage(source), ModelError, "custom_tag")
    assert hybridyn.load(tmp_path / "r.urdf").notes
