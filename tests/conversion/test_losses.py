"""What each format cannot say is listed, and nothing else: a table of features and formats.

Each robot of `features` is written and read back. Where a cell says "kept", it comes back equal and nothing
is listed; where it names losses, it does not come back equal, and each loss is one line with the element's
name. Not compared are words for messages (the kind of a closure), scales of couplings, 0 and infinity as
limits of speed and effort (both mean none), and fixed joints and massless links that are added: a robot of
MuJoCo hangs on the body of the world.
"""

from pathlib import Path

import pytest

import hybridyn
from hybridyn.conversion.from_home import counted_from_home
from hybridyn.conversion.request import Losses
from hybridyn.description.side_cars.tables import EFFECTS
from tests.conversion.facts import SAME, SINGLE, changed
from tests.conversion.features import FEATURES
from tests.conversion.judge import read_back

#: What a line on a loss starts with, by the word for it in the table.
LINES = {
    "continuous": "continuous joints, which MuJoCo does not have: read back as hinges",
    "endless": "continuous joints, which USD does not have: read back as hinges",
    "effort": "effort limits of joints without a motor",
    "point": "links without inertia, which USD cannot say: written with a small one",
    "other": "names that USD does not allow, or that two things have, are changed",
    "planar": "planar joints are two slides and a hinge",
    "home": "positions of joints count from home, where the loops are closed",
    "free": "floating joints have the name of their link and _free, and start at the world",
    "weld": "names of fixed joints, which MuJoCo does not have",
    "equal": "position limits without room between them, which MuJoCo refuses",
    "crossed": "position limits of which the lower is above the upper",
    "speed": "speed limits, which MuJoCo does not have",
    "limit": "limits of joints with several freedoms",
    "gear": "gear ratios: the rotor's inertia is written as that at the joint",
    "forces": "friction and rotors of joints with several freedoms",
    "turns": "springs of continuous joints: MuJoCo counts whole turns",
    "damper": "dampers are read back as viscous friction, to which they are added",
    "level": "levels of coulomb_friction are read back as dry friction, too",
    "others": "damper of joints that are written as others",
    "turned": "ball joints whose coordinates MuJoCo counts about other axes",
    "slides": "closures are joints with massless links, and a closure behind them",
    "rows": "closures left out, since they have no row",
    "axes": "axes in which hybridyn reports the wrenches of closures",
    "mimic": "names of couplings, which are read back with those of joints",
    "base": "the base floats, which URDF cannot say",
    "pose": "pose of the floating base in the home posture",
    "gravity": "gravity of ",
    "mass": "moving links without mass, which MuJoCo refuses: written with",
    "body": "names of massless links that only carry a joint or end a closure",
    "balls": "floating joints are three slides and a ball",
    "pins": "closures with an axis are connects of two points on it",
    "follow": "closures are a weld to a body of their own, which follows one link",
    "thin": "links without inertia about an axis, which MuJoCo refuses: written with a small one",
    "light": "links with inertia but without mass: written with",
    "large": "inertias that no body can have: principal moments are changed",
    "load": "which part of a link is an added body",
    "name": "names that SDF does not allow, or that two things have, are changed",
    "world": "names that MuJoCo keeps for itself: written with an underscore",
    "still": "mass and inertia of the world's link, which do not move",
}
#: What changes where such a line stands, for lines that are about numbers and not about the tree.
CHANGES = {
    "continuous": ["kind"], "endless": ["kind", "home"], "effort": ["effort_limit"],
    "point": ["link tool"], "equal": ["lower", "upper"], "crossed": ["crossed"], "speed": ["speed_limit"],
    "limit": ["lower", "upper", "speed_limit", "effort_limit"], "gear": ["rotor_inertia", "gear_ratio"],
    "forces": ["damping", "friction", "rotor_inertia", "gear_ratio"], "turns": [],
    "damper": ["damping", "effects"], "level": ["friction"],
    "axes": ["closures"], "mimic": ["names"], "base": ["base"], "pose": ["base"], "gravity": ["gravity"],
    "load": ["added bodies"],
}  # fmt: skip
#: What is lost of each feature in URDF, MJCF, SDF and USD.
TABLE = """
                                URDF        MJCF              SDF           USD
nothing                         kept        kept              kept          kept
revolute joint                  kept        kept              kept          kept
continuous joint                kept        continuous        kept          endless
prismatic joint                 kept        kept              kept          kept
spherical joint                 kept        kept              kept          kept
planar joint                    kept        planar            planar        planar
floating joint                  kept        balls             free          free
home of a revolute joint        kept        kept              kept          kept
home of a continuous joint      kept        continuous        kept          endless
home of a prismatic joint       kept        kept              kept          kept
home of a spherical joint       kept        kept              kept          kept
home of a planar joint          kept        planar            planar        planar
home of a floating joint        kept        balls             free          free
fixed joint                     kept        weld              kept          kept
lower limit                     kept        kept              kept          kept
upper limit                     kept        kept              kept          kept
limits of a slide               kept        kept              kept          kept
equal limits                    kept        equal             kept          kept
crossed limits                  crossed     crossed           crossed       crossed
speed limit                     kept        speed             kept          kept
speed limit of zero, none       kept        kept              kept          kept
effort limit                    kept        kept              kept          effort
effort limit of a motor         kept        kept              kept          kept
effort limit of zero, none      kept        kept              kept          kept
viscous friction                kept        kept              kept          kept
dry friction                    kept        kept              kept          kept
rotor                           kept        kept              kept          kept
geared rotor                    kept        gear              kept          kept
gear without rotor              kept        gear              kept          kept
viscous friction, spherical     kept        kept              forces        kept
viscous friction, planar        kept        planar            planar        planar+forces
viscous friction, floating      kept        balls             free+forces   free+forces
dry friction, spherical         kept        kept              forces        kept
dry friction, planar            kept        planar+forces     planar+forces planar+forces
dry friction, floating          kept        balls+forces      free+forces   free+forces
rotor, spherical                kept        kept              forces        kept
rotor, planar                   kept        planar+forces     planar+forces planar+forces
rotor, floating                 kept        balls+forces      free+forces   free+forces
gear, spherical                 kept        gear              forces        kept
gear, planar                    kept        planar+gear       planar+forces planar+forces
gear, floating                  kept        balls+gear        free+forces   free+forces
position limit, spherical       limit       limit             limit         limit
position limit, planar          limit       planar+limit      planar+limit  planar+limit
position limit, floating        limit       balls+limit       free+limit    free+limit
speed limit, spherical          limit       speed             limit         limit
speed limit, planar             kept        planar+speed      planar+limit  planar+limit
speed limit, floating           kept        balls+speed       free+limit    free+limit
effort limit, spherical         limit       limit             limit         limit
effort limit, planar            kept        planar+limit      planar+limit  planar+limit
effort limit, floating          kept        balls+limit       free+limit    free+limit
spring                          kept        kept              kept          kept
spring with a rest              kept        kept              kept          kept
spring away from home           kept        kept              kept          kept
spring of a slide               kept        kept              kept          kept
spring, continuous              kept        continuous+turns  kept          endless
damper                          kept        damper            kept          kept
damper over friction            kept        damper            kept          kept
coulomb level                   kept        level             kept          kept
coulomb width                   kept        kept              kept          kept
coulomb over friction           kept        level             kept          kept
stribeck friction               kept        kept              kept          kept
directed friction               kept        kept              kept          kept
load friction                   kept        kept              kept          kept
gear efficiency                 kept        kept              kept          kept
DC motor                        kept        kept              kept          kept
stop                            kept        kept              kept          kept
ground contact                  kept        kept              kept          kept
damper, spherical               kept        damper            kept          kept
damper, planar                  kept        planar+damper     planar        others+planar
damper, floating                kept        balls+damper      others+free   others+free
coulomb level, spherical        kept        level             kept          kept
polynomial spring               kept        kept              kept          kept
polynomial spring with a rest   kept        kept              kept          kept
polynomial damper               kept        kept              kept          kept
polynomial damper, spherical    kept        kept              kept          kept
ball spring                     kept        kept              kept          kept
ball spring with a rest         kept        kept              kept          kept
ball spring away from home      kept        kept              kept          kept
ball before a hinge             kept        mass              kept          kept
ball spring in other axes       kept        turned+body       kept          kept
tendons                         kept        kept              kept          kept
tendons with a width            kept        kept              kept          kept
tendons named as joints         kept        kept              name          other
gravity compensation            kept        kept              kept          kept
gravity compensation in a loop  kept        follow            home          kept
line springs                    kept        kept              kept          kept
line springs over pulleys       kept        kept              kept          kept
line springs with a width       kept        kept              kept          kept
line spring, massless link      kept        mass              kept          kept
lines named as links            kept        kept              name          other
line spring on the link "world" kept        world             name          kept
bushings                        kept        kept              kept          kept
bushing, massless link          kept        mass              kept          kept
payload                         kept        kept              kept          kept
payload on a renamed link       kept        kept              name          other
bent coupling                   kept        kept              kept          kept
bent coupling of two            kept        kept              kept          kept
bent coupling of its own        kept        kept              kept          kept
bent coupling, order six        kept        kept              kept          kept
closure fixed                   kept        kept              home          kept
closure revolute                kept        pins              home          kept
closure prismatic               kept        follow            home          kept
closure cylindrical             kept        follow            home+slides   kept
closure universal               kept        follow            home          slides
closure planar                  kept        follow            home+slides   kept
closure spherical               kept        kept              home          kept
closure rows_x                  kept        follow            home+slides   kept
closure rows_yz                 kept        follow            home+slides   kept
closure rows_y_perpendicular    kept        follow            home+slides   slides
closure rows_xz_parallel        kept        follow            home+slides   kept
closure rows_x_fixed            kept        follow            home+slides   kept
closure rows_parallel           kept        follow            home+slides   kept
closure rows_fixed              kept        follow            home+slides   kept
closure without a row           rows        rows              rows          rows
closure from the base           kept        pins              home          kept
closure to the base             kept        follow            home          slides
closure at a massless end       kept        follow+body       home          kept
massless end on the base        kept        follow+body       home          kept
author's axes, fixed            kept        kept              home          kept
author's axes, spherical        kept        kept              home          kept
author's axes, revolute         kept        pins              home          kept
author's axes, prismatic        kept        follow            home          kept
author's axes, universal        kept        follow            home          slides
author's axes, rows_xz_parallel kept        follow            home+slides   kept
oblique axes, revolute          kept        pins              home          axes
oblique axes, rows_x_fixed      axes        follow            home+slides   axes
mimic                           kept        kept              kept          kept
mimic with an offset            kept        kept              kept          kept
coupling with a name            mimic       kept              mimic         mimic
coupling of three               kept        kept              kept          kept
coupling of one                 kept        kept              kept          kept
coupling with a zero            kept        kept              kept          kept
limits in a loop                kept        kept              home          kept
spring in a loop                kept        kept              home          kept
mimic in a loop                 kept        kept              home          kept
endless gear                    kept        kept              kept          kept
floating base                   base        kept              kept          kept
home of a floating base         base+pose   kept              kept          kept
usual gravity                   kept        kept              kept          kept
other gravity                   gravity     kept              kept          kept
no gravity                      gravity     kept              kept          kept
no motor                        kept        kept              kept          kept
motors in another order         kept        kept              kept          kept
link without mass               kept        mass              kept          kept
link without mass that carries  kept        body              kept          kept
base without mass               kept        kept              kept          kept
point mass                      kept        thin              kept          point
inertia without mass            kept        light             kept          kept
inertia that no body has        kept        large             kept          kept
added body                      load        load              load          load
name with a colon               kept        kept              name          other
name with other letters         kept        kept              kept          other
link named as a joint           kept        kept              name          other
closure named as a joint        kept        pins              name+home     other
link named world                kept        world             name          kept
base named world                kept        still             still         kept
robot without a name            kept        kept              kept          kept
"""
ENDINGS = (".urdf", ".xml", ".sdf", ".usda")
#: Parts of the table, each of which takes less than a second.
PARTS = 8
CELLS = {
    (line[:32].strip(), ending): cell.split("+")
    for line in TABLE.splitlines()[2:]
    for ending, cell in zip(ENDINGS, line[32:].split(), strict=True)
}


def test_the_table_has_every_feature() -> None:
    assert {name for name, _ in CELLS} == FEATURES.keys()
    assert {word for cell in CELLS.values() for word in cell} == LINES.keys() | {"kept"}


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("part", range(PARTS))
def test_what_does_not_come_back_is_listed(ending: str, part: int, tmp_path: Path) -> None:
    for name in [*FEATURES][part::PARTS]:
        (folder := tmp_path / name.replace("/", "_")).mkdir()
        is_listed(name, ending, folder)


def is_listed(name: str, ending: str, folder: Path) -> None:
    """Compare a robot with what comes back of it, and what was lost with the losses that are listed."""
    element, before = FEATURES[name]
    after, out = read_back(before, folder / f"robot{ending}")
    words, losses = [*CELLS[name, ending]], [*out.losses]
    if words[0] == "home":  # then nothing else changes, if positions are counted so
        assert changed(before, after)
        assert losses[0] == f"{LINES[words.pop(0)]}: 'one', 'rail'"
        before = counted_from_home(before, Losses())
        losses, words = losses[1:], words or ["kept"]
    lost = changed(before, after, SINGLE if ending == ".usda" else SAME)
    if words == ["kept"]:
        assert (lost, losses) == ([], [])
        return
    assert lost or words == ["point"]  # whose inertia is below rounding
    listed = dict(zip(words, losses, strict=True))
    if all(word in CHANGES for word in words):
        assert {word.split(" of ")[0] for word in lost} <= {one for word in listed for one in CHANGES[word]}
    for word, line in listed.items():
        assert line.startswith(LINES[word])
        assert element in line.removeprefix(LINES[word])


def test_the_table_has_every_effect_that_a_file_states() -> None:
    stated = {name for _, robot in FEATURES.values() for name, _ in robot.effects}
    assert stated == {*EFFECTS}


def test_a_base_that_moves_as_prescribed_is_listed(tmp_path: Path) -> None:
    robot = hybridyn.load("five_bar", base="moving")
    line = "the base moves as prescribed: written as one at rest"
    assert line in hybridyn.convert(robot, tmp_path / "robot.urdf").losses
    assert line not in hybridyn.convert(robot, tmp_path / "robot.urdf", base="floating").losses
