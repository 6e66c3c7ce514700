"""What is told of a motion that ends before a singular posture: the joint, and how far it is from there."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import AssemblyError
from tests.as_written import Sheet, point
from tests.comparing import close_to, refused

#: Relative, of what is told: the angle that is left is the first term of a series, and the next one is
#: smaller by a third of the angle's square. The angle is up to half a radian.
FIRST = 0.1
#: Of what is told with two digits.
TOLD = 0.05


@pytest.mark.parametrize(("start", "stop"), [(-0.9, -1.06), (-0.9, -1.2), (-1.0, -1.5)])
def test_a_tool_past_its_reach_tells_how_far_the_joint_is_from_there(
    tmp_path: Path, start: float, stop: float
) -> None:
    """Around an axis inclined by 30 degrees, sin(pitch) = (cos q - 1) sin(60 deg) / 2: 60 degrees at most.

    No sum of lengths proves it.
    """
    s, axis = Sheet("base"), point(0.5, 0.0, np.sqrt(0.75))
    s.joint("revolute", "base", "turning", point(0, 0, 0), axis, motor=True, limits=(-2.0, 2.0))
    s.joint("fixed", "turning", "tool", point(0.5, 0, 0))
    path = tmp_path / "inclined.urdf"
    path.write_text(s.text("inclined"))
    robot, rows = hybridyn.load(path), np.array([start, stop])

    def turned(pitch: float) -> float:
        return float(np.arccos(1 + np.sin(pitch) / np.sqrt(0.1875)))

    error = refused(
        partial(
            hybridyn.assemble, robot, platforms={"tool": ({"pitch": rows},)}, guess=np.array([turned(start)])
        ),
        AssemblyError,
        r"pitch of 'tool': not reached at sample 1: .* joint 'turning_joint' .* is about \S+ rad from a sing",
    )
    (outside,) = re.findall(r"joint 'turning_joint' .* is (\S+) rad outside its limits there", str(error))
    close_to(float(outside), np.pi - 2.0, TOLD)
    done = float(re.findall(r"ends at (\S+) % of the way", str(error))[0]) / 100
    close_to(error.distance, np.pi - turned(start + done * (stop - start)), FIRST)
