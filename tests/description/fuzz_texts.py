"""Robots in every format that hold much of what their readers know, for tests that break them."""

from tests.description.sdf_texts import WORLD, joint, link, sdf
from tests.description.usd_texts import DRIVE, KINDS, at, body, prim
from tests.description.usd_texts import joint as usd_joint
from tests.robots.mjcf_texts import BAR, mjcf
from tests.robots.robot_texts import LOOP, robot

FRAMES = (
    '<link name="end_a"/><joint name="end_a_frame" type="fixed">'
    '<parent link="coupler"/><child link="end_a"/></joint>\n'
    '<link name="end_b"/><joint name="end_b_frame" type="fixed">'
    '<parent link="rocker"/><child link="end_b"/></joint>\n'
)
URDF = robot(
    LOOP,
    FRAMES,
    '<loop name="u" type="universal"><predecessor link="coupler"><origin xyz="1 2 3"/></predecessor>'
    '<successor link="end_b"/><axis xyz="1 0 0"/><axis2 xyz="0 1 0"/></loop>',
    '<loop name="r" type="rows" rows="tx ty rx ry">'
    '<predecessor link="crank"/><successor link="end_b"/></loop>',
    '<loop_joint name="lj" type="spherical"><link1 link="crank" xyz="0 0 0" rpy="0 0 0"/>'
    '<link2 link="rocker" xyz="0 0 0" rpy="0 0 0"/></loop_joint>',
    '<coupling name="gear"><predecessor link="coupler"/><successor link="rocker"/>'
    '<ratio value="-2"/></coupling>',
    '<link name="tip"/><joint name="tip_joint" type="prismatic"><parent link="rocker"/><child link="tip"/>'
    '<mimic joint="drive" multiplier="0.5" offset="0.1"/></joint>',
    '<transmission name="t"><joint name="drive"/><actuator name="m">'
    "<mechanicalReduction>50</mechanicalReduction></actuator></transmission>",
    '<gazebo reference="drive"><provideFeedback>true</provideFeedback></gazebo>',
)
MATES = "".join(
    f'<link name="closing_tip_{end}"/><joint name="closing_tip_{end}_frame" type="fixed">'
    f'<parent link="{link}"/><child link="closing_tip_{end}"/><origin xyz="1 0 {z}"/></joint>\n'
    for end, link, z in (
        ("1", "coupler", 0),
        ("2", "rocker", 0),
        ("1_z", "coupler", 0.1),
        ("2_z", "rocker", 0.1),
    )
)
DIALECTS = robot(
    MATES,
    '<gazebo><joint name="E" type="revolute"><parent>coupler</parent><child>rocker</child>'
    '<pose relative_to="crank">1 0 0 0 0.1 0</pose><axis><xyz expressed_in="__model__">0 0 1</xyz></axis>'
    "</joint></gazebo>",
)
SUBMECHANISMS = """submechanisms:
- type: NUMERICAL
  jointnames_active: [drive]
  jointnames_spanningtree: [drive, elbow, swing]
  loop_constraints:
  - cut_joint: elbow
    predecessor_body: coupler
    successor_body: rocker
    constraint_axes: [{axis: [0., 0., 0., 1., 0., 0.]}, {axis: [0, 0, 0, 0, 1, 0]}]
"""
HINGES = """closures:
- axis: [0.0, 0.0, 1.0]
  link_a: coupler
  link_b: rocker
  point: [1.9, 0.4, 0.0]
independent: [drive]
"""
BALLS = """ball_loops:
- name: pin
  parent: coupler
  child: rocker
  parent_xyz: [1.5, 0.0, 0.0]
  child_xyz: [1.0, 0.0, 0.0]
ball_upgrades: [elbow]
actuated_joints: [drive]
"""
SIDE_CAR = """closed_loop: [[end_a, end_b]]
type: ['6d']
name_mot: [drive]
joint_name: [swing]
joint_type: [SPHERICAL]
"""
MODEL = """motors = ["drive"]
[home]
drive = 0.5
elbow = [0.6, 0.8]
[joints.drive]
rotor_inertia = 3e-5
gear_ratio = 100.0
"""
XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="n" default="2"/><xacro:property name="length" value="${0.5 * 2}"/>
<link name="ground"/>
<xacro:macro name="bar" params="name parent x:=0">
  <link name="${name}"/>
  <joint name="${name}_joint" type="continuous"><origin xyz="${x} 0 0"/><parent link="${parent}"/>
    <child link="${name}"/><axis xyz="0 0 1"/></joint>
</xacro:macro>
<xacro:bar name="crank" parent="ground"/>
<xacro:bar name="coupler" parent="crank" x="${length}"/>
<xacro:bar name="rocker" parent="ground" x="1.5"/>
<xacro:if value="$(arg n)"><loop name="pin" type="revolute"><predecessor link="coupler"/>
<successor link="rocker"><origin xyz="${length} 0 0"/></successor><axis xyz="0 0 1"/></loop></xacro:if>
</robot>
"""

BODY = BAR.format(x=0.1, m=1)
HEAD = """<compiler angle="degree" eulerseq="XYZ" autolimits="true"/>
<option gravity="0 0 -9.81"><flag contact="disable"/></option>
<default><joint damping="0.1"/>
<default class="strong"><joint armature="0.02" axis="0 1 0"/></default></default>
<asset><mesh name="part" file="part.obj" scale="0.1 0.1 0.1"/>
<texture name="t" builtin="flat" width="8" height="8"/></asset>"""
BODIES = f"""<include file="scene.xml"/>
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
MJCF = mjcf(
    '<tendon><fixed name="t1"><joint joint="a2" coef="2"/><joint joint="b1" coef="-0.5"/></fixed></tendon>',
    EQUALITY,
    '<actuator><motor joint="a1" gear="50" ctrlrange="-1 1"/><position joint="c1" kp="10"/></actuator>',
    '<keyframe><key name="home" qpos="0.1 0 0.2 0.3 1 0 0 0 1 0 0 0"/></keyframe>',
    '<sensor><jointpos joint="a1"/></sensor>',
    world=BODIES,
    head=HEAD,
)
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
SCENE = '<mujocoinclude><geom type="plane" size="1 1 1"/><camera name="eye"/></mujocoinclude>'

AXIS = (
    '<axis><xyz expressed_in="__model__">0 1 0</xyz><limit><lower>-1</lower><upper>2.5</upper>'
    "<effort>7</effort><velocity>3</velocity></limit><dynamics><damping>0.1</damping><friction>0.2</friction><spring_stiffness>5"
    "</spring_stiffness><spring_reference>0.3</spring_reference></dynamics>{}</axis>"
)
OLD_AXIS = AXIS.replace(' expressed_in="__model__"', "").format("")
MIMIC = '<mimic joint="turn" axis="axis"><multiplier>2</multiplier><offset>0.1</offset></mimic>'
ARM = sdf(link("arm"), '<frame name="tip"><pose>0.3 0 0 0 0 0.5</pose></frame>', name="part")
LINKS = [
    link("base"), WORLD,
    link("a", '<pose degrees="true">0.1 0 0.2 10 20 30</pose><visual name="v"><geometry/></visual>'),
    link("b", '<pose relative_to="a">0.4 0 0 0 0 0</pose>'),
    link("c", '<pose relative_to="tilted">0 0.3 0 0 0 0</pose>', x=0.2, m=2),
    link("d", '<pose rotation_format="quat_xyzw">0.5 0.2 0.1 0 0 0.6 0.8</pose>', m=0.5),
    '<frame name="tilted" attached_to="a"><pose>0 0 0.1 0 0.2 0</pose></frame>',
    joint("turn", "revolute", "base", "a", AXIS.format(""), axis=""),
    joint("slide", "prismatic", "a", "b", AXIS.format(""), "<pose>0.1 0 0 0 0 0</pose>", axis=""),
    joint("cross", "universal", "tilted", "c", "<axis2><xyz>1 0 0</xyz></axis2>", axis="0 1 0"),
    joint("follow", "continuous", "base", "d", AXIS.format(MIMIC), axis=""),
    joint("loop", "ball", "b", "d", axis=""),
    '<include><uri>part.sdf</uri><name>hand</name><pose relative_to="b">0.1 0 0 0 0 0</pose></include>',
    joint("wrist", "universal", "b", "hand::tip", "<axis2><xyz>0 1 0</xyz></axis2>"),
    '<model name="tool"><pose>1 0 0 0 0 0</pose>' + link("bit") + "</model>",
    joint("grip", "fixed", "hand::arm", "tool::bit", axis=""),
    '<plugin name="p" filename="p.so"><joint_name>turn</joint_name></plugin>',
]  # fmt: skip
LOOPS = [
    link("base"), link("p"), link("q"), link("r"), link("s"),
    joint("first", "revolute", "base", "p", axis="0 1 0"),
    joint("second", "revolute", "base", "q", OLD_AXIS, axis=""),
    joint("both", "universal", "q", "r", "<axis2><xyz>1 0 0</xyz></axis2>", "<pose>0 .1 0 0 0 0</pose>"),
    joint("rail", "prismatic", "r", "s", OLD_AXIS, axis=""),
    joint("close", "revolute", "p", "s", OLD_AXIS, axis=""),
    joint("hinge", "revolute", "r", "p", "<axis><xyz>0 1 0</xyz></axis>", axis=""),
]  # fmt: skip
SDF = (
    sdf(*LINKS),
    sdf(*LOOPS, version="1.6"),
    sdf(*LOOPS, version="1.4").replace("<model", '<world name="w"><gravity>0 0 -9</gravity><model', 1)
    .replace("</model>", '</model><model name="ground"><static>1</static></model></world>'),
)  # fmt: skip

MORE = (
    body("g", prim("Cube", "shape", "double size = 3", schemas=("PhysicsCollisionAPI",)), at="1, 0, 0"),
    usd_joint("Revolute", "j8", "d", "g", at(0, "1, 2, 3"), "float physxJoint:armature = .1",
          "float drive:angular:physics:maxForce = 5", "float state:angular:physics:position = 20",
          schemas=(DRIVE, "PhysicsJointStateAPI:angular", "PhysxJointAPI")),
    usd_joint("Spherical", "j9", "g", "f", "bool physics:excludeFromArticulation = true"),
    usd_joint("Prismatic", "k1", "g", "h", "rel physxMimicJoint:rotX:referenceJoint = </robot/j8>",
          "float physxMimicJoint:rotX:gearing = 3", schemas=("PhysxMimicJointAPI:rotX",)),
    body("h"),
    prim("PhysicsScene", "scene", "float physics:gravityMagnitude = 981"),
    'def "part" (\n references = @part.usda@\n) {\n}',
)  # fmt: skip
USD = KINDS.rstrip().removesuffix("}") + "\n".join(MORE) + "\n}\n"
USD_PART = '#usda 1.0\n(\n defaultPrim = "part"\n)\ndef Xform "part" {\n' + body("i") + "\n}\n"
