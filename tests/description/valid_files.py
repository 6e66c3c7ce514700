"""Small valid files of every format, drawn from its grammar: what people write, and what programs write.

The bodies and joints of a file are drawn first: up to four bodies, each free, in the world or on another one,
some with a loop. The grammar then adds what the format has beside: forces, limits, motors, loops, couplings,
drawings, plugins.
"""

import random
from collections.abc import Callable
from typing import NamedTuple

from tests.description.fuzz_texts import FRAMES
from tests.description.grammar import Element, Grammar, el
from tests.robots.robot_texts import LOOP, robot

URDF = Grammar(
    """
robot: material* loop* loop_joint? constraint? coupling? transmission? gazebo* ros2_control?
    drake:ball_constraint? drake:linear_bushing_rpy? sensor? version=1.0?
link: inertial? visual* collision* type=arm?
origin: xyz=3? rpy=3?
inertial: origin? mass inertia
mass: value=+
inertia: ixx=+ ixy=0.01? ixz=0.02? iyy=+ iyz=0.03? izz=+
visual: origin? geometry material? name=id?
collision: origin? geometry name=id?
geometry: box
box: size=+3
material: name=id color?
color: rgba=+4
joint: origin? axis? dynamics? calibration? safety_controller? rotor_inertia? gear_ratio?
axis: xyz=u3
limit: lower=-1.7? upper=1.7? effort=+ velocity=+
dynamics: damping=+? friction=+? spring_stiffness=+? armature=+?
rotor_inertia: value=+
gear_ratio: value=+
calibration: rising=n?
safety_controller: k_velocity=+ k_position=+? soft_lower_limit=-0.9? soft_upper_limit=0.9?
mimic: joint=$joint:revolute|continuous|prismatic multiplier=n? offset=n?
loop: name=id type=revolute|prismatic|fixed|spherical|cylindrical|planar|point predecessor successor axis?
predecessor: link=$link origin?
successor: link=$link origin?
coupling/predecessor: link=$link
coupling/successor: link=$link
loop_joint: name=id type=revolute|continuous|spherical|fixed|prismatic link1 link2 axis? dynamics?
loop_joint/dynamics: damping=+ friction=+?
link1: link=$link xyz=3? rpy=3?
link2: link=$link xyz=3? rpy=3?
constraint: name=id type=revolute|spherical|fixed parent parent_origin? child child_origin?
constraint/parent: link=$link
constraint/child: link=$link
parent_origin: xyz=3 rpy=3?
child_origin: xyz=3 rpy=3?
coupling: name=id predecessor successor ratio
ratio: value=n
transmission: name=id type transmission/joint actuator
transmission/type: =transmission_interface/SimpleTransmission
transmission/joint: name=$joint:revolute|continuous|prismatic hardwareInterface?
hardwareInterface: =EffortJointInterface
actuator: name=id mechanicalReduction? hardwareInterface?
mechanicalReduction: =+
gazebo: reference=$joint provideFeedback? springStiffness? springReference? implicitSpringDamper?
provideFeedback: =true
implicitSpringDamper: =true
springStiffness: =+
springReference: =n
ros2_control: name=id type=system hardware ros2_control/joint*
hardware: plugin
hardware/plugin: =mock_components/GenericSystem
ros2_control/joint: name=$joint command_interface? state_interface?
command_interface: name=effort
state_interface: name=position
drake:ball_constraint: drake:ball_constraint_body_A drake:ball_constraint_body_B
    drake:ball_constraint_p_AP drake:ball_constraint_p_BQ
drake:ball_constraint_body_A: name=$link
drake:ball_constraint_body_B: name=$link
drake:ball_constraint_p_AP: value=3
drake:ball_constraint_p_BQ: value=3
drake:linear_bushing_rpy: drake:bushing_frameA drake:bushing_frameC drake:bushing_torque_stiffness
    drake:bushing_torque_damping drake:bushing_force_stiffness drake:bushing_force_damping
drake:bushing_frameA: name=$link
drake:bushing_frameC: name=$link
drake:bushing_torque_stiffness: value=+3
drake:bushing_torque_damping: value=+3
drake:bushing_force_stiffness: value=+3
drake:bushing_force_damping: value=+3
sensor: name=id type=camera update_rate=+
""".replace("transmission/joint actuator", "joint actuator").replace("ros2_control/joint*", "joint*")
)

SDF = Grammar(
    """
world: gravity? physics? light?
gravity: =3
physics: name=id type=ode max_step_size
max_step_size: =+
world/light: name=id type=point
model: frame* pose? self_collide? plugin? allow_auto_disable?
self_collide: =false
allow_auto_disable: =true
plugin: name=joint_state_publisher filename=libgazebo_ros_joint_state_publisher.so
frame: name=id attached_to=$link? pose?
pose: =6
link/pose: =6
frame/pose: =6
joint/pose: =6
link: pose? inertial? visual? collision? velocity_decay?
velocity_decay: linear? angular?
linear: =+
angular: =+
inertial: pose? mass? inertia?
mass: =+
inertia: ixx iyy izz ixy? ixz? iyz?
ixx: =+
iyy: =+
izz: =+
ixy: =0.01
ixz: =0.02
iyz: =0.03
visual: name=id pose? geometry
collision: name=id geometry
geometry: sphere
sphere: radius
radius: =+
joint: pose? joint/physics? sensor?
axis: xyz limit? dynamics?
axis2: xyz limit? dynamics?
xyz: =u3
limit: lower? upper? effort? velocity? stiffness? dissipation?
lower: =-0.7
upper: =0.7
effort: =+
velocity: =+
stiffness: =+
dissipation: =+
dynamics: damping? friction? spring_reference spring_stiffness
damping: =+
friction: =+
spring_reference: =n
spring_stiffness: =+
mimic: joint=$joint multiplier offset reference
multiplier: =n
offset: =n
reference: =n
sensor: name=id type=force_torque update_rate?
update_rate: =+
joint/physics: ode
ode: cfm_damping? provide_feedback?
cfm_damping: =true
provide_feedback: =true
""".replace("joint/physics? sensor", "physics? sensor")
)

MJCF = Grammar("""
mujoco: compiler? option? visual? statistic? custom? sensor? contact?
compiler: angle=radian|degree? balanceinertia=true?
option: timestep=+? gravity=3? integrator=RK4? density=+? viscosity=+? wind=3?
visual: headlight?
headlight: ambient=+3
statistic: extent=+
custom: numeric?
numeric: name=id data=3
sensor: jointpos?
jointpos: joint=$hinge
contact: exclude?
exclude: body1=$body body2=$body
body: pos=3? quat=u4? gravcomp=n? site? camera? light?
site: name=id pos=3? size=+?
camera: name=id pos=3?
light: pos=3?
inertial: pos=3 mass=+ diaginertia=+3 quat=u4?
geom: size=+3 type=box|ellipsoid? pos=3? mass=+? density=+? rgba=+4? friction=+3?
hinge: pos=3? axis=u3? range=-0.7,0.7? damping=+? stiffness=+? armature=+? frictionloss=+? ref=n?
    springref=n? actuatorfrcrange=-3,3? margin=+? solreflimit=+2? actuatorgravcomp=true?
slide: axis=u3? range=-0.7,0.7? damping=+? stiffness=+? armature=+? frictionloss=+? ref=n? springref=n?
ball: pos=3? damping=+? armature=+? stiffness=+? frictionloss=+? range=0,1?
connect: body1=$body body2=$body anchor=3 name=id?
weld: body1=$body body2=$body name=id? anchor=3? torquescale=+? relpose=7?
equality/joint: joint1=$hinge joint2=$hinge? polycoef=5?
motor: joint=$hinge gear=+? ctrlrange=-2,2? name=id? forcerange=-2,2? armature=+? damping=+?
position: joint=$hinge kp=+? ctrlrange=-2,2? forcerange=-2,2?
velocity: joint=$hinge kv=+?
key: name=id time=+?
""")

USD = Grammar("""
PhysicsScene: physics:gravityMagnitude=+? physics:gravityDirection=u3?
Xform: physics:mass=+ physics:centerOfMass=3 physics:diagonalInertia=+3 physics:principalAxes=u4?
    xformOp:translate=3? physics:velocity=3? Cube?
Cube: physics:collisionEnabled=true? size=+? xformOp:translate=3?
PhysicsRevoluteJoint: physics:localPos0=3? physics:localPos1=3? physics:localRot0=u4?
    physics:localRot1=u4? physics:axis=Y|Z? physics:lowerLimit=-70.5? physics:upperLimit=70.5?
    drive:angular:physics:maxForce=+? drive:angular:physics:stiffness=+? drive:angular:physics:damping=+?
    drive:angular:physics:targetPosition=n? physxJoint:armature=+? physxJoint:jointFriction=+?
    physxJoint:maxJointVelocity=+? state:angular:physics:position=n? mjc:frictionloss=+? newton:damping=+?
    physics:collisionEnabled=true?
PhysicsPrismaticJoint: physics:localPos0=3? physics:localPos1=3? physics:localRot0=u4? physics:axis=Y|Z?
    physics:lowerLimit=-0.7? physics:upperLimit=0.7? drive:linear:physics:maxForce=+?
    physxJoint:armature=+? state:linear:physics:position=n?
PhysicsSphericalJoint: physics:localPos0=3? physics:localPos1=3? physics:localRot0=u4?
    physics:coneAngle0Limit=40.5? physics:coneAngle1Limit=40.5?
PhysicsFixedJoint: physics:localPos0=3 physics:localPos1=3? physics:localRot1=u4?
""")


def _tree(draw: random.Random, kinds: str) -> list[tuple[str, str, str]]:
    """Return up to four bodies: the name, the body that it stands on ("" for the world), a kind of joint."""
    out: list[tuple[str, str, str]] = []
    for number in range(draw.randint(1, 4)):
        on = draw.choice(["", *(name for name, _, _ in out)])
        out.append((f"body{number}", on, draw.choice(kinds.split())))
    return out


def _two(draw: random.Random, names: list[str]) -> list[str]:
    return draw.sample(names, 2) if len(names) > 1 else []


def urdf(draw: random.Random) -> Element:
    """Draw a URDF."""
    root = el("robot", name="drawn")
    base = draw.choice(("base", "world"))
    root.children.append(el("link", name=base))
    for name, on, kind in _tree(draw, "revolute continuous prismatic fixed floating planar revolute"):
        joint = el("joint", name=f"{name}_joint", type=kind)
        joint.children += [el("parent", link=on or base), el("child", link=name)]
        if kind in ("revolute", "prismatic") or draw.random() < 0.1:
            joint.children.append(el("limit"))
        if kind == "planar":
            joint.children.append(el("axis", xyz="0 0 1"))
        if draw.random() < 0.15 and any(one.tag == "joint" for one in root.children):
            joint.children.append(el("mimic"))
        root.children += [el("link", name=name), joint]
    return URDF.fill(root, root, draw, 0.15)


def sdf(draw: random.Random) -> Element:
    """Draw an SDF, some with a world, some with loops."""
    version = draw.choice(("1.6", "1.7", "1.9", "1.11"))
    model = el("model", name="drawn")
    root = el("sdf", model, version=version)
    if draw.random() < 0.3:
        root.children = [el("world", model, name="w")]
    kinds = "revolute prismatic fixed ball universal continuous free revolute2 screw"
    names = list[str]()
    for name, on, kind in _tree(draw, kinds):
        model.children.append(el("link", name=name))
        names.append(name)
        if kind != "free":
            model.children.append(_sdf_joint(f"{name}_joint", kind, on or "world", name, draw))
    if draw.random() < 0.3 and (ends := _two(draw, names)):
        kind = draw.choice(("revolute", "ball", "fixed", "prismatic", "universal"))
        model.children.append(_sdf_joint("loop", kind, *ends, draw))
    return SDF.fill(root, root, draw, 0.25)


def _sdf_joint(name: str, kind: str, parent: str, child: str, draw: random.Random) -> Element:
    joint = el("joint", el("parent", text=parent), el("child", text=child), name=name, type=kind)
    axes = {"universal": 2, "revolute2": 2, "ball": 0, "fixed": 0}.get(kind, 1)
    joint.children += [el(tag) for tag in ("axis", "axis2")[:axes]]
    if axes == 2:
        joint.children[-2].children.append(el("xyz", text="1 0 0"))
        joint.children[-1].children.append(el("xyz", text="0 1 0"))
    if kind == "screw":
        joint.children.append(el(draw.choice(("thread_pitch", "screw_thread_pitch")), text="0.3"))
    return joint


def mjcf(draw: random.Random) -> Element:
    """Draw an MJCF."""
    world = el("worldbody")
    bodies, joints = {"": world}, list[str]()
    for name, on, kind in _tree(draw, "hinge slide ball fixed hinge two free"):
        on = "" if kind == "free" else on
        body = bodies[name] = el("body", name=name)
        if kind == "free":
            body.children.append(el("freejoint"))
        elif kind != "fixed":
            for number, one in enumerate(("hinge", "slide") if kind == "two" else (kind,)):
                body.children.append(el(one, name=f"{name}_{number}"))
                joints += [f"{name}_{number}"] * (one != "ball")
        body.children.append(el(draw.choice(("geom", "inertial"))))
        bodies[on].children.append(body)
    root = el("mujoco", world, model="drawn")
    if len(bodies) > 2 and draw.random() < 0.4:
        root.children.append(el("equality", el(draw.choice(("connect", "weld")))))
    if len(joints) > 1 and draw.random() < 0.2:
        root.children.append(el("equality", el("joint")))
    if joints and draw.random() < 0.5:
        root.children.append(el("actuator", el(draw.choice(("motor", "position", "velocity", "motor")))))
    MJCF.fill(root, root, draw, 0.2)
    for one in [*root.below()]:  # the grammar tells the kinds of joints apart by their names
        if one.tag in ("hinge", "slide", "ball"):
            one.attributes["type"], one.tag = one.tag, "joint"
    for name, body in bodies.items():
        if name and not any("gravcomp" in one.attributes for one in body.below()):
            for one in body.below():  # it is an attribute of joints that carry such bodies
                one.attributes.pop("actuatorgravcomp", "")
    return root


def usd(draw: random.Random) -> Element:
    """Draw a USD; `usda` writes it."""
    root, names = Element("Xform", {"name": "robot"}), list[str]()
    kinds = "Revolute Prismatic Spherical Fixed free Revolute"
    for name, on, kind in _tree(draw, kinds):
        root.children.append(el("Xform", name=name))
        names.append(name)
        if kind != "free":
            root.children.append(_usd_joint(f"{name}_joint", kind, on, name))
    if draw.random() < 0.3 and (ends := _two(draw, names)):
        loop = _usd_joint("loop", draw.choice(("Revolute", "Spherical", "Fixed")), *ends)
        loop.attributes["physics:excludeFromArticulation"] = "true"
        root.children.append(loop)
    if draw.random() < 0.3:
        root.children.append(el("PhysicsScene", name="scene"))
    for child in root.children:
        USD.fill(child, root, draw, 0.25)
    return root


def _usd_joint(name: str, kind: str, first: str, second: str) -> Element:
    ends = {"physics:body0": first, "physics:body1": second}
    return Element(f"Physics{kind}Joint", {"name": name} | {key: end for key, end in ends.items() if end})


#: Types of attributes of USD by the end of their names, and how a value is written.
TYPES = {
    ":body0": ("rel", "</robot/{}>"), ":body1": ("rel", "</robot/{}>"), ":axis": ("uniform token", '"{}"'),
    ":centerOfMass": ("point3f", "({})"), ":diagonalInertia": ("float3", "({})"),
    ":principalAxes": ("quatf", "({})"), ":translate": ("double3", "({})"),
    ":velocity": ("vector3f", "({})"), ":gravityDirection": ("vector3f", "({})"),
    ":localPos0": ("point3f", "({})"), ":localPos1": ("point3f", "({})"), ":localRot0": ("quatf", "({})"),
    ":localRot1": ("quatf", "({})"), ":collisionEnabled": ("bool", "{}"), "size": ("double", "{}"),
    ":excludeFromArticulation": ("bool", "{}"),
}  # fmt: skip
#: Schemas that attributes need, by the beginning of their names.
SCHEMAS = {
    "physics:mass": "PhysicsMassAPI", "physics:centerOfMass": "PhysicsMassAPI",
    "physics:diagonalInertia": "PhysicsMassAPI", "physics:principalAxes": "PhysicsMassAPI",
    "drive:angular": "PhysicsDriveAPI:angular", "drive:linear": "PhysicsDriveAPI:linear",
    "state:angular": "PhysicsJointStateAPI:angular", "state:linear": "PhysicsJointStateAPI:linear",
    "physxJoint:": "PhysxJointAPI", "mjc:": "MjcJointAPI", "newton:": "NewtonJointAPI",
}  # fmt: skip


def usda(root: Element) -> str:
    """Return the text of a USD."""
    head = '#usda 1.0\n(\n defaultPrim = "robot"\n metersPerUnit = 1\n upAxis = "Z"\n)\n'
    return head + _prim(root, top=True)


def _prim(prim: Element, *, top: bool = False) -> str:
    schemas = dict.fromkeys(
        schema for name in prim.attributes for start, schema in SCHEMAS.items() if name.startswith(start)
    )
    if prim.tag == "Xform" and not top:
        schemas = {"PhysicsRigidBodyAPI": None} | schemas
    if prim.tag == "Cube":
        schemas = {"PhysicsCollisionAPI": None}
    applied = ", ".join(f'"{schema}"' for schema in schemas)
    lines = [f'def {prim.tag} "{prim.attributes.get("name", "shape")}"']
    lines += [f"(prepend apiSchemas = [{applied}])"] * bool(schemas) + ["{"]
    for name, value in prim.attributes.items():
        if name == "name":
            continue
        kind, form = next((two for end, two in TYPES.items() if name.endswith(end)), ("float", "{}"))
        lines.append(f"{kind} {name} = {form.format(value.replace(' ', ', '))}")
    if "xformOp:translate" in prim.attributes:
        lines.append('uniform token[] xformOpOrder = ["xformOp:translate"]')
    return "\n".join([*lines, *map(_prim, prim.children), "}"]) + "\n"


#: A five-bar with a loop, for the files beside it.
BESIDE = robot(LOOP, FRAMES)
JOINTS = ("drive", "elbow", "swing")


def model_toml(draw: random.Random) -> Element:
    """Draw a model.toml beside `BESIDE`; its tables are the elements, its keys the attributes."""
    root = el("", motors=f'["{draw.choice(JOINTS)}"]')

    def by_joint() -> str:
        found = draw.sample(JOINTS, draw.randint(1, 3))
        return "{ " + ", ".join(f"{name} = {draw.uniform(0.1, 2):.3f}" for name in found) + " }"

    def number() -> str:  # of more digits than those of the robot, none of which it may repeat
        return f"{draw.uniform(0.1, 2):.4f}7"

    point = "[0.1, 0.2, 0.3]"
    tables = {
        "home": {"drive": number(), "swing": number()},
        "joints.drive": {
            "rotor_inertia": number(), "gear_ratio": number(), "damping": number(), "friction": number(),
        },
        "couplings.belt": {"terms": "{ drive = 1.5, swing = -1.0 }", "offset": number()},
        "closures": {"pin": draw.choice(('"spherical"', '"fixed"'))},
        "effects.coulomb_friction": {"level": by_joint(), "width": number()},
        "effects.spring": {"stiffness": by_joint()},
        "effects.damper": {"coefficient": by_joint()},
        "effects.stop": {
            "stiffness": "{ drive = 3.0 }", "damping": number(), "lower": "{ drive = -1.0 }",
            "upper": "{ drive = 1.5 }",
        },
        "effects.ground_contact": {
            "points": "{ rocker = [[0.1, 0.2, 0.3]] }", "stiffness": number(), "damping": number(),
            "friction": number(), "width": number(), "height": number(),
        },
        "effects.payload": {"link": '"rocker"', "mass": number(), "com": point},
    }  # fmt: skip
    for name, keys in tables.items():
        if draw.random() < 0.4:
            root.children.append(Element(name, keys))
    return root


def toml(root: Element) -> str:
    """Return the text of a model.toml."""
    keys = "".join(f"{name} = {value}\n" for name, value in root.attributes.items())
    return keys + "".join(f"[{table.tag}]\n{toml(table)}" for table in root.children)


def robot_yaml(draw: random.Random) -> Element:
    """Draw a robot.yaml beside `BESIDE`."""
    root, motor, ball = el("", closed_loop="[[end_a, end_b]]"), *draw.sample(JOINTS, 2)
    if draw.random() < 0.7:
        root.attributes["type"] = draw.choice(("['6d']", "['3d']"))
    if draw.random() < 0.7:
        root.attributes["name_mot"] = f"[{motor}]"
    if draw.random() < 0.5:
        root.attributes["joint_name"] = f"[{ball}]"
        root.attributes["joint_type"] = f"[{draw.choice(('SPHERICAL', 'UJOINT_XY', 'UJOINT_ZY'))}]"
    return root


def yaml(root: Element) -> str:
    """Return the text of a robot.yaml."""
    return "".join(f"{name}: {value}\n" for name, value in root.attributes.items())


class Format(NamedTuple):
    """A format of which files are drawn.

    Attributes:
        ending: The ending of its files.
        drawn: Draws one.
        text: Writes it.
        beside: Text of the robot beside which it stands, "" for a robot.
    """

    ending: str
    drawn: Callable[[random.Random], Element]
    text: Callable[[Element], str] = Element.xml
    beside: str = ""


FORMATS = {
    "urdf": Format(".urdf", urdf),
    "sdf": Format(".sdf", sdf),
    "mjcf": Format(".xml", mjcf),
    "usd": Format(".usda", usd, usda),
    "model.toml": Format(".model.toml", model_toml, toml, BESIDE),
    "robot.yaml": Format(".yaml", robot_yaml, yaml, BESIDE),
}
