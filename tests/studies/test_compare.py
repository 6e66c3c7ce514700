"""`compare`: it finds every closure that an engine ignores, and agrees with engines that hold them."""

import json
import re
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.structure.robot import HybridRobot
from hybridyn.studies.compare import compare as module
from hybridyn.studies.compare.compare import compare
from hybridyn.studies.compare.engines.mujoco_engine import MujocoEngine
from hybridyn.studies.compare.judging import judge
from hybridyn.studies.compare.states import apart, closure_rows, draw_states
from tests import ROOT
from tests.robots.robot_texts import INERTIAL, LOOP, door, robot, save
from tests.support.command_line import call
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.samples import slow
from tests.support.snippets import blocks

#: Largest relative difference of two exact computations.
EXACT = 1e-9
BALL = LOOP.replace('"revolute"', '"spherical"').replace('<axis xyz="0 0 1"/>', "")
MOTOR = '<transmission name="t"><joint name="drive"/></transmission>'
WHEEL = (
    f'<link name="wheel">{INERTIAL}</link><joint name="roll" type="continuous"><parent link="ground"/>'
    '<child link="wheel"/><axis xyz="0 1 0"/><mimic joint="drive" multiplier="-3"/></joint>'
)
TWO_BARS = robot(BALL, WHEEL, MOTOR)
FIVE_BAR = blocks(ROOT / "docs" / "formats.md", "xml")[0].text


@pytest.fixture(scope="module")
def two_bars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a four-bar with a loop and a mimicking wheel, neither of which Pinocchio's reader reads."""
    return save(tmp_path_factory.mktemp("compare"), TWO_BARS)


def small(difference: float | None) -> bool:
    """Tell whether a difference was measured, and is rounding."""
    return difference is not None and difference < EXACT


def test_finds_what_the_reader_of_pinocchio_drops(two_bars: Path) -> None:
    loaded = hybridyn.load(two_bars)
    found = compare(loaded, ["pinocchio"], samples=2)
    own, read, constrained = found.verdicts
    assert found.ignored == {
        "pinocchio, its URDF reader": ["pin", "roll"],
        "pinocchio, rigid constraints": ["roll"],
    }
    assert (own.freedoms, read.freedoms, constrained.freedoms) == (1, 4, 2)
    assert (read.acceleration or 0.0) > 0.1
    assert small(read.effort)
    assert any("no constraint for roll" in note for note in constrained.notes)
    assert [closure.fate for closure in constrained.closures] == ["held", "ignored"]


@pytest.mark.parametrize("text", [slow(robot(BALL, MOTOR)), robot(LOOP, MOTOR)], ids=["point", "hinge"])
def test_agrees_where_the_engine_holds_every_closure(tmp_path: Path, text: str) -> None:
    """A hinge is two points on its axis for Pinocchio; its six rows have rank five."""
    found = compare(hybridyn.load(save(tmp_path, text)), ["pinocchio"], samples=2)
    held = found.verdicts[-1]
    assert held.way == "rigid constraints"
    assert held.agrees(1, EXACT)
    assert found.different == ["pinocchio, its URDF reader"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta", "gough_stewart", "rps3"])
def test_shipped_robots(name: str) -> None:
    found = compare(hybridyn.load(name), ["pinocchio", "mujoco"], samples=2)
    read, constrained = found.verdicts[1:3]
    assert read.named("ignored") == [closure.name for closure in read.closures]
    assert constrained.agrees(found.freedoms, 1e-8)
    for verdict in found.verdicts:
        assert verdict.refusal or (verdict.effort is not None and verdict.effort < 1e-8)


def test_an_engine_that_only_says_that_it_holds_the_loop(two_bars: Path) -> None:
    """As continuous plants of Drake 1.51 did: a constraint is counted and leaves the dynamics as they are."""
    loaded = hybridyn.load(two_bars)

    data, model = loaded.model.createData(), loaded.model
    pretending: Any = SimpleNamespace(
        way="by its word", notes=(), freedoms=lambda q: 1,
        forward=lambda q, v, force: np.array(pin.aba(model, data, q, v, force)),
        inverse=lambda q, v, a: np.array(pin.rnea(model, data, q, v, a)),
    )  # fmt: skip
    states = draw_states(loaded, 2, 0)
    verdict = judge(loaded, pretending, states, ("other", "1"), 1e-6)
    assert verdict.named("ignored") == ["pin", "roll"]
    assert not verdict.agrees(1, 1.0)


class Partly:
    """An `Engine` that holds some rows of a robot's closures, each of them as softly as is asked."""

    way, notes = "by its rows", ()

    def __init__(self, robot: HybridRobot, kept: Sequence[int], softness: float) -> None:
        self.robot, self.kept, self.softness = robot, kept, softness
        self.model, self.data = robot.unchanged_model, robot.unchanged_model.createData()

    def forward(self, q: np.ndarray, v: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Compute accelerations with the rows in place."""
        a = np.array(pin.aba(self.model, self.data, q, v, force))
        J = closure_rows(self.robot, q)[self.kept]
        M_inv = np.array(pin.computeMinverse(self.model, self.data, q))
        M_inv = np.triu(M_inv) + np.triu(M_inv, 1).T
        A = J @ M_inv @ J.T
        A += np.diag(np.diag(A)) * self.softness
        return a - M_inv @ J.T @ np.linalg.lstsq(A, J @ a + self.drift(q, v)[self.kept], rcond=1e-12)[0]

    def drift(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the second derivatives of all residuals without accelerations."""
        out = []
        for part in self.robot.modules:
            m, qk, vk = part.mechanism, q[None, part.q_index], v[None, part.v_index]
            motion = m.spanning.sweep(qk, vk, 0.0 * vk)
            out.append(m.spanning_closures.rates(motion, vk)[1][0] * m.spanning_row_scale)
        return np.concatenate(out)

    def inverse(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Compute the forces of the tree."""
        return np.array(pin.rnea(self.model, self.data, q, v, a))

    def freedoms(self, q: np.ndarray) -> int:
        """Count what the rows leave."""
        return self.robot.nv - int(np.linalg.matrix_rank(closure_rows(self.robot, q)[self.kept], tol=1e-9))


def gripper(seed: int) -> str:
    """Return a gripper whose joints all mimic the driven one, like the fingers of most."""
    rng = np.random.default_rng(seed)
    joint = '<limit lower="-1" upper="1" effort="50" velocity="2"/><axis xyz="0 0 1"/>'
    parts, ends = ["<link name='palm'/>"], ["palm"]
    for i in range(6):
        m, on = rng.uniform(0.01, 0.1), ends[int(rng.integers(len(ends)))]
        mimic = f"<mimic joint='j0' multiplier='{rng.choice([-1, 1])}'/>" if i else ""
        parts.append(
            f"<link name='l{i}'><inertial><origin xyz='.02 0 0'/><mass value='{m}'/>"
            f"<inertia ixx='{m * 1e-5}' iyy='{m * 3e-4}' izz='{m * 3e-4}' ixy='0' ixz='0' iyz='0'/>"
            "</inertial></link>"
            f"<joint name='j{i}' type='revolute'><origin xyz='.03 {rng.uniform(-0.03, 0.03)} 0'/>"
            f"<parent link='{on}'/><child link='l{i}'/>{joint}{mimic}</joint>"
        )
        ends.append(f"l{i}")
    return f"<robot name='gripper'>{''.join(parts)}</robot>"


#: Robots, the rows that an engine holds of all closures (None: all), and the fate of each closure.
HELD: dict[str, tuple[str, list[int] | None, list[str]]] = {
    **{f"gripper {seed}": (gripper(seed), None, ["held"] * 5) for seed in range(3)},
    "a gripper of which a joint is left out": (
        gripper(0),
        [0, 1, 3, 4],
        ["held", "held", "ignored", "held", "held"],
    ),
    "a loop and a wheel": (TWO_BARS, None, ["held"] * 2),
    "a point that is held along one axis": (TWO_BARS, [0, 2, 3], ["partial", "held"]),
    "a point that is held across the plane alone": (TWO_BARS, [2, 3], ["ignored", "held"]),
    "a hinge that is held as a point": (robot(LOOP, MOTOR), [0, 1, 2], ["held"]),
    "nothing": (TWO_BARS, [], ["ignored"] * 2),
}


@pytest.mark.parametrize("case", HELD)
def test_fates_come_from_the_rows_that_an_engine_holds(case: str, tmp_path: Path) -> None:
    """Each state alone says the same."""
    text, kept, fates = HELD[case]
    loaded = hybridyn.load(save(tmp_path, text))
    rows = len(closure_rows(loaded, loaded.home))
    kept = list(range(rows)) if kept is None else kept
    for state in draw_states(loaded, 3, 0):
        for softness in (0.0, 0.1, 9.0):
            engine = Partly(loaded, kept, softness)
            verdict = judge(loaded, engine, [state], ("rows", "1"), 1e-9)
            expected = ["softened" if softness and fate == "held" else fate for fate in fates]
            assert [closure.fate for closure in verdict.closures] == expected, verdict


def test_mujoco_holds_what_mimics(tmp_path: Path) -> None:
    """The verdict was that of one random state: with a small free opening, springs left most of it."""
    needs("mjcf")
    loaded = hybridyn.load(save(tmp_path, gripper(0)))
    for seed in range(4):
        read = compare(loaded, ["mujoco"], samples=1, seed=seed).verdicts[1]
        assert len(read.named("softened")) == 5


WELD = """<mujoco><worldbody><body name="a"><joint name="drive" axis="0 1 0"/>
<inertial pos=".1 0 0" mass="1" diaginertia=".01 .02 .02"/><body name="b" pos=".3 0 0">
<joint name="j" axis="0 1 0"/>
<inertial pos=".1 0 0" mass="1" diaginertia=".01 .02 .02"/></body></body>
<body name="c" pos=".6 0 0"><joint name="k" axis="0 1 0"/>
<joint name="x" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="1" diaginertia=".01 .02 .02"/></body></worldbody>
<equality><weld body1="b" body2="c"/></equality><actuator><motor joint="drive"/></actuator></mujoco>"""


def test_a_weld_without_torque_is_held_in_part(tmp_path: Path) -> None:
    needs("mjcf")
    import mujoco

    loaded = hybridyn.load(save(tmp_path, WELD, "weld.xml"))
    model = mujoco.MjModel.from_xml_string(WELD.replace("<weld", '<weld torquescale="0"'))
    engine = MujocoEngine(loaded, model, "without torque")
    for seed in range(4):
        verdict = judge(loaded, engine, draw_states(loaded, 1, seed), ("mujoco", ""), 1e-6)
        (weld,) = verdict.closures
        assert (weld.fate, weld.lost, weld.rows) == ("partial", 1, 3)
        assert verdict.freedoms == loaded.mobility + 1


def test_an_engine_without_numbers_does_not_agree(two_bars: Path) -> None:
    """Accelerations that are nan are told as nan, not as zero."""
    loaded = hybridyn.load(two_bars)
    lost: Any = SimpleNamespace(
        way="lost", notes=(), freedoms=lambda q: 1,
        forward=lambda q, v, force: np.full(loaded.nv, np.nan),
        inverse=lambda q, v, a: np.full(loaded.nv, np.nan),
    )  # fmt: skip
    verdict = judge(loaded, lost, draw_states(loaded, 2, 0), ("other", "1"), 1e-6)
    assert np.isnan(verdict.acceleration)
    assert np.isnan(verdict.effort)
    assert not verdict.agrees(1, 1.0)


def test_states_are_closed(two_bars: Path) -> None:
    loaded = hybridyn.load(two_bars)
    for state in draw_states(loaded, 3, 1):
        assert float(hybridyn.closure_residual(loaded, state.q)) < 1e-10
        assert max(apart(loaded, state.q, state.v, state.a)) < 1e-9 * np.abs(state.a).max()
        assert np.abs(state.tau).max() > 0


@pytest.mark.slow
def test_mujoco_softens_what_it_holds(tmp_path: Path) -> None:
    needs("mjcf")
    path = save(tmp_path, FIVE_BAR, "five_bar.xml")
    found = compare(hybridyn.load(path), ["mujoco"], samples=2)
    (verdict,) = found.verdicts[1:]
    assert verdict.way == "its MJCF reader"
    assert verdict.freedoms == 2
    assert verdict.named("softened") == ["tip"]
    assert small(verdict.effort)
    assert found.ignored == {}
    assert found.different == ["mujoco, its MJCF reader"]


HEAVY = """<mujoco><worldbody><body name="trunk"><freejoint name="root"/>
<inertial pos="0 0 0" mass="100" diaginertia="100 100 100"/><body name="thigh">
<inertial pos="0 0 -0.1" mass="1.2e-4" diaginertia="1e-6 1e-6 2e-7"/><joint name="hip" axis="0 1 0"/>
<body name="shin" pos="0 0 -0.25"><inertial pos="0 0 -0.1" mass="6e-5" diaginertia="4e-7 4e-7 1e-7"/>
<joint name="knee" axis="0 1 0"/><body name="foot" pos="0 0 -0.25">
<inertial pos="0.03 0 0" mass="2e-5" diaginertia="4e-8 4e-8 1e-8"/><joint name="ankle" axis="0 1 0"/>
</body></body></body></body></worldbody>
<tendon><fixed name="belt"><joint joint="hip" coef="1"/><joint joint="knee" coef="1"/>
<joint joint="ankle" coef="1"/></fixed></tendon>
<equality><tendon name="parallel" tendon1="belt"/></equality>
<actuator><motor joint="hip"/><motor joint="knee"/></actuator></mujoco>"""


def test_mujoco_does_not_ignore_an_equality_of_light_bodies(tmp_path: Path) -> None:
    """Beside a heavy trunk its solver stops before it holds them, though its simulation does."""
    needs("mjcf")
    path = save(tmp_path, HEAVY, "heavy.xml")
    (verdict,) = compare(hybridyn.load(path), ["mujoco"]).verdicts[1:]
    (belt,) = verdict.closures
    assert belt.fate == "softened"
    assert 0.05 < belt.left < 0.15  # impedance 0.9, MuJoCo's default for an equality that has not opened


@pytest.mark.slow
def test_mujoco_by_way_of_convert(two_bars: Path) -> None:
    needs("mjcf")
    found = compare(hybridyn.load(two_bars), ["mujoco"], samples=2)
    read, converted = found.verdicts[1:]
    assert read.named("ignored") == ["pin"]  # MuJoCo reads <mimic>
    assert converted.freedoms == 1
    assert converted.named("ignored") == []
    assert small(converted.effort)


@pytest.mark.slow
def test_trees_have_no_closure_to_ignore(tmp_path: Path) -> None:
    found = compare(hybridyn.load(save(tmp_path, door(1))), ["pinocchio"], samples=2)
    assert found.different == []
    assert found.closures == ()


def test_versions_are_told_without_the_metadata_of_packages(
    two_bars: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where conda installed Pinocchio, or hybridyn runs from its sources."""
    monkeypatch.setattr(metadata, "distribution", Mock(side_effect=metadata.PackageNotFoundError("pin")))
    found = compare(hybridyn.load(two_bars), ["pinocchio"], samples=1)
    assert {(one.engine, one.version) for one in found.verdicts} == {
        ("hybridyn", hybridyn.__version__), ("pinocchio", pin.__version__),
    }  # fmt: skip


def test_absent_engines_are_named(two_bars: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    found = compare(hybridyn.load(two_bars), ["mujoco"], samples=1)
    ((name, reason),) = found.skipped
    assert name == "mujoco"
    assert "is not installed: install it with" in reason
    refused(
        lambda: compare(hybridyn.load(two_bars), ["mujco"]),
        hybridyn.ModelError,
        r"no engine 'mujco' \(did you mean 'mujoco'",
    )


def test_command(two_bars: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["compare", two_bars, "--with", "pinocchio", "--samples", "1"]
    shown = call(capsys, *words, status=1).out
    assert "pinocchio, its URDF reader: ignores 'pin', 'roll'" in shown
    assert "4 (!)" in shown
    facts = json.loads(call(capsys, *words, "--json", "--fail-on", "never").out)
    assert facts["ignored"]["pinocchio, rigid constraints"] == ["roll"]


@pytest.mark.slow
def test_the_page_shows_what_the_command_prints(capsys: pytest.CaptureFixture[str]) -> None:
    """Numbers and times differ from machine to machine; engines, ways, freedoms and fates do not."""
    needs("mjcf")
    block = next(block for block in blocks(ROOT / "docs" / "compare.md", "console"))
    said = call(capsys, "compare", "five_bar", "--with", "pinocchio,mujoco", status=1)
    printed = [re.split(r"\s{2,}", line)[:4] for line in said.out.splitlines()]
    for line in block.text.splitlines()[2:-2]:
        cells = re.split(r"\s{2,}", line)[:4]
        assert line == "..." or cells in printed, line
