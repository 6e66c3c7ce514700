"""Springs, dampers, friction, tendons and compensated weights of MJCF files, against MuJoCo's own forces."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description import read
from hybridyn.effects.joints import WIDTH
from tests.conversion.judge import read_back
from tests.description.reading import refused
from tests.judges.mujoco_matrices import mass_matrix
from tests.robots.effect_cases import rate_of
from tests.support.comparing import close_to
from tests.support.engines import engine_of, written_agrees
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow

mujoco = needs("mjcf")

#: Accelerations through two chains of products of doubles, at springs of 1e3 N/m.
AGAINST_MUJOCO = 1e-9
SAME = 1e-10
#: Central differences over STEP.
STEP, DIFFERENCED = 1e-6, 1e-6
#: Rounding of a difference of energies over 1e-3 s, of the power lost.
BALANCE = 1e-7

BAR = '<inertial pos="{} .02 .03" mass="{}" diaginertia=".1 .2 .25"/>'
TEXT = f"""<mujoco model="springs">
<compiler angle="radian"/><option gravity="0 0 -9.81"/>
<worldbody><site name="wall" pos=".3 .2 1"/>
<body name="a" GRAVCOMP_A pos=".1 .2 .3"><joint name="j" axis="0 1 0" HINGE/>{BAR.format(0.1, 2)}
 <site name="sa" pos=".1 0 .2"/>
 <body name="b" pos="1 0 0" quat=".9 .1 .2 .3" GRAVCOMP_B><joint name="k" type="ball" BALL/>
  {BAR.format(0.2, 1.5)}
  <site name="sb" pos=".3 .1 .2"/>
  <body name="slider" pos="0 0 .5"><joint name="s" type="slide" axis="1 0 1"/>{BAR.format(-0.1, 1)}
   <site name="ss" pos=".1 0 0"/></body></body></body>
<body name="c" quat=".8 .6 0 0" pos="1 2 3"><joint name="f" type="free" FREE/>{BAR.format(0.1, 1)}
 <site name="sc" pos=".1 .1 0"/></body></worldbody>
<tendon>TENDONS</tendon></mujoco>"""

#: Attributes of each place in the text, by what they state.
FORMS: dict[str, dict[str, str]] = {
    "none": {},
    "hinge spring": {"HINGE": 'stiffness="9" springref=".2"'},
    "hinge polynomials": {"HINGE": 'stiffness="1 10 100" damping="1 10 100" springref=".2"'},
    "falling stiffness": {"HINGE": 'stiffness="9 -3 .4"'},
    "ball friction": {"BALL": 'frictionloss=".4"'},
    "ball spring": {"BALL": 'stiffness="7" damping="2"'},
    "ball damping": {"BALL": 'damping="1 10 100"'},
    "free friction": {"FREE": 'frictionloss=".3"'},
    "free spring": {"FREE": 'stiffness="5" damping=".2"'},
    "free damping": {"FREE": 'damping="1 10 100"'},
    "gravcomp": {"GRAVCOMP_A": 'gravcomp=".6"', "GRAVCOMP_B": 'gravcomp="1"'},
    "lighter than air": {"GRAVCOMP_B": 'gravcomp="1.5"'},
    "fixed tendon": {
        "TENDONS": '<fixed name="t" stiffness="10" damping="3" springlength="-.1 .1" frictionloss=".5">'
        '<joint joint="s" coef="1.3"/><joint joint="j" coef="-.7"/></fixed>'
    },
    "two fixed tendons": {
        "TENDONS": '<fixed stiffness="10"><joint joint="s" coef="1.3"/></fixed>'
        '<fixed name="u" stiffness="4" springlength=".2"><joint joint="s" coef="2"/>'
        '<joint joint="j" coef="3"/></fixed>'
    },
    "a rope": {
        "TENDONS": '<spatial name="r" stiffness="50" springlength="0 .8"><site site="sa"/><site site="ss"/>'
        "</spatial>"
    },
    "a rope over the wall": {
        "TENDONS": '<spatial name="w" stiffness="20" damping=".5" frictionloss=".2" springlength=".3">'
        '<site site="sa"/><site site="wall"/><site site="sc"/><site site="sb"/></spatial>'
    },
    "a spring at its first length": {
        "TENDONS": '<spatial name="w" stiffness="80"><site site="wall"/><site site="sb"/></spatial>'
    },
}
FORMS["joints"] = {
    "HINGE": 'stiffness="1 10 100" damping="1 10" springref=".2" frictionloss=".1"',
    "BALL": 'stiffness="7" damping="1 1" frictionloss=".4"',
    "FREE": 'stiffness="5" frictionloss=".1"',
    "TENDONS": FORMS["fixed tendon"]["TENDONS"],
}
PULLEYS = '<spatial name="p" stiffness="30" damping="2" frictionloss=".3" springlength=".2">{}</spatial>'
for form, path in {
    "a pulley": "sa wall /2 sb ss",
    "two pulleys": "sa sb ss /3 ss wall /.5 sb wall",
    "a pulley first": "/4 sa sb",
}.items():
    parts = (f'<pulley divisor="{x[1:]}"/>' if x[0] == "/" else f'<site site="{x}"/>' for x in path.split())
    FORMS[form] = {"TENDONS": PULLEYS.format("".join(parts))}
FORMS["all"] = FORMS["joints"] | FORMS["gravcomp"]
FORMS["all"]["TENDONS"] += FORMS["a rope"]["TENDONS"] + FORMS["a rope over the wall"]["TENDONS"]


#: MuJoCo 3 takes one number for stiffness and damping.
BENT = "jnt_stiffnesspoly" in dir(mujoco.MjModel)
bent = pytest.mark.skipif(not BENT, reason="this MuJoCo has no polynomial springs and dampers")
if not BENT:
    several = re.compile(r'(stiffness|damping)="\S+ ')
    FORMS = {name: form for name, form in FORMS.items() if not any(map(several.search, form.values()))}


def text_of(form: dict[str, str]) -> str:
    """Return the file with the attributes of a form."""
    out = TEXT
    for place in ("HINGE", "BALL", "FREE", "GRAVCOMP_A", "GRAVCOMP_B", "TENDONS"):
        out = out.replace(place, form.get(place, ""))
    return out.replace("<tendon></tendon>", "")


class Mujoco:
    """MuJoCo's model of the file, and its coordinates as those of a robot that is read from it."""

    def __init__(self, file: Path) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(file))
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(self.model)

    def state(self, draw: np.random.Generator, robot: hybridyn.HybridRobot) -> tuple[np.ndarray, np.ndarray]:
        """Set a random state, and return it as q and v of a robot."""
        m, d = self.model, self.data
        d.qpos[:], d.qvel[:] = draw.uniform(-1, 1, m.nq), draw.uniform(-0.05, 0.05, m.nv)
        mujoco.mj_normalizeQuat(m, d.qpos)
        mujoco.mj_forward(m, d)
        q, v = robot.home.copy(), np.zeros(robot.nv)
        for name, kind, at_q, at_v in zip(
            robot.joints, robot.kinds, robot.q_slices, robot.v_slices, strict=True
        ):
            from_q, from_v = self.where(name)
            turn = kind in ("spherical", "floating")
            x = d.qpos[from_q : from_q + at_q.stop - at_q.start]
            q[at_q] = np.r_[x[:-4], x[-3:], x[-4]] if turn else x
            rates = d.qvel[from_v : from_v + at_v.stop - at_v.start].copy()
            if kind == "floating":
                rates[:3] = self.data.body("c").xmat.reshape(3, 3).T @ rates[:3]
            v[at_v] = rates
        return q, v

    def where(self, name: str) -> tuple[int, int]:
        """Return the first coordinates of a joint in qpos and qvel; slides and a ball stand for `f`."""
        stem, _, part = name.partition("_")
        joint = self.model.joint(stem)
        shift = {"": 0, "x": 0, "y": 1, "z": 2, "turn": 3}[part]
        return joint.qposadr[0] + shift, joint.dofadr[0] + shift

    def acceleration(self) -> np.ndarray:
        """Compute the accelerations by MuJoCo's passive forces, and its dry friction, which is smoothed."""
        m, d = self.model, self.data
        force = d.qfrc_passive - d.qfrc_bias
        kinds = mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF, mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON
        rows = np.isin(d.efc_type, [int(kind) for kind in kinds])
        J = d.efc_J.reshape(-1, m.nv)[rows]
        force = force - J.T @ (d.efc_frictionloss[rows] * np.tanh(J @ d.qvel / WIDTH))
        return np.linalg.solve(mass_matrix(m, d), force)


def ours(robot: hybridyn.HybridRobot, judge: Mujoco, a: np.ndarray) -> np.ndarray:
    """Return MuJoCo's accelerations in the order of a robot's."""
    out = np.zeros(robot.nv)
    for name, at in zip(robot.joints, robot.v_slices, strict=True):
        start = judge.where(name)[1]
        out[at] = a[start : start + at.stop - at.start]
    return out


@pytest.mark.parametrize("name", FORMS)
def test_forces_are_those_of_mujoco(name: str, tmp_path: Path) -> None:
    file = save(tmp_path, text_of(FORMS[name]), "robot.xml")
    robot, judge, draw = hybridyn.load(file, motors=()), Mujoco(file), np.random.default_rng(3)
    for _ in range(3):
        q, v = judge.state(draw, robot)
        own = hybridyn.ddm(robot, q, v, np.zeros(0), effects="model")
        theirs = ours(robot, judge, judge.acceleration())
        turning = [at.start for at, k in zip(robot.v_slices, robot.kinds, strict=True) if k == "floating"]
        kept = np.ones(robot.nv, dtype=bool)
        for start in turning:
            kept[start : start + 3] = False  # MuJoCo's linear rates are along other axes
        close_to(own[kept], theirs[kept], AGAINST_MUJOCO)


@pytest.mark.parametrize("name", FORMS)
def test_forces_are_written_out(name: str, tmp_path: Path) -> None:
    file = save(tmp_path, text_of(FORMS[name]), "robot.xml")
    written_agrees(hybridyn.load(file, motors=["j", "s"]), effects="model")


@bent
@pytest.mark.slow
def test_forces_are_compiled(tmp_path: Path) -> None:
    robot = hybridyn.load(save(tmp_path, text_of(FORMS["all"]), "robot.xml"), motors=["j", "s"])
    compiled, general = (engine_of(name, robot, "model") for name in ("compiled", "general"))
    draw = np.random.default_rng(5)
    q = np.array([pin.integrate(robot.model, robot.home, draw.normal(size=robot.nv)) for _ in range(4)])
    v, tau = draw.normal(size=(4, robot.nv)), draw.normal(size=(4, 2))
    close_to(compiled.ddm(q, v, tau), general.ddm(q, v, tau), SAME)


@bent
@pytest.mark.slow
def test_forces_of_joints_have_derivatives(tmp_path: Path) -> None:
    robot = hybridyn.load(save(tmp_path, text_of(FORMS["joints"]), "robot.xml"), motors=["j", "s"])
    general, draw = engine_of("general", robot, "model"), np.random.default_rng(5)
    q = pin.integrate(robot.model, robot.home, draw.normal(size=robot.nv))[None]
    v, tau = draw.normal(size=(1, robot.nv)), draw.normal(size=(1, 2))
    jacobian = hybridyn.ddm_jacobian(robot, q[0], v[0], tau[0], effects="model")
    for k, step in enumerate(np.eye(robot.nv)):
        ends = [
            (general.ddm(pin.integrate(robot.model, q[0], h * step), v[0], tau[0]),
             general.ddm(q[0], v[0] + h * step, tau[0]))
            for h in (STEP, -STEP)
        ]  # fmt: skip
        for what, ahead, behind in zip("qv", *ends, strict=True):
            wanted = (ahead - behind) / (2 * STEP)
            assert np.abs(jacobian[what][:, k] - wanted).max() < DIFFERENCED * max(1.0, np.abs(wanted).max())


@bent
def test_energy_balances(tmp_path: Path) -> None:
    """What the springs store and the dampers lose is what the motion loses."""
    robot = hybridyn.load(save(tmp_path, text_of(FORMS["all"]), "robot.xml"), motors=())
    draw = np.random.default_rng(6)
    q, v = (
        pin.integrate(robot.model, robot.home, draw.normal(size=robot.nv))[None],
        draw.normal(size=(1, robot.nv)),
    )
    none = np.zeros((1, 0))
    a = hybridyn.ddm(robot, q, v, none, effects="model")
    supplied = hybridyn.power(robot, q, v, none, effects="model")
    gained = rate_of(robot, lambda q, v: hybridyn.energy(robot, q, v, effects="model").total, q, v, a)
    assert supplied.lost[0] > 0
    assert abs(gained + supplied.lost)[0] < BALANCE * supplied.lost[0]


def test_a_weight_that_motors_compensate_is_noted(tmp_path: Path) -> None:
    text = text_of(FORMS["gravcomp"]).replace('axis="0 1 0"', 'axis="0 1 0" actuatorgravcomp="true"')
    refused(
        save(tmp_path, text, "robot.xml"), "body 'b': its gravcomp acts through the actuators of some joints"
    )
    alone = text.replace('gravcomp="1"', "")
    description = read(save(tmp_path, alone, "robot.xml"))
    assert not description.effects
    assert any("gravcomp of bodies 'a'" in note for note in description.notes)


WRAPPED = '<spatial stiffness="3"><site site="sa"/><geom geom="g"/><site site="sb"/></spatial>'
REFUSED = {
    "wraps around geoms": WRAPPED,
    "armature along a spatial tendon": '<spatial armature="3"><site site="sa"/><site site="sb"/></spatial>',
    "depends on a tendon's length": '<fixed stiffness="3 1"><joint joint="j" coef="1"/></fixed>',
    "depends on a tendon's speed": '<fixed damping="3 1"><joint joint="j" coef="1"/></fixed>',
}


@bent
@pytest.mark.parametrize("words", REFUSED)
def test_forces_along_tendons_that_are_not_read(words: str, tmp_path: Path) -> None:
    geom = '<site name="sa" pos=".1 0 .2"/><geom name="g" type="sphere" size=".01"/>'
    text = text_of({"TENDONS": REFUSED[words]}).replace('<site name="sa" pos=".1 0 .2"/>', geom)
    refused(save(tmp_path, text, "robot.xml"), words)


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize("ending", [".xml", slow(".urdf"), slow(".sdf"), slow(".usda")])
def test_forces_come_back(name: str, ending: str, tmp_path: Path) -> None:
    description = read(save(tmp_path, text_of(FORMS[name]), "robot.xml"))
    other, _ = read_back(description, tmp_path / f"other{ending}")
    assert dict(other.effects) == dict(description.effects)
