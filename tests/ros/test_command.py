"""The command `hybridyn ros`: its words, those of ROS behind them, and what it says where ROS is missing."""

import sys
from typing import Any

import pytest

from hybridyn.cli import main
from hybridyn.cli.words import middleware
from tests.support.command_line import call


def test_words_of_ros_stand_behind_the_command_s_own(monkeypatch: pytest.MonkeyPatch) -> None:
    got: dict[str, Any] = {}
    monkeypatch.setattr(middleware.ros, "callback", lambda **words: got.update(words))
    ros = ["--ros-args", "-p", "payload_mass:=2.0", "-r", "motor_states:=/driver/joint_states"]
    assert main(["ros", "five_bar", "--joints", "a,b", "--rate", "50", *ros]) == 0
    assert (got["joints"], got["rate"], got["ros_args"]) == (("a", "b"), 50.0, tuple(ros))
    assert got["load"].xacro_args == {}  # `:=` belongs to ROS here
    assert main(["ros"]) == 0
    assert (got["load"].robot, got["ros_args"]) == (None, ())


def test_without_ros_the_extra_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    call(capsys, "ros", "five_bar", status=1, says="hybridyn ros needs rclpy: install it with")


def test_c_and_ros_exclude_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, "convert", "five_bar", "--c", "--ros", "-o", "out", status=2, says="exclude each other")
    call(capsys, "convert", "five_bar", "--ros", "--float32", "-o", "out", status=2, says="belong to --c")
    words = ("convert", "five_bar", "--ros", "--effects", "none", "-o", "out")
    call(capsys, *words, status=2, says="--effects belong to --c")
