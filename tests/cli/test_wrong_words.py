"""Commands with words that cannot be: one line on standard error, and nothing is written."""

import os
import shlex
from pathlib import Path

import numpy as np
import pytest

from tests import ROOT
from tests.cli.test_cli import ARM, HEADER, ROWS, TIME
from tests.quantities.ankle import JOINTS, MOTORS, ankle_text
from tests.support.command_line import table_text
from tests.support.extras import needs
from tests.support.files import save

ANKLE = f"workspace ankle.urdf --motors {','.join(MOTORS)} --map {','.join(JOINTS)}"
ENDLESS = ANKLE.replace("ankle", "endless")

#: Status 2: usage errors, which name the help.
USAGE = [
    ("ids", "there is no command 'ids'"),
    ("robots", "there is no command 'robots' (it is 'hybridyn --robots' now)"),
    *((f"{name} lx4", f"'{name}' (it is 'hybridyn ") for name in ("size", "effects", "map", "check")),
    ("export lx4 -o c", "there is no command 'export' (it is 'hybridyn convert ROBOT --c -o FOLDER' now)"),
    ("convert lx4 -o lx4.sdf --map a,b", "belong to --c"),
    ("convert lx4 -o lx4.sdf --gravity 0,0,0", "belong to --c"),
    ("convert lx4 -o lx4 --c --tightness 0.01", "--tightness belongs to robot files"),
    ("idm", "Missing argument"),
    ("idm arm.urdf", "Missing argument"),
    ("idm mine.urdf", "Missing argument 'TRAJECTORY'"),  # a robot of one's own has none
    ("ddm five_bar", "Missing argument 'STATES'"),  # a trajectory has no efforts
    ("idm arn.urdf traj.csv", "did you mean 'arm.urdf'"),
    ("idm arm.urdf tray.csv", "did you mean 'traj.csv'"),
    ("idm {folder}/arn.urdf traj.csv", "did you mean '{folder}/arm.urdf'"),
    ("idm traj.csv arm.urdf", "'traj.csv' is a table; the robot comes first"),
    ("simulate arm.urdf", "'arm.urdf' is a robot; a scene is a TOML file"),
    ("idm . traj.csv", "is a folder"),
    ("idm {root}/urdf", "is a folder"),
    ("idm nowhere/arm.urdf traj.csv", "no folder 'nowhere'"),
    ("idm fivebar", "did you mean 'five_bar'"),
    ("idm five_bar five_bar/trj.csv", "no folder 'five_bar' (did you mean 'five_bar/traj.csv'?)"),
    ("simulate five_bar/swim.toml", "no folder 'five_bar' (did you mean 'five_bar/swing.toml'?)"),
    ("simulate FIVE_BAR", "no shipped robot of that name (did you mean 'five_bar'?)"),
    ("compare five_bar --with bullet", "there is no engine 'bullet'"),
    *(
        (words, f"'{words.split()[-1]}' is not a regular file but a pipe or a device")
        for words in ("info x.urdf", "idm five_bar x.csv", "plot x.csv", "simulate x.toml")
    ),
    ("info five_bar --gravity 0 0 -9.81", "write numbers with commas between: --gravity 0,0,-9.81"),
    ("info five_bar --gravity 0, 0, 0", "write numbers with commas between: --gravity 0,0,0"),
    ("idm --gravity -1 2.5e1 .5 five_bar t.csv", "write numbers with commas between: --gravity -1,2.5e1,.5"),
    ("idm arm.urdf traj.csv --gravity 1,2,down", "'1,2,down' is not numbers with commas between"),
    ("idm arm.urdf traj.csv --base loose", "'loose' is not one of"),
    ("idm arm.urdf traj.csv --xacro n=3", "name:=value"),
    ("idm arm.urdf traj.csv a:=1,b:=2", "joins arguments by a comma: write them apart, a:=1 b:=2"),
    ("idm arm.urdf traj.csv --motors lift,", "empty name"),
    ("idm arm.urdf traj.csv --weights lift=heavy", "NAME=NUMBER"),
    ("idm arm.urdf traj.csv --weights lifd=1", "did you mean 'lift'"),
    ("idm arm.urdf traj.csv --wieghts 1", "No such option"),
    *(
        (words.format(target), message)
        for words in ("idm -o {} arm.urdf traj.csv", "idm arm.urdf traj.csv -o {}")
        for target, message in (
            ("out.txt", "out.txt: a result file ends in"),
            ("no/out.csv", "the folder '{folder}/no' does not exist"),
            ("traj.csv", "'traj.csv' is read, and would be replaced"),
        )
    ),
    *(
        (f"{words} -o out.csv --plot a.gif", "must end in .png, .svg, .pdf, .html")
        for words in ("idm five_bar", "ddm five_bar traj.csv", "simulate five_bar", "idm --loads five_bar")
    ),
    ("idm --by-effect five_bar --plot a.gif", "must end in .png, .svg, .pdf, .html"),
    ("idm five_bar --effects gravty", "did you mean 'gravity'?"),
    ("idm five_bar --loads -o report.txt", "must end in .csv or .json"),
    ("idm five_bar --plot nowhere/cloud.png", "there is no folder 'nowhere'"),
    ("idm five_bar --loads --effects frction", "there is no effect 'frction'"),
    ("cost {root}/models/five_bar/swing.toml traj.csv", "a scene has its own motion"),
    ("cost five_bar {root}/models/five_bar/swing.toml", "is a scene, which names its robot: 'hybridyn cost"),
    ("cost five_bar five_bar/traj.csv --until 1", "are for scenes"),
    ("cost {root}/models/five_bar/swing.toml --quantity ddm", "--with compares accelerations along a scene"),
    ("cost five_bar five_bar/traj.csv --quantity idmm", "'idm', 'ddm', 'close'"),
    ("cost {root}/models/five_bar/swing.toml --base moving", "the robot's options stand in the scene"),
    ("cost five_bar --target 0", "is not in the range"),
    ("cost five_bar -o cost.parquet", "must end in .csv or .json"),
    ("info five_bar --ignore to-dense", "did you mean 'too-dense'"),
    ("workspace five_bar --step x:0.1", "'x:0.1' is not of the form NAME=NUMBER"),
    ("info lx4 --plot a.gif", ".pdf"),
    ("view delta --plot a.gif", "must end in .png"),
    ("view delta --plot nowhere/a.mp4", "there is no folder"),
    ("view delta --plot a.png --size 99x100", "'99x100' is not two even numbers from 64 to 4096"),
    ("view delta --plot a.png --size big", "as 1280x720"),
    ("view delta --plot a.png --time 1", "there is no motion"),
    (ANKLE, "--map and --grid belong together; along a trajectory: 'hybridyn idm --map'"),
    ("workspace five_bar --grid 3", "--map and --grid belong together"),
    (f"{ANKLE} --grid 3 --step x=1", "with --map, only --grid and -o apply"),
    ("idm five_bar --loads --by-effect", "--loads, --bearings, --by-effect and --map exclude each other"),
    ("idm five_bar --loads --reactions r.csv", "--reactions belongs to a table of efforts"),
    ("idm five_bar --by-effect --passive solved", "do not apply to --by-effect"),
    (f"{ANKLE} --grid 0", "at least one point"),
    (f"{ANKLE} --grid a:b", "neither a number of points nor FROM:TO:COUNT"),
    (f"{ANKLE} --grid 1:0:3,0:1:2", "a range has FROM < TO"),
    (f"{ANKLE} --grid 0:1:3", "--grid has 1 range for 2 joints"),
    (f"{ENDLESS} --grid 3", "joint 'pitch' has no limits in the robot's file"),
]  # fmt: skip
#: Status 1: what only the robot tells.
ASKED = [
    ("idm arm.urdf traj.csv --gravity 1,2", "gravity must be three finite numbers"),
    ("idm arm.urdf traj.csv --gravity 1,2,nan", "gravity must be three finite numbers"),
    ("idm five_bar --by-effect --effects gravity,velocity", "'velocity' needs 'inertia'"),
    ("idm five_bar --by-effect --effects spring", "state no numbers for the effect 'spring'"),
    ("idm arm.urdf spaces.csv", "spaces.csv: has spaces between its columns: write commas"),
    ("idm arm.urdf bare.txt", "bare.txt: has spaces between its columns: write commas, under a first line"),
    (
        "idm stewart_ur5 part.csv -o out.csv",
        "part.csv: what is given does not determine joint 'shoulder_pan_joint'. Give its position, too, or "
        "the pose of a link that it moves, such as 'wrist_3_link'",
    ),
    ("idm five_bar --map m1_left_elbw", "unknown joint 'm1_left_elbw' (did you mean 'm1_left_elbow'?)"),
    (f"{ANKLE},rol --grid 3", "unknown joint 'rol' (did you mean 'roll'?)"),
    (f"{ANKLE.replace(',roll', '')} --grid 0:0:1", "leaves 1 of 2 freedoms of module"),
]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of an arm, its motion and other files, which no command changes."""
    made = tmp_path_factory.mktemp("words")
    save(made, ARM, "arm.urdf")
    save(made, table_text(["time", *HEADER], np.column_stack([TIME, ROWS])), "traj.csv")
    save(made, '<robot name="mine"><link name="a"/></robot>', "mine.urdf")
    ankle = ankle_text()
    save(made, ankle, "ankle.urdf")
    save(made, ankle.replace('"pitch" type="revolute"', '"pitch" type="continuous"'), "endless.urdf")
    save(made, "time lift/position\n0 1\n", "spaces.csv")
    save(made, "0 1\n1 2\n", "bare.txt")
    save(made, "time,m1_platform/pose/x\n" + "".join(f"{i},0\n" for i in range(9)), "part.csv")
    (made / "link").symlink_to("nowhere")
    for ending in ("urdf", "csv", "toml"):
        os.mkfifo(made / f"x.{ending}")
    return made


@pytest.fixture
def folder(made: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same folder, in which the test stands."""
    monkeypatch.chdir(made)
    return made


@pytest.mark.parametrize(
    ("words", "says", "status"), [*((*case, 2) for case in USAGE), *((*case, 1) for case in ASKED)]
)
def test_wrong_words_are_one_line(run, folder: Path, words: str, says: str, status: int) -> None:
    if words.startswith("view"):
        needs("view", "yourdfpy")
    before = {path: path.lstat().st_mtime_ns for path in folder.iterdir()}
    places = {"folder": folder, "root": ROOT}
    given, message = (text.format(**places) for text in (words, says))
    run(*shlex.split(given), status=status, says=[message, *["--help"] * (status == 2)])
    assert {path: path.lstat().st_mtime_ns for path in folder.iterdir()} == before
