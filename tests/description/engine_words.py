"""What engines give a force, an inertia or a constraint, by format: what they know, not what we read.

Each row is an engine, a place in a robot of the format (a key of its `PLACES`), and what is written there.
The lists come from the documentation and the readers of Gazebo, sdformat, Drake, Bullet, RaiSim, Isaac Sim,
Dojo, ros_control, ros2_control, MuJoCo, PhysX and Newton.
"""

from tests.description import sdf_texts, usd_texts
from tests.robots.mjcf_texts import mjcf
from tests.robots.robot_texts import FOUR_BAR

Row = tuple[str, str, str]

DETACHABLE = (
    '<plugin filename="gz-sim-detachable-joint-system" name="gz::sim::systems::DetachableJoint">'
    "<parent_link>{}</parent_link><child_model>{}</child_model><child_link>{}</child_link></plugin>"
)
MIMIC = '<plugin filename="m.so"><joint>{}</joint><mimicJoint>{}</mimicJoint></plugin>'
ATTACH = '<plugin filename="gz_attach_links" name="a"><link1>{}</link1><link2>{}</link2></plugin>'
CLOSED = (
    '<plugin filename="libclosed_loop_plugin.so" name="c"><joint><body1>{}</body1><body2>{}</body2>'
    "<type>revolute</type></joint></plugin>"
)
FORCES = (
    "gz-sim-buoyancy-system", "gz-sim-hydrodynamics-system", "gz-sim-lift-drag-system",
    "libLiftDragPlugin.so", "gz-sim-wind-effects-system", "gz-sim-thruster-system",
    "gz-sim-multicopter-motor-model-system",
    "libgazebo_ros_vacuum_gripper.so", "libgazebo_grasp_fix.so", "libgazebo_ros_link_attacher.so",
    "gz-sim-spring-joint-system", "gz-sim-elastic-tendon-system", "libspring_plugin.so",
)  # fmt: skip
#: Plugins of which no force, inertia or constraint comes: those of Gazebo and of its interface to ROS.
NO_FORCES = (
    *(f"gz-sim-{name}-system" for name in (
        "physics", "user-commands", "scene-broadcaster", "sensors", "contact", "imu", "magnetometer",
        "altimeter", "air-pressure", "air-speed", "navsat", "forcetorque", "dvl", "touchplugin",
        "opticaltactileplugin", "label", "thermal", "thermal-sensor", "logical-camera",
        "logicalaudiosensorplugin", "camera-video-recorder", "log", "log-video-recorder",
        "joint-state-publisher", "pose-publisher", "odometry-publisher", "triggered-publisher",
        "particle-emitter", "breadcrumbs", "performer-detector", "kinetic-energy-monitor",
        "linearbatteryplugin", "comms-endpoint", "perfect-comms", "rf-comms", "acoustic-comms",
        "shader-param", "environment-preload", "lens-flare", "joint-controller", "joint-position-controller",
        "joint-trajectory-controller", "diff-drive", "mecanum-drive", "ackermann-steering",
        "velocity-control",
    )),
    "libignition-gazebo-physics-system.so", "ignition-gazebo-user-commands-system",
    "libgz-sim8-physics-system.so", "libgazebo_ros_init.so", "libgazebo_ros_factory.so",
    "libgazebo_ros_state.so", "libgazebo_ros_api_plugin.so", "libgazebo_ros_paths_plugin.so",
    "libgazebo_ros_joint_state_publisher.so", "libgazebo_ros2_control.so",
)  # fmt: skip

#: Where a row stands in the URDF: a text of it, and the same with "{}" for the row.
URDF = FOUR_BAR.replace(
    "</robot>",
    '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="drive"/>'
    '<actuator name="m"/></transmission><mujoco><compiler/><option/></mujoco>'
    '<ros2_control name="s" type="system"><joint name="swing"/></ros2_control></robot>',
)
URDF_PLACES = {
    "robot": ("</robot>", "{}</robot>"),
    "link": ('<link name="rocker">', '<link name="rocker">{}'),
    "inertial": ("<inertial>", "<inertial>{}"),
    "inertial=": ("<inertial>", "<inertial {}>"),
    "mass=": ("<mass ", "<mass {} "),
    "joint": ("<parent", "{}<parent"),
    "joint=": ('<joint name="drive" ', '<joint name="drive" {} '),
    "limit=": ("<limit ", "<limit {} "),
    "dynamics=": ('<dynamics damping="0.1" friction="0.2"', '<dynamics damping="0.1" friction="0.2" {}'),
    "dynamics": ('friction="0.2"/>', 'friction="0.2">{}</dynamics>'),
    "transmission": ("<actuator", "{}<actuator"),
    "transmission joint": ('<joint name="drive"/>', '<joint name="drive">{}</joint>'),
    "actuator": ('<actuator name="m"/>', '<actuator name="m">{}</actuator>'),
    "gazebo": ("</robot>", "<gazebo>{}</gazebo></robot>"),
    "gazebo link": ("</robot>", '<gazebo reference="rocker">{}</gazebo></robot>'),
    "gazebo joint": ("</robot>", '<gazebo reference="swing">{}</gazebo></robot>'),
    "ros2_control joint": ('<joint name="swing"/></ros2', '<joint name="swing">{}</joint></ros2'),
    "ros2_control": ("</ros2_control>", "{}</ros2_control>"),
    "compiler=": ("<compiler/>", "<compiler {}/>"),
    "option=": ("<option/>", "<option {}/>"),
    "mujoco": ("</mujoco>", "{}</mujoco>"),
}
SDF_JOINT = (
    '<joint name="x" type="revolute"><parent>coupler</parent><child>rocker</child><axis>'
    "<xyz>0 0 1</xyz>{}</axis></joint>"
)
LOOP_JOINT = (
    '<loop_joint name="x" type="revolute"><link1 link="coupler"/><link2 link="rocker"/><axis xyz="0 0 1"/>{}'
    "</loop_joint>"
)
IN_URDF: list[Row] = [
    ("Gazebo", "gazebo link", "<turnGravityOff>true</turnGravityOff>"),
    ("Gazebo", "gazebo link", "<gravity>0</gravity>"),
    ("Gazebo", "gazebo link", "<dampingFactor>0.1</dampingFactor>"),
    ("Gazebo", "gazebo link", "<velocity_decay><linear>0.1</linear></velocity_decay>"),
    ("Gazebo", "gazebo link", "<kinematic>true</kinematic>"),
    ("Gazebo", "gazebo link", "<enable_wind>true</enable_wind>"),
    ("Gazebo", "gazebo link", "<inertial><mass>3</mass></inertial>"),
    ("Gazebo", "gazebo link",
     "<joint name='a' type='revolute'><parent>crank</parent><child>rocker</child></joint>"),
    ("Gazebo", "gazebo joint", "<springStiffness>50</springStiffness>"),
    ("Gazebo", "gazebo joint", "<springStiffness>50</springStiffness><springReference>1</springReference>"),
    ("Gazebo", "gazebo joint", "<dynamics><damping>2</damping></dynamics>"),
    ("Gazebo", "gazebo joint", "<axis><dynamics><friction>2</friction></dynamics></axis>"),
    ("Gazebo", "gazebo joint", "<physics><ode><max_force>3</max_force></ode></physics>"),
    ("Gazebo", "gazebo joint", "<physics><ode><suspension><erp>.3</erp></suspension></ode></physics>"),
    ("Gazebo", "gazebo", "<static>true</static>"),
    ("Gazebo", "gazebo", "<enable_wind>true</enable_wind>"),
    ("Gazebo", "gazebo", "<pose>0 0 0 0.5 0 0</pose>"),
    ("Gazebo", "gazebo", "<link name='e'><pose>0 0 1 0 0 0</pose><inertial><mass>3</mass></inertial></link>"),
    ("Gazebo", "gazebo", "<link name='e'/>"),
    ("Gazebo", "gazebo", "<model name='m'><link name='e'/></model>"),
    ("Gazebo", "gazebo", "<include><uri>model://tool</uri></include>"),
    ("Gazebo", "gazebo", "<gripper name='g'><palm_link>rocker</palm_link></gripper>"),
    ("Gazebo", "gazebo", SDF_JOINT.format("")),
    ("Gazebo", "gazebo", SDF_JOINT.format("<dynamics><damping>2</damping></dynamics>")),
    ("Gazebo", "gazebo", SDF_JOINT.format("<dynamics><friction>2</friction></dynamics>")),
    ("Gazebo", "gazebo", SDF_JOINT.format("<dynamics><spring_stiffness>2</spring_stiffness></dynamics>")),
    ("Gazebo", "gazebo", SDF_JOINT.format("<mimic joint='drive'/>")),
    ("Gazebo", "gazebo", DETACHABLE.format("coupler", "four_bar", "rocker")),
    ("Gazebo", "gazebo", DETACHABLE.format("coupler", "__model__", "rocker")),
    ("Gazebo", "gazebo", DETACHABLE.format("coupler", "another", "rocker")),
    ("Gazebo", "gazebo", DETACHABLE.format("coupler", "box", "lid")),
    ("Gazebo", "gazebo", ATTACH.format("coupler", "rocker")),
    ("Gazebo", "gazebo link", ATTACH.format("coupler", "rocker")),
    ("Gazebo", "robot", ATTACH.format("coupler", "rocker")),
    ("Gazebo", "gazebo", CLOSED.format("coupler", "rocker")),
    *(("Gazebo", "gazebo", MIMIC.format(leader, "elbow")) for leader in ("drive", "driv")),
    *(("Gazebo", "gazebo", f'<plugin filename="{name}" name="p"/>') for name in FORCES),
    ("ros2_control", "ros2_control joint", '<param name="mimic">drive</param>'),
    ("ros2_control", "ros2_control joint", '<param name="mimic">driv</param>'),
    ("ros2_control", "ros2_control",
     "<transmission name='t'><joint name='swing'><rotor_inertia>1</rotor_inertia></joint></transmission>"),
    *(("ros_control", "transmission", text) for text in (
        "<rotor_inertia>1</rotor_inertia>", '<compensator k_belt="4000" mass_motor="0.1"/>',
        '<gap_joint name="elbow" L0="1" a="1" b="2"/>', '<passive_joint name="elbow"/>',
        '<simulated_actuated_joint name="elbow" simulated_reduction="3"/>',
    )),
    ("ros_control", "transmission joint", "<rotor_inertia>1</rotor_inertia>"),
    ("ros_control", "robot",
     "<transmission name='d'><type>DifferentialTransmission</type><joint name='drive'/>"
     "<joint name='elbow'/><actuator name='a'><rotor_inertia>1</rotor_inertia></actuator><actuator name='b'>"
     "<rotor_inertia>2</rotor_inertia></actuator></transmission>"),
    ("ros_control", "robot",
     "<transmission name='d'><type>FourBarLinkageTransmission</type><joint name='drive'/>"
     "<joint name='elbow'/><actuator name='a'><rotor_inertia>1</rotor_inertia></actuator><actuator name='b'/>"
     "</transmission>"),
    ("Drake", "actuator", '<drake:rotor_inertia value="1"/>'),
    ("Drake", "dynamics=", 'coulomb_window="0.1"'),
    ("Drake", "joint", '<drake:screw_thread_pitch value="0.1"/>'),
    ("Drake", "joint", '<drake:mimic joint="elbow"/>'),
    *(("Drake", "robot", text) for text in (
        "<drake:linear_bushing_rpy/>", "<drake:ball_constraint/>", "<drake:weld_constraint/>",
        "<drake:distance_constraint/>", "<drake:tendon_constraint/>", "<drake:linear_spring_damper/>",
        "<drake:joint name='j' type='ball'/>", "<cable name='c'/>", "<force_element name='f'/>",
        "<force_element name='f'><torsional_spring stiffness='3'/></force_element>",
        "<drake:planar_spring stiffness='3'/>",
    )),
    ("Bullet", "link", "<contact><inertia_scaling value='3'/></contact>"),
    ("Bullet", "robot", "<deformable name='d'/>"),
    ("RaiSim", "dynamics=", 'rotor_inertia="0.05"'),
    ("RaiSim", "dynamics=", 'stiffness="50" spring_mount="0.2"'),
    ("RaiSim", "robot", "<actuator name='m' joint='drive'/>"),
    ("RaiSim", "robot", "<constraints><pin body1='coupler' body2='rocker'/></constraints>"),
    ("Isaac Sim", "dynamics=", 'armature="0.05"'),
    ("Isaac Sim", "dynamics=", 'stiffness="50"'),
    ("Isaac Sim", "joint", '<drive type="position" stiffness="3"/>'),
    ("Isaac Sim", "joint", '<physics armature="3"/>'),
    ("Isaac Sim", "robot", LOOP_JOINT.format("")),
    ("Dojo", "robot", LOOP_JOINT.format('<dynamics damping="1"/>')),
    ("Dojo", "robot", LOOP_JOINT.format('<dynamics friction="1"/>').replace("revolute", "spherical")),
    ("Dojo", "robot", LOOP_JOINT.format('<dynamics stiffness="1"/>').replace("revolute", "prismatic")),
    ("Dojo", "robot", LOOP_JOINT.format('<dynamics rotor_inertia="1"/>')),
    ("urdfdom", "robot", "<constraint name='c' type='fixed'><parent link='coupler'/></constraint>"),
    *(("others", "dynamics=", f'{word}="3"') for word in (
        "viscous_friction", "static_friction", "coulomb", "elasticity", "spring", "rotor_friction", "inertia",
        "backlash", "hysteresis", "stribeck", "motor_inertia", "gear_ratio", "spring_stiffness",
    )),
    *(("others", "joint", text) for text in (
        '<spring k="50"/>', "<spring><stiffness>3</stiffness></spring>", '<damper c="1"/>',
        '<gear ratio="3"/>', "<actuator><inertia>3</inertia></actuator>", '<elasticity value="3"/>',
        "<armature>3</armature>",
        '<friction value="2"/>', '<motor rotor_inertia="3"/>', "<rotor_inertia>3</rotor_inertia>",
    )),
    ("others", "dynamics", "<spring k='3'/>"),
    ("others", "joint=", 'armature="3"'),
    ("others", "limit=", 'stiffness="3"'),
    *(("others", "link", text) for text in (
        '<damping linear="1"/>', "<gravity>0</gravity>", "<buoyancy/>", '<drag coefficient="1"/>',
        "<mass>3</mass>",
    )),
    *(("others", "inertial", text) for text in ("<density value='3'/>", "<added_mass xx='1'/>")),
    ("others", "inertial=", 'auto="true"'),
    ("others", "mass=", 'scale="3"'),
    ("others", "robot", '<properties kf="3.16e-10" drag_coeff_xy="9e-7"/>'),
    *(("MuJoCo", "compiler=", f'{text}"') for text in (
        'boundmass="0.1', 'boundinertia="0.1', 'settotalmass="3', 'inertiafromgeom="true',
        'balanceinertia="true',
    )),
    *(("MuJoCo", "option=", f'{text}"') for text in (
        'gravity="0 0 -1', 'density="1', 'viscosity="1', 'wind="1 0 0',
    )),
    ("MuJoCo", "mujoco", "<equality><joint joint1='elbow' joint2='swing'/></equality>"),
    ("MuJoCo", "mujoco", "<tendon><spatial stiffness='3'/></tendon>"),
]  # fmt: skip

SDF = sdf_texts.sdf(
    '<link name="base"/>', sdf_texts.WORLD, sdf_texts.link("a"), sdf_texts.link("b"),
    sdf_texts.joint("j", "revolute", "base", "a"), sdf_texts.joint("k", "revolute", "a", "b"),
)  # fmt: skip
SDF_PLACES = {
    "model": ("</model>", "{}</model>"),
    "link": ('<link name="b">', '<link name="b">{}'),
    "inertial": ("<inertial>", "<inertial>{}"),
    "inertial=": ("<inertial>", "<inertial {}>"),
    "joint": ("<parent>a</parent>", "<parent>a</parent>{}"),
    "axis": ("<axis>", "<axis>{}"),
}
IN_SDF: list[Row] = [
    *(("Gazebo", "link", text) for text in (
        "<gravity>false</gravity>", "<kinematic>true</kinematic>", "<enable_wind>true</enable_wind>",
        "<velocity_decay><linear>0.1</linear></velocity_decay>", "<buoyancy>1</buoyancy>",
        '<plugin filename="libbuoyancy.so" name="p"/>',
    )),
    *(("Gazebo", "model", text) for text in (
        "<static>true</static>", "<enable_wind>true</enable_wind>",
        '<gripper name="g"><palm_link>b</palm_link><gripper_link>a</gripper_link></gripper>',
        DETACHABLE.format("base", "robot", "b"), DETACHABLE.format("base", "__model__", "b"),
        DETACHABLE.format("base", "another", "b"), DETACHABLE.format("base", "box", "lid"),
        ATTACH.format("base", "b"), CLOSED.format("base", "b"),
        MIMIC.format("j", "k"),
        *(f'<plugin filename="{name}" name="p"/>' for name in FORCES),
        "<link name='loose'/>", "<joint name='s' type='screw'><parent>base</parent><child>b</child></joint>",
        "<joint name='s' type='gearbox'><parent>base</parent><child>b</child></joint>",
        sdf_texts.joint("s", "ball", "base", "b", axis=""),
    )),
    *(("Gazebo", "joint", text) for text in (
        "<thread_pitch>3</thread_pitch>", "<gearbox_ratio>3</gearbox_ratio>",
        "<physics><ode><max_force>3</max_force></ode></physics>",
        "<physics><ode><suspension><erp>.3</erp></suspension></ode></physics>",
        '<axis2><xyz>1 0 0</xyz><dynamics><damping>3</damping></dynamics></axis2>', "<damping>3</damping>",
    )),
    *(("Gazebo", "axis", f"<dynamics>{text}</dynamics>") for text in (
        "<damping>3</damping>", "<friction>3</friction>", "<spring_stiffness>3</spring_stiffness>",
        "<spring_stiffness>3</spring_stiffness><spring_reference>1</spring_reference>",
        "<armature>3</armature>",
    )),
    ("Gazebo", "axis", "<limit><stiffness>3</stiffness></limit>"),
    ("Gazebo", "axis", '<mimic joint="j"/>'),
    ("Gazebo", "inertial", "<fluid_added_mass><xx>1</xx></fluid_added_mass>"),
    ("Gazebo", "inertial=", 'auto="true"'),
    *(("Drake", "model", text) for text in (
        "<drake:linear_bushing_rpy/>", "<drake:ball_constraint/>", "<drake:distance_constraint/>",
        "<drake:joint name='d' type='planar'/>", "<drake:linear_spring_damper/>",
        "<drake:tendon_constraint/>", "<drake:spring stiffness='3'/>",
    )),
    ("Drake", "joint", "<drake:rotor_inertia>3</drake:rotor_inertia>"),
    ("Drake", "joint", "<drake:damping>3</drake:damping>"),
]  # fmt: skip

BODIES = (
    '<body name="a"><joint name="a1" axis="0 1 0" range="-1 1"/>'
    '<inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/><site name="sa" pos=".2 0 0"/>'
    '<body name="b" pos=".3 0 0"><joint name="b1" axis="0 1 0"/>'
    '<geom name="g" size=".1" contype="0" conaffinity="0"/><site name="sb" pos=".1 0 .1"/></body></body>'
    '<body name="c" pos=".3 0 0"><joint name="c1" axis="0 1 0"/><geom size=".1" contype="0" conaffinity="0"/>'
    '<site name="sc" pos=".1 0 .1"/></body>'
)
MJCF = mjcf(
    "<tendon><fixed name='t'><joint joint='a1' coef='1'/></fixed></tendon>"
    "<equality><weld name='w' site1='sb' site2='sc'/></equality>"
    "<actuator><motor name='m' joint='a1'/></actuator>",
    world=BODIES,
)
MJCF_PLACES = {
    "mujoco": ("</mujoco>", "{}</mujoco>"),
    "option=": ("<option>", "<option {}>"),
    "flag=": ("<flag ", "<flag {} "),
    "body=": ('<body name="b"', '<body name="b" {}'),
    "body": ('<joint name="b1"', '{}<joint name="b1"'),
    "joint=": ('<joint name="a1"', '<joint name="a1" {}'),
    "geom=": ('<geom name="g"', '<geom name="g" {}'),
    "fixed=": ("<fixed ", "<fixed {} "),
    "weld=": ("<weld ", "<weld {} "),
    "motor=": ("<motor ", "<motor {} "),
    "equality": ("<equality>", "<equality>{}"),
    "actuator": ("<actuator>", "<actuator>{}"),
    "tendon": ("<tendon>", "<tendon>{}"),
}
IN_MJCF: list[Row] = [
    *(("MuJoCo", "joint=", text) for text in (
        'stiffness="3"', 'stiffness="3 1 1"', 'damping="3"', 'damping="3 1"', 'armature="3"',
        'frictionloss="3"',
        'springdamper="1 1"', 'stiffness="3" springref="1"', 'actuatorgravcomp="true"', 'ref="0.3"',
    )),
    ("MuJoCo", "body=", 'gravcomp="1"'),
    ("MuJoCo", "body", '<plugin plugin="mujoco.elasticity.cable"/>'),
    *(("MuJoCo", "fixed=", text) for text in (
        'stiffness="3"', 'damping="3"', 'frictionloss="3"', 'armature="3"', 'range="-1 1"',
        'actuatorfrcrange="-1 1"', 'limited="true" range="0 1"',
    )),
    *(("MuJoCo", "weld=", text) for text in (
        'torquescale="0"', 'solref="0.5 1"', 'solref="-5 -1"', 'solimp="0.1 0.2"', 'active="false"',
    )),
    *(("MuJoCo", "equality", text) for text in (
        '<connect body1="b" body2="c" anchor="0 0 0"/>', '<joint joint1="b1" joint2="c1"/>',
        '<joint joint1="b1" joint2="c1" polycoef="0 1 1 0 0"/>', '<tendon tendon1="t"/>',
        '<joint joint1="b1" solref="1 1"/>',
    )),
    *(("MuJoCo", "motor=", text) for text in ('armature="3"', 'damping="3"', 'gear="3" armature="1"')),
    *(("MuJoCo", "actuator", text) for text in (
        '<adhesion body="b" ctrlrange="0 1"/>', '<position joint="b1" kp="3"/>', '<damper joint="b1" kv="3"'
        ' ctrlrange="0 1"/>', '<muscle joint="b1"/>', '<general site="sb" gear="1 0 0 0 0 0"/>',
    )),
    ("MuJoCo", "tendon", '<spatial name="s" stiffness="3"><site site="sa"/><site site="sc"/></spatial>'),
    ("MuJoCo", "tendon", '<spatial name="s" range="0 1"><site site="sa"/><site site="sc"/></spatial>'),
    ("MuJoCo", "option=", 'gravity="0 0 -1"'),
    ("MuJoCo", "option=", 'density="1" wind="1 0 0"'),
    ("MuJoCo", "option=", 'viscosity="1"'),
    *(("MuJoCo", "flag=", f'{word}="disable"') for word in (
        "gravity", "spring", "damper", "frictionloss", "equality", "constraint",
    )),
    ("MuJoCo", "geom=", 'mass="3"'),
    ("MuJoCo", "mujoco", "<deformable><flex name='f' dim='1' body='a b' element='0 1'/></deformable>"),
]  # fmt: skip


def usd(place: str, row: str) -> str:
    """Return a pendulum of two bodies in USD with a row, "SCHEMA; CONTENT", at a place."""
    schema, _, content = row.partition("; ")
    added = {place: ((schema,) if schema else (), content)}

    def at(name: str, own: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
        schemas, content = added.get(name, ((), ""))
        return content, own + schemas

    (body, bodies), (joint, joints), (scene, scenes) = at("body", ()), at("joint", ()), at("scene", ())
    upper = usd_texts.prim(
        "Xform", "upper", usd_texts.BAR.format(m=1, x=0.1), body, schemas=usd_texts.BODY + bodies
    )
    axis = 'token physics:axis = "Y"'
    return usd_texts.usda(
        upper,
        usd_texts.body("lower", at=".3, 0, 0"),
        usd_texts.joint("Revolute", "a", "", "upper", axis),
        usd_texts.joint(
            "Revolute", "b", "upper", "lower", axis, usd_texts.at(0, ".3, 0, 0"), joint, schemas=joints
        ),
        usd_texts.prim("PhysicsScene", "scene", scene, schemas=scenes),
        content if place == "robot" else "",
        root="PhysicsArticulationRootAPI",
    )


AXIS, TO = "PhysxJointAxisAPI:angular", "physxJointAxis:angular"
ENDS = "rel physics:body0 = </robot/upper>\nrel physics:body1 = </robot/lower>"
IN_USD: list[Row] = [
    *(("USD", "body", f"; {text}") for text in (
        "bool physics:kinematicEnabled = 1", "bool physics:rigidBodyEnabled = 0",
        "vector3f physics:velocity = (1, 0, 0)",
    )),
    *(("USD", "joint", f"; {text}") for text in (
        "float physics:breakForce = 3", "float physics:breakTorque = 3", "bool physics:jointEnabled = 0",
    )),
    ("USD", "joint", "PhysicsDriveAPI:angular; float drive:angular:physics:stiffness = 3"),
    ("USD", "joint", "PhysicsDriveAPI:angular; float drive:angular:physics:damping = 3"),
    ("USD", "scene", "; float physics:gravityMagnitude = 3"),
    ("USD", "scene", "; vector3f physics:gravityDirection = (1, 0, 0)"),
    *(("USD", "robot", f'; def {text} "x" {{\n{ENDS}\n}}') for text in (
        "PhysicsDistanceJoint", "PhysicsFixedJoint", "PhysicsSphericalJoint", "PhysxPhysicsGearJoint",
        "PhysxPhysicsRackAndPinionJoint",
    )),
    *(("PhysX", "body", f"PhysxRigidBodyAPI; {text}") for text in (
        "bool physxRigidBody:disableGravity = 1", "float physxRigidBody:linearDamping = 3",
        "float physxRigidBody:angularDamping = 3", "bool physxRigidBody:enableGyroscopicForces = 0",
        "int physxRigidBody:lockedPosAxis = 3", "int physxRigidBody:lockedRotAxis = 3",
        "float physxRigidBody:newForce = 3",
    )),
    ("PhysX", "body", "PhysxForceAPI; vector3f physxForce:force = (1, 0, 0)"),
    ("PhysX", "body", "PhysxSurfaceVelocityAPI; "),
    ("PhysX", "body", "PhysxVehicleAPI; "),
    ("PhysX", "joint", "PhysxTendonAxisAPI:t; float physxTendon:t:gearing = 3"),
    ("PhysX", "joint", "PhysxJointAPI; float physxJoint:armature = 3"),
    ("PhysX", "joint", "PhysxJointAPI; float physxJoint:jointFriction = 3"),
    *(("PhysX", "joint", f"{AXIS}; float {TO}:{text} = 3") for text in (
        "armature", "dynamicFrictionEffort", "staticFrictionEffort", "viscousFrictionCoefficient",
    )),
    ("PhysX", "joint", "PhysxLimitAPI:angular; float physxLimit:angular:stiffness = 3"),
    ("PhysX", "joint", "PhysxLimitAPI:angular; float physxLimit:angular:damping = 3"),
    ("PhysX", "joint", "PhysxDrivePerformanceEnvelopeAPI:angular; float "
     "physxDrivePerformanceEnvelope:angular:velocityDependentResistance = 3"),
    ("PhysX", "joint",
     "PhysxMimicJointAPI:rotY; rel physxMimicJoint:rotY:referenceJoint = </robot/a>\nfloat "
     "physxMimicJoint:rotY:naturalFrequency = 3"),
    *(("Newton", "joint", f"NewtonJointAPI; float newton:{text} = 3") for text in (
        "armature", "damping", "friction", "springStiffness", "limitStiffness", "stiffness",
    )),
    ("Newton", "body", "; float newton:linearDrag = 3"),
    ("Newton", "joint", "NewtonMimicAPI; rel newton:mimicJoint = </robot/a>"),
    ("Newton", "robot", "; def NewtonActuator \"x\" {\nrel newton:targets = </robot/a>\n}"),
    ("Newton", "scene", "; bool newton:gravityEnabled = 0"),
    *(("MuJoCo", "joint", f"MjcJointAPI; double mjc:{text} = 3") for text in (
        "armature", "damping", "frictionloss", "stiffness", "springdamper",
    )),
    ("MuJoCo", "joint", "MjcEqualityJointAPI; rel mjc:target = </robot/a>"),
    ("MuJoCo", "body", "; double mjc:gravcomp = 1"),
    ("MuJoCo", "scene", "; bool mjc:flag:gravity = 0"),
    *(("MuJoCo", "scene", f"MjcSceneAPI; {text}") for text in (
        "double mjc:option:density = 3", "double mjc:option:viscosity = 3",
        "double mjc:compiler:boundMass = 3", "double mjc:compiler:setTotalMass = 3",
        "bool mjc:compiler:balanceInertia = 1",
    )),
    ("MuJoCo", "robot", "; def MjcTendon \"x\" {\n}"),
    ("MuJoCo", "robot", "; def MjcActuator \"x\" {\nrel mjc:target = </robot/a>\n}"),
]  # fmt: skip
