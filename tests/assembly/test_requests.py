"""What callers of `assemble` may ask for: positions that only a slip of the pen gives are refused at once."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
import hybridyn.assembly.assemble as assembly
from hybridyn.errors import AssemblyError
from tests import ROOT
from tests.comparing import refused

URDF = ROOT / "urdf"
WHEEL = """<robot name="r"><link name="a"/><link name="b"/>
  <joint name="spin" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
  <link name="c"/><joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize("name", ["five_bar", "rps3", "gough_stewart", "delta"])
@pytest.mark.parametrize("size", [1e5, -1e5, 1e300])
def test_absurd_positions_are_refused_at_once(
    name: str, size: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No posture is searched for."""
    monkeypatch.setattr(assembly, "follow", None)
    robot = hybridyn.load(URDF / f"{name}.urdf.xacro")
    motors = {motor: (np.zeros(5),) for motor in robot.motors}
    motors[robot.motors[1]] = (np.array([0.0, 0.0, 0.0, size, 0.0]),)
    words = f"joint '{robot.motors[1]}' is out of reach at sample 3"
    refused(lambda: hybridyn.assemble(robot, motors=motors), AssemblyError, words, sample=3)


def test_wheels_turn_far_and_rails_are_long(tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(WHEEL)
    robot = hybridyn.load(path)
    q, _, _ = hybridyn.assemble(robot, motors={"spin": (1e6,), "slide": (1e6,)})
    assert q == pytest.approx([np.cos(1e6), np.sin(1e6), 1e6])
    far = {"spin": (1e9,), "slide": (0.0,)}
    refused(lambda: hybridyn.assemble(robot, motors=far), AssemblyError, "spin")


def test_what_is_left_open_is_counted() -> None:
    robot = hybridyn.load(URDF / "five_bar.urdf.xacro")
    one = {"m1_left_drive": (0.0,)}
    refused(lambda: hybridyn.assemble(robot, motors=one), AssemblyError, "open", open_freedoms=1)
