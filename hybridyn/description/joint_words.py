"""What formats call each kind of joint and each closure, once for those that read them and those that write.

A reader looks a word up in `called`, a writer a kind in `WORDS`. What a format does not have is written as
`JointKind.parts`: slides, and a hinge or a ball behind them.
"""

from __future__ import annotations

from typing import NamedTuple

from ..joints.kinds import JointKind

#: A slide, a hinge and a ball, of which others are made.
SLIDE, HINGE, BALL = JointKind.PRISMATIC, JointKind.REVOLUTE, JointKind.SPHERICAL
#: Closures that are no kind of joint.
CYLINDRICAL, UNIVERSAL, POINT = "cylindrical", "universal", "point"


class JointWords(NamedTuple):
    """What formats call a joint; "" where they do not have it.

    Attributes:
        chain: The joint, or those that have its freedoms in the tree, one behind the other.
        closure: The closure with its freedoms, a key of `closure_forms.FORMS`; it does not count turns.
        urdf: Type in URDF.
        drake: Type of `<drake:joint>`.
        gepetto: Type to which Gepetto's side-cars change joints.
        sdf: Type in SDF, and in `<gazebo>` of URDF.
        mjcf: Type in MJCF.
        usd: Type in USD, `Physics...Joint`.
        pinocchio: Names of Pinocchio's classes, `JointModel...`. A joint with an axis has two: the beginning
            of those along x, y and z, and that along any axis.
    """

    chain: tuple[JointKind, ...]
    closure: str = ""
    urdf: str = ""
    drake: str = ""
    gepetto: str = ""
    sdf: str = ""
    mjcf: str = ""
    usd: str = ""
    pinocchio: tuple[str, ...] = ()


#: The joints, each once.
JOINTS = (
    JointWords((JointKind.FIXED,), "fixed", urdf="fixed", gepetto="FIXED", sdf="fixed", usd="Fixed"),
    JointWords(
        (HINGE,), "revolute", urdf="revolute", sdf="revolute", mjcf="hinge", usd="Revolute",
        pinocchio=("R", "RevoluteUnaligned"),
    ),
    JointWords(
        (JointKind.CONTINUOUS,), "revolute", urdf="continuous", sdf="continuous", mjcf="hinge",
        pinocchio=("RUB", "RevoluteUnboundedUnaligned"),
    ),
    JointWords(
        (SLIDE,), "prismatic", urdf="prismatic", sdf="prismatic", mjcf="slide", usd="Prismatic",
        pinocchio=("P", "PrismaticUnaligned"),
    ),
    JointWords((JointKind.PLANAR,), "planar", urdf="planar", drake="planar", pinocchio=("Planar",)),
    JointWords(
        (BALL,), "spherical", urdf="spherical", drake="ball", gepetto="SPHERICAL", sdf="ball", mjcf="ball",
        usd="Spherical", pinocchio=("Spherical",),
    ),
    JointWords((HINGE, HINGE), UNIVERSAL, drake="universal", sdf="universal"),
    JointWords((JointKind.SCREW,), drake="screw", sdf="screw", pinocchio=("H", "HelicalUnaligned")),
    JointWords((HINGE, HINGE), sdf="revolute2"),
    JointWords((JointKind.FLOATING,), urdf="floating", mjcf="free", pinocchio=("FreeFlyer",)),
)  # fmt: skip

#: The words of each kind of joint.
WORDS = {joint.chain[0]: joint for joint in JOINTS if len(joint.chain) == 1}

#: Pinocchio's joints that are chains of slides along or hinges about the axes that their endings name.
PINOCCHIO_CHAINS = {"JointModelTranslation": (SLIDE, "xyz"), "JointModelSphericalZYX": (HINGE, "zyx")}

#: Other names of closures, of Gepetto's side-cars and of loop joints in URDF.
NICKNAMES = {"3d": BALL, "ball": BALL, "6d": JointKind.FIXED}
#: Closures by the names of Pinocchio's classes, those of its development branch included, and by the type of
#: a `RigidConstraintModel`.
ANCHORS = {
    "PointAnchorConstraintModel": POINT, "BilateralPointConstraintModel": POINT, "CONTACT_3D": POINT,
    "FrameAnchorConstraintModel": "fixed", "WeldConstraintModel": "fixed", "CONTACT_6D": "fixed",
}  # fmt: skip


def called(form: str) -> dict[str, JointWords]:
    """Return the joints that a format has by its words; of two with one word, the first.

    Args:
        form: An attribute of `JointWords` that is one word.
    """
    found: dict[str, JointWords] = {}
    for joint in JOINTS:
        found.setdefault(getattr(joint, form), joint)
    return {word: joint for word, joint in found.items() if word}
