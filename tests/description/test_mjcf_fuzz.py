"""No mutation of an MJCF file ends in a traceback, a hang or a robot that lost a body, a joint or a loop.

Each mutated file is read, or refused with a `ModelError` of one line. A robot that is read has the masses,
the joints and the equalities of MuJoCo's own model of the same file.
"""

import random
from pathlib import Path

import numpy as np
import pytest

from hybridyn.description import Description
from tests.description.reading import mutated, outcome
from tests.extras import needs
from tests.files import save
from tests.mjcf_texts import BAR, mjcf
from tests.mutations import TREE
from tests.samples import slow

mujoco = needs("mjcf")

CASES = 40  # per seed

BODY = BAR.format(x=0.1, m=1)
HEAD = """<compiler angle="degree" eulerseq="XYZ" autolimits="true"/>
<option gravity="0 0 -9.81"><flag contact="disable"/></option>
<default><joint damping="0.1"/>
<default class="strong"><joint armature="0.02" axis="0 1 0"/></default></default>
<asset><mesh name="part" file="part.obj" scale="0.1 0.1 0.1"/>
<texture name="t" builtin="flat" width="8" height="8"/></asset>"""
WORLD = f"""<include file="scene.xml"/>
<body name="a" pos="0 0 1" euler="10 20 30"><joint name="a1" class="strong" ref="10"/>
<joint name="a2" type="slide" axis="1 0 0" stiffness="3" springref="0.2" range="-1 1"/>{BODY}
<site name="sa" pos="0.1 0 0"/><body name="b" pos="0.3 0 0"><joint name="b1" axis="0 1 0" pos="0 0.1 0"/>
<geom type="mesh" mesh="part" density="500"/></body></body>
<frame pos="0 1 0"><body name="c" childclass="strong"><joint name="c1"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/>
<replicate count="2" offset="0.1 0 0"><body name="d"><joint name="d1" type="ball" armature="0"/>{BODY}</body>
</replicate><site name="sc" pos="0.3 0 0"/></body></frame>"""
EQUALITY = """<equality><connect name="pin" site1="sa" site2="sc"/>
<weld name="hold" body1="b" body2="d0" anchor="0.1 0 0"/>
<joint name="gear" joint1="a1" joint2="c1" polycoef="0.1 -2 0 0 0"/>
<tendon name="belt" tendon1="t1"/></equality>"""
TEXT = mjcf(
    '<tendon><fixed name="t1"><joint joint="a2" coef="2"/><joint joint="b1" coef="-0.5"/></fixed></tendon>',
    EQUALITY,
    '<actuator><motor joint="a1" gear="50" ctrlrange="-1 1"/><position joint="c1" kp="10"/></actuator>',
    '<keyframe><key name="home" qpos="0.1 0 0.2 0.3 1 0 0 0 1 0 0 0"/></keyframe>',
    '<sensor><jointpos joint="a1"/></sensor>',
    world=WORLD,
    head=HEAD,
)
PART = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
SCENE = '<mujocoinclude><geom type="plane" size="1 1 1"/><camera name="eye"/></mujocoinclude>'


def check(description: Description, path: Path, text: bytes) -> bool:
    """Compare a robot with MuJoCo's model of its file; False where that refuses what hybridyn leaves out."""
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        return False
    inactive = sum('active="false"' in note for note in description.notes)
    assert len(description.closures) + len(description.couplings) + inactive == model.neq, text
    movable = [joint for joint in description.joints if joint.kind != "fixed"]
    floating = description.base == "floating"
    assert len(movable) + floating == model.njnt, text
    masses = sorted(link.mass for link in description.links if link.mass)
    static = {"do not move" in note for note in description.notes}
    if True not in static:
        np.testing.assert_allclose(
            masses, sorted(mass for mass in model.body_mass if mass), err_msg=str(text)
        )
    return True


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "part.obj").write_text(PART)
    (tmp_path / "scene.xml").write_text(SCENE)
    return tmp_path


def test_the_file_is_good_as_it_stands(folder: Path) -> None:
    found = outcome(save(folder, TEXT, "r.xml"), TEXT.encode())
    assert found is not None
    assert (len(found.closures), len(found.couplings), found.motors) == (2, 2, ("a1", "c1"))
    assert check(found, folder / "r.xml", TEXT.encode())


@pytest.mark.filterwarnings("ignore")  # MuJoCo's own, of masses that differ by 20 digits
@pytest.mark.parametrize("seed", [0, 1, 2, *(slow(seed) for seed in range(3, 30))])
def test_mutations(folder: Path, seed: int) -> None:
    draw, file, judged = random.Random(seed), folder / "r.xml", []

    def judge(found: Description, text: bytes) -> None:
        judged.append(check(found, file, text))

    mutated(file, lambda: draw.choice(TREE)(TEXT, draw), CASES, judge)
    assert any(judged)
