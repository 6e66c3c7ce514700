"""Robots as USD texts."""

HEAD = '#usda 1.0\n(\n  defaultPrim = "robot"\n  metersPerUnit = {meters}\n  upAxis = "{up}"\n)\n'

BODY = "PhysicsRigidBodyAPI", "PhysicsMassAPI"
BAR = (
    "float physics:mass = {m}\npoint3f physics:centerOfMass = ({x}, .01, 0)\n"
    "float3 physics:diagonalInertia = (.02, .05, .06)\nquatf physics:principalAxes = (.8, 0, .6, 0)"
)


def usda(*prims: str, meters: float = 1, up: str = "Z", root: str = "") -> str:
    """Return a USD text whose default prim holds the others."""
    schemas = f'(prepend apiSchemas = ["{root}"])' if root else ""
    return (
        HEAD.format(meters=meters, up=up) + f'def Xform "robot" {schemas} {{\n' + "\n".join(prims) + "\n}\n"
    )


def prim(kind: str, name: str, *content: str, schemas: tuple[str, ...] = ()) -> str:
    """Return a prim as text."""
    applied = ", ".join(f'"{schema}"' for schema in schemas)
    metadata = f"(prepend apiSchemas = [{applied}])" if schemas else ""
    return f'def {kind} "{name}" {metadata} {{\n' + "\n".join(content) + "\n}"


def body(name: str, *content: str, at: str = "", m: float = 1, x: float = 0.1, bar: bool = True) -> str:
    """Return a rigid body as text, at a translation."""
    place = (
        f'double3 xformOp:translate = ({at})\nuniform token[] xformOpOrder = ["xformOp:translate"]'
        if at
        else ""
    )
    stated = BAR.format(m=m, x=x) if bar else ""
    return prim("Xform", name, stated, place, *content, schemas=BODY)


def joint(kind: str, name: str, first: str, second: str, *content: str, schemas: tuple[str, ...] = ()) -> str:
    """Return a joint between two bodies ("" for the world) as text."""
    ends = [f"rel physics:body{side} = </robot/{end}>" for side, end in enumerate((first, second)) if end]
    return prim(f"Physics{kind}Joint", name, *ends, *content, schemas=schemas)


def at(side: int, place: str, turn: str = "") -> str:
    """Return the frame of a joint in one of its bodies as text."""
    rotation = f"\nquatf physics:localRot{side} = ({turn})" if turn else ""
    return f"point3f physics:localPos{side} = ({place}){rotation}"


DRIVE = "PhysicsDriveAPI:angular"

#: A planar five-bar: the loop closes at the tip, whose joint the file excludes.
FIVE_BAR = usda(
    body("left", at="-.2, 0, 0"),
    body("left_rod", at="-.3, 0, .3"),
    body("right", at=".2, 0, 0"),
    body("right_rod", at=".3, 0, .3"),
    joint("Revolute", "motor_left", "", "left", 'token physics:axis = "Y"', at(0, "-.2, 0, 0"),
          "float drive:angular:physics:maxForce = 50", schemas=(DRIVE,)),
    joint("Revolute", "knee_left", "left", "left_rod", 'token physics:axis = "Y"', at(0, "-.1, 0, .3")),
    joint("Revolute", "motor_right", "", "right", 'token physics:axis = "Y"', at(0, ".2, 0, 0"),
          "float drive:angular:physics:maxForce = 50", schemas=(DRIVE,)),
    joint("Revolute", "knee_right", "right", "right_rod", 'token physics:axis = "Y"', at(0, ".1, 0, .3")),
    joint("Spherical", "tip", "left_rod", "right_rod", at(0, ".3, 0, .4"), at(1, "-.3, 0, .4"),
          "bool physics:excludeFromArticulation = true"),
    root="PhysicsArticulationRootAPI",
)  # fmt: skip

LINK = (
    '<link name="{name}"><inertial><origin xyz="0.1 0.01 0" rpy="0 {tilt} 0"/><mass value="1"/>'
    '<inertia ixx=".02" iyy=".05" izz=".06" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
HINGE = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{at}"/><axis xyz="0 1 0"/><limit effort="{effort}" velocity="100"/></joint>'
)
#: The same robot, written by hand as URDF.
FIVE_BAR_URDF = (
    '<robot name="robot"><link name="world"/>'
    + "".join(
        LINK.format(name=n, tilt=1.2870022175866354) for n in ("left", "left_rod", "right", "right_rod")
    )
    + HINGE.format(name="motor_left", parent="world", child="left", at="-.2 0 0", effort=50)
    + HINGE.format(name="knee_left", parent="left", child="left_rod", at="-.1 0 .3", effort=0)
    + HINGE.format(name="motor_right", parent="world", child="right", at=".2 0 0", effort=50)
    + HINGE.format(name="knee_right", parent="right", child="right_rod", at=".1 0 .3", effort=0)
    + '<loop name="tip" type="spherical"><predecessor link="left_rod"><origin xyz=".3 0 .4"/></predecessor>'
    '<successor link="right_rod"><origin xyz="-.3 0 .4"/></successor></loop></robot>'
)

#: Every kind of joint, frames turned and shifted on both sides, in centimetres, bodies scaled.
KINDS = usda(
    body("a", at="10, 20, 30"),
    body("b", "float3 xformOp:scale = (2, 2, 2)\ndouble3 xformOp:translate = (40, 0, 0)\n"
         'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]'),
    body("c", prim("Xform", "tip", "double3 xformOp:translate = (5, 0, 2)\nfloat xformOp:rotateZ = 30\n"
         'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]'), at="0, 10, 0"),
    body("d", at="0, 0, 9"),
    body("e", at="1, 2, 3"),
    body("f", at="3, 2, 1"),
    joint("Revolute", "j1", "", "a", at(0, "10, 0, 0", ".8, .6, 0, 0"), at(1, "1, 2, 3", ".5, .5, .5, .5"),
          'token physics:axis = "Z"', "float physics:lowerLimit = -45\nfloat physics:upperLimit = 90"),
    joint("Prismatic", "j2", "a", "b", at(0, "1, 0, 0", "0, .8, 0, .6"), at(1, "2, 0, 1", "1, 0, 0, 0"),
          "float physics:lowerLimit = -5\nfloat physics:upperLimit = 20"),
    joint("Spherical", "j3", "c", "b", at(0, "0, 3, 0", ".6, 0, .8, 0"), at(1, "1, 1, 1")),
    joint("Fixed", "j4", "c/tip", "d", at(0, "1, 0, 0", ".6, 0, 0, .8"), at(1, "0, 0, 2")),
    joint("", "j5", "d", "e", at(0, "1, 0, 0"), at(1, "0, 0, 2", ".6, 0, 0, .8"),
          *(f"float limit:{axis}:physics:low = 1\nfloat limit:{axis}:physics:high = -1"
            for axis in ("transY", "transZ", "rotX", "rotY")),
          "float limit:transX:physics:low = -3\nfloat limit:transX:physics:high = 4",
          schemas=tuple(f"PhysicsLimitAPI:{a}" for a in ("transX", "transY", "transZ", "rotX", "rotY"))),
    joint("Revolute", "j6", "f", "e", at(0, "1, 0, 0"), at(1, "0, 0, 2"), 'token physics:axis = "X"'),
    joint("Revolute", "j7", "f", "a", at(0, "0, 1, 0"), at(1, "0, 0, 2"), 'token physics:axis = "Y"',
          "bool physics:excludeFromArticulation = true"),
    meters=0.01,
    up="Y",
)  # fmt: skip
