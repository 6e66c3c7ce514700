"""The motors of an ankle as actuators of pitch and roll, judged by the closed form of its rods."""

from pathlib import Path

import numpy as np
import pytest

from hybridyn.cli import main
from hybridyn.studies.actuators import constants
from hybridyn.tables.opening import open_table, read_columns
from tests.quantities.ankle import JOINTS, MOTORS, ankle_text, closed_form
from tests.support.files import save

ROTORS, DAMPING, LIMIT = (2e-3, 3e-3), (0.1, 0.2), 80.0


def written(folder: Path, *words: str) -> dict[str, np.ndarray]:
    """Write the table of an ankle with rotors and damping, and return its columns."""
    text = ankle_text()
    for motor, rotor, damping in zip(MOTORS, ROTORS, DAMPING, strict=True):
        head, _, tail = text.partition(f'<joint name="{motor}" type="revolute">')
        more = f'<dynamics damping="{damping}"/><rotor_inertia value="{rotor}"/>'
        text = f'{head}<joint name="{motor}" type="revolute">{more}{tail}'
    file, out = save(folder, text, "ankle.urdf"), folder / "actuators.csv"
    command = ["info", str(file), "--motors", ",".join(MOTORS), "--joints", ",".join(JOINTS)]
    assert main([*command, "--actuators", str(out), *words]) == 0
    with open_table(out) as table:
        columns = table.columns
    return dict(zip(columns, read_columns(out, columns).T, strict=True))


def test_numbers_at_the_joints_are_those_of_the_rods(tmp_path: Path) -> None:
    found = written(tmp_path, "--grid=-0.3:0.3:5,-0.2:0.2:3")
    assert len(found["pitch/position"]) == 15
    for row in range(15):
        pitch, roll = (found[f"{joint}/position"][row] for joint in JOINTS)
        motors = np.zeros(2)
        for _ in range(20):  # Newton's method on the lengths of the rods, each by its own motor
            miss, h = closed_form(pitch, roll, motors)[0], 1e-7
            slope = [(closed_form(pitch, roll, motors + h)[0][i] - miss[i]) / h for i in range(2)]
            motors = motors - miss / slope
        H = closed_form(pitch, roll, motors)[1]
        A, G = H.T @ np.diag(ROTORS) @ H, np.linalg.inv(H)
        wanted = {
            "armature": np.diag(A), "damping": np.diag(H.T @ np.diag(DAMPING) @ H), "gain": np.diag(H.T @ H),
            "alone": (LIMIT / np.abs(G)).min(axis=1), "most": LIMIT * np.abs(H).sum(axis=0),
            "coupling": np.full(2, abs(A[0, 1]) / np.sqrt(A[0, 0] * A[1, 1])),
        }  # fmt: skip
        for what, x in wanted.items():
            # the table has as many digits as numbers need; motors are found to 1e-12
            np.testing.assert_allclose([found[f"{joint}/{what}"][row] for joint in JOINTS], x, rtol=1e-9)


def test_one_number_is_as_far_from_the_least_as_from_the_largest() -> None:
    armature, most = constants({"j/armature": np.array([1.0, 2.0, 3.0]), "j/most": np.array([4.0, 5.0])})
    assert (armature.value, armature.error) == (2.0, 0.5)
    assert (most.value, most.error) == (4.0, 0.25)


def test_the_few_numbers_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And motors within their limits hold an effort alone."""
    found = written(tmp_path, "--grid=-0.1:0.1:2,-0.1:0.1:2")
    assert (found["pitch/alone"] <= found["pitch/most"] * (1 + 1e-12)).all()
    said = capsys.readouterr().out.splitlines()
    assert said[0].split() == ["joint", "number", "constant", "unit", "error"]
    assert [line.split()[:2] for line in said[1:3]] == [["pitch", "armature"], ["pitch", "damping"]]
    assert said[1].rstrip().endswith("%")


@pytest.mark.parametrize("words", [["--joints", "m1_left_elbow"], ["--actuators", "a.csv"], ["--grid", "3"]])
def test_options_that_belong_together(words: list[str]) -> None:
    assert main(["info", "five_bar", *words]) == 2
