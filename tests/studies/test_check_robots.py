"""`hybridyn.check` and `hybridyn info` on the shipped robots, and on robots of other projects."""

import json
import random
from pathlib import Path

import pytest

import hybridyn
from hybridyn.description.shipped import main_names, shipped_robots
from hybridyn.studies.check.check import CODES, is_readable
from tests.robots.mutations import TREE
from tests.studies.test_check import WRONG as WRONG_ROBOTS
from tests.studies.test_check import arm, boxed, inertial
from tests.support.command_line import call
from tests.support.extras import needs, robots_of_others
from tests.support.files import save
from tests.support.samples import slow

OTHERS = sorted(str(path) for path in robots_of_others() if path.suffix in (".urdf", ".xacro"))
SAMPLE = ("quadrotor_base.urdf", "quadrotor_base.xacro")
MUTATIONS = 300  # 9,000 were run once
#: Findings of the shipped robots: the UR5 has placeholders.
KNOWN = {"stewart_ur5": {"inertia-too-large"}}


@pytest.mark.parametrize("name", main_names())
def test_shipped_robots_have_no_errors(name: str) -> None:
    if name == "stewart_ur5":
        needs("view", "trimesh")
    assert {finding.code for finding in hybridyn.check(name)} == KNOWN.get(name, set())


@pytest.mark.parametrize("name", [n for n, robot in shipped_robots().items() if robot.is_benchmark])
def test_benchmark_mechanisms_are_checked(name: str) -> None:
    assert all(finding.code in CODES for finding in hybridyn.check(name))


@pytest.mark.parametrize(
    "file",
    [file if Path(file).name in SAMPLE else slow(file) for file in OTHERS],
    ids=lambda file: "/".join(Path(file).parts[-2:]),
)
def test_robots_of_others(file: str) -> None:
    for finding in hybridyn.check(file):
        assert finding.code in CODES
        assert finding.message
        assert "nan" not in finding.message.split()


@pytest.mark.slow
def test_no_mutation_of_a_file_ends_in_a_traceback(tmp_path: Path) -> None:
    """Seeded mutations of robots that are wrong already; warnings of numpy are errors here."""
    texts = [text for text, _ in WRONG_ROBOTS.values() if text and "xacro" not in text]
    readable = 0
    for seed in range(MUTATIONS):
        draw = random.Random(seed)
        mutated = draw.choice([*TREE])(draw.choice(texts), draw)
        path = save(tmp_path, mutated, "mutated.urdf")
        findings = hybridyn.check(path)
        assert all(finding.code in CODES for finding in findings)
        readable += is_readable(findings)
    assert readable > MUTATIONS / 20


def test_the_arm_with_placeholders_is_known() -> None:
    """The UR5's three wrist links carry the inertia of a link three times their size."""
    needs("view", "trimesh")
    (file,) = [file for file in OTHERS if file.endswith("/ur5_robot.urdf")]
    found = [finding.element for finding in hybridyn.check(file) if finding.code == "inertia-too-large"]
    assert found == ["link 'wrist_1_link'", "link 'wrist_2_link'", "link 'wrist_3_link'"]


WRONG, DOUBTFUL, FINE = arm(inside=boxed(2, -0.02)), arm(inside=boxed(500, 2.0)), arm(inside=boxed(2, 0.02))


@pytest.mark.parametrize(
    ("text", "words", "status"),
    [
        (FINE, [], 0),
        (DOUBTFUL, [], 0),
        (DOUBTFUL, ["--fail-on", "warning"], 1),
        (DOUBTFUL, ["--fail-on", "note"], 1),
        (DOUBTFUL, ["--fail-on", "note", "--ignore", "too-dense"], 0),
        (WRONG, ["--fail-on", "error"], 1),
        (WRONG, [], 0),
        ("<robot", ["--fail-on", "error"], 1),
        ("<robot", [], 1),
    ],
)
@pytest.mark.parametrize("form", ["text", "json"])
def test_exit_status(
    text: str, words: list[str], status: int, form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save(tmp_path, text, "robot.urdf")
    said = call(capsys, "info", path, *words, *(["--json"] if form == "json" else []), status=status)
    assert said.err.count("\n") == (text == "<robot")  # the reason why it cannot be read
    if form == "json":
        assert all(
            fact.keys() >= {"code", "severity", "line", "why", "mend"} for fact in json.loads(said.out)
        )


def test_text_and_json_say_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = save(tmp_path, DOUBTFUL, "robot.urdf")
    (fact,) = json.loads(call(capsys, "info", path, "--json").out)
    text = call(capsys, "info", path).out
    assert f"{path}:{fact['line']}: warning [too-dense]" in text
    flat = " ".join(text.split())
    for part in ("message", "why", "mend"):
        assert " ".join(str(fact[part]).split()) in flat
    assert text.endswith("robot.urdf: 1 warning\n")


def test_many_findings_of_a_kind_are_shortened(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rotor = inertial(0, 0.01, 0.01, 0.01)
    rotors = "".join(
        f'<link name="f{i}">{rotor}</link>'
        f'<joint name="j{i}" type="fixed"><parent link="arm"/><child link="f{i}"/></joint>'
        for i in range(20)
    )
    path = save(tmp_path, arm(rotors), "robot.urdf")
    short, full = call(capsys, "info", path).out, call(capsys, "info", path, "--all").out
    assert "and 8 more [inertia-without-mass]" in short
    assert full.count("[inertia-without-mass]") == 20
    assert short.splitlines()[-1] == full.splitlines()[-1] == f"{path}: 20 warnings"
