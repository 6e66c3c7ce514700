"""Check the loops, mobility, motors and masses of every module, and singularities of the home posture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from ...assembly.free_motions import free_motions, own_inertia
from ...assembly.motor_share import SINGULAR_POSTURE, architecturally_singular, motor_share
from ...assembly.task import residuals
from ...description.loop_signs import lost_loops
from ...description.names import counted, listed
from ...linkage.reduction import ROUNDED_ROWS
from ...structure.module import Module
from ...structure.robot import HybridRobot
from .finding import Finding
from .subject import Subject


def home_residuals(robot: HybridRobot) -> list[float]:
    """Compute the largest closure residual of each module at home, relative to the module's length."""
    worst = {module.name: float(np.abs(x).max()) for module, x in residuals(robot, robot.home[None])}
    return [worst.get(module.name, 0.0) for module in robot.modules]


def check_modules(subject: Subject) -> Iterator[Finding]:
    """Check every module; of equal modules only the first."""
    robot = subject.robot
    if robot is None:
        return
    if robot.mobility and not robot.motors:
        yield Finding(
            "no-motors",
            "",
            f"no motor for {counted(robot.mobility, 'freedom')} ({subject.description.motors_from})",
            "inverse dynamics computes no effort, and simulations fall freely",
            "state motors = [...] in model.toml, <transmission> in the URDF or name_mot in robot.yaml",
            subject.description.source,
        )
    seen: set[int] = set()
    for module, open_by in zip(robot.modules, home_residuals(robot), strict=True):
        if id(module.mechanism) in seen or not module.joints or module.joints[0] not in subject.joints:
            continue  # a free base is not a joint of the file
        seen.add(id(module.mechanism))
        yield from _ModuleCheck(subject, robot, module, open_by).findings()


def check_lost_loops(subject: Subject) -> Iterator[Finding]:
    """Find signs of loops that the files do not state."""
    why = "without its loops the robot has too many freedoms, and efforts are wrong"
    for sign in lost_loops(subject.description):
        texts = (sign.message, why, sign.mend)
        if sign.link:
            yield subject.of_link("lost-loops", sign.link, *texts)
        elif sign.joint:
            yield subject.of_joint("lost-loops", sign.joint, *texts)
        else:
            yield Finding("lost-loops", "", *texts, subject.root.file)


def check_dangling_chains(subject: Subject) -> Iterator[Finding]:
    """Find chains of joints like those that several closures close, which no closure closes."""
    closures = subject.description.closures
    closed = [_chain(subject, link) for closure in closures for link in (closure.link_a, closure.link_b)]
    alike = Counter((start, kinds) for start, kinds, _ in closed if kinds)
    held = {name for coupling in subject.description.couplings for name, _ in coupling.terms}
    taken = {body for *_, bodies in closed for body in bodies}
    taken |= {body for body, joint in subject.joint_above.items() if joint.name in held}
    ends = {link: _chain(subject, link) for link in subject.links if not subject.carried[link]}
    free = {link: one[:2] for link, one in ends.items() if alike[one[:2]] > 1 and not taken & {*one[2]}}
    for link, key in free.items():
        if subject.body[link] == link and list(free.values()).count(key) < alike[key]:
            yield subject.of_link(
                "lost-loops",
                link,
                f"ends a chain ({', '.join(reversed(key[1]))}) like those that {alike[key]} closures close, "
                "and no closure names it",
                "without its loops the robot has too many freedoms, and efforts are wrong",
                "state its closure like those of the other chains",
            )


def _chain(subject: Subject, link: str) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return where the chain that ends at a link starts, the kinds of its joints, and its bodies."""
    kinds, bodies, at = list[str](), list[str](), subject.body[link]
    while at in subject.joint_above and (not kinds or subject.carried[at] == 1):
        joint = subject.joint_above[at]
        kinds.append(joint.kind)
        bodies.append(at)
        at = subject.body[joint.parent]
    return at, tuple(kinds), tuple(bodies)


class _ModuleCheck:
    """Checks one module."""

    def __init__(self, subject: Subject, robot: HybridRobot, module: Module, open_by: float) -> None:
        self.subject, self.robot, self.module, self.open_by = subject, robot, module, open_by

    def findings(self) -> Iterator[Finding]:
        """Yield all findings about the module."""
        yield from self._loops()
        yield from self._motors()
        yield from self._masses()
        if self.open_by <= self.robot.closure_tolerance:
            yield from self._singular_home()

    def _about(self, code: str, message: str, why: str, mend: str, joint: str | None = None) -> Finding:
        """Return a finding about the module, at the line of a joint or of its first closure."""
        if joint is not None:
            return self.subject.of_joint(code, joint, message, why, mend)
        at = (*self.module.closures, *self.module.joints)
        return self.subject.of_module(code, self.module.name, message, why, mend, at)

    def _loops(self) -> Iterator[Finding]:
        m, module = self.module.mechanism, self.module
        if not module.closures:
            return
        report = m.reduction.report
        if self.open_by > self.robot.closure_tolerance:
            yield self._about(
                "open-at-home",
                f"its loops are open by {self.open_by:.2g} of its size ({m.length:g} m) at the home posture",
                "a motion that starts at home must assemble first, perhaps on another branch than intended",
                "state a closed home posture ([home] in model.toml; 'hybridyn home --write' finds one)",
            )
        if not module.mobility:
            yield self._about(
                "locked",
                f"its {report.rank} independent closure rows lock all its {m.reduction.n} freedoms",
                "the module cannot move, and no motion of it has a solution",
                f"check types and axes of {listed(module.closures)}: perhaps a weld ('6d', 'fixed') stands "
                "in place of a hinge or a ball",
            )
        if (spare := report.rows - report.rank) > 0 and report.dropped > ROUNDED_ROWS:
            yield self._about(
                "rounded",
                f"{spare} of {report.rows} closure rows depend on the others, up to the file's rounding "
                f"({report.dropped:.1e} relative)",
                "wrenches inside the loops are not unique; motion and motor efforts are",
                f"write more digits if you do not expect a mobility of {module.mobility}",
            )

    def _motors(self) -> Iterator[Finding]:
        module = self.module
        if module.closures and not module.mobility:
            return
        free = free_motions(module)
        held = [*self._held_motors()]
        yield from held
        singular = "" if held else architecturally_singular(module)
        if singular:
            yield self._about(
                "architectural",
                singular.partition("; ")[0],
                "motor efforts cannot hold the platform along that motion, and motor positions do not fix it",
                "change the geometry (base and platform may be similar hexagons), or choose other motors",
            )
            return
        opposed = len(module.motors) - module.mobility + len(free.uncontrolled) + len(free.idle)
        undriven = listed(dict.fromkeys(free.uncontrolled)).replace("'", "")
        counts = f"{counted(len(module.motors), 'motor')} for {counted(module.mobility, 'freedom')}"
        if free.uncontrolled and module.motors and opposed > 0:
            yield self._about(
                "motors-opposed",
                f"{counts}, but none drives the motion of {undriven}, while {opposed} work against others",
                "that motion has no effort, and other efforts are not unique",
                "choose one motor per freedom: motors = [...] in model.toml",
            )
        elif free.uncontrolled and self.robot.motors:
            yield self._about(
                "motors-missing",
                f"{counts}: no motor drives the motion of {undriven}",
                'idm rejects a motion that needs an effort there; passive="solved" computes the free motion',
                "add a motor, or nothing if the passive motion is intended",
            )

    def _held_motors(self) -> Iterator[Finding]:
        for name in held_motors(self.module) if self.module.mobility else ():
            yield self._about(
                "motor-cannot-move",
                "is a motor, but the closures prevent it from moving at every posture",
                "its effort is arbitrary and moves nothing",
                "choose another joint as the motor, or a closure with fewer rows",
                name,
            )

    def _masses(self) -> Iterator[Finding]:
        module = self.module
        if not module.mobility:
            return
        if without_mass(module):
            for number, bare in enumerate(self.robot.modules):
                if bare.mechanism is module.mechanism and number not in self.robot.children:
                    yield self.subject.of_module(
                        "no-mass",
                        bare.name,
                        "none of its bodies has mass, and no other module is on it",
                        "its direct dynamics has no solution",
                        "add <inertial> to its links",
                        (*bare.closures, *bare.joints),
                    )
                    break
            return
        for name in free_motions(module).massless:
            yield self._about(
                "massless-motion",
                f"the motion of {name} has no inertia",
                "any effort along it causes an infinite acceleration: ddm and simulate need inertia there",
                "give the link an <inertial>, or the joint a rotor_inertia in model.toml",
            )

    def _singular_home(self) -> Iterator[Finding]:
        m, module = self.module.mechanism, self.module
        if not module.closures or not module.mobility:
            return
        basis = m.basis(m.closures.matrix(m.tree.sweep(m.home[None])))
        if basis.pivot[0] < SINGULAR_POSTURE:
            yield self._about(
                "singular-closures",
                f"its closures lose rank at the home posture (smallest pivot {basis.pivot[0]:.1e})",
                "additional instantaneous motions are possible there, and two branches meet",
                "choose another home posture: [home] in model.toml",
            )
            return
        share = motor_share(module, basis.Psi)
        usual = motor_share(module, m.generic_Psi)
        if share is not None and usual is not None and share[0] < SINGULAR_POSTURE <= np.median(usual):
            yield self._about(
                "singular-parallel",
                f"it can still move at the home posture when its motors are locked (the motors' share of "
                f"that motion is {share[0]:.1e})",
                "efforts grow without bound there",
                "choose another home posture, away from this one",
            )


def without_mass(module: Module) -> bool:
    """Return whether no motion of a module moves a mass of its own."""
    m = module.mechanism
    return bool(m.mobility and own_inertia(m, m.generic_Psi[0]).max() <= 0.0)


def held_motors(module: Module) -> list[str]:
    """Return the motors of a module that its closures hold still at every posture."""
    m = module.mechanism
    Psi = np.abs(m.generic_Psi[0] / m.reduction.col_scale[:, None]).max(axis=1, initial=0.0)
    moving = zip(module.motors, Psi[module.motor_columns], strict=True)
    return [name for name, most in moving if not m.mobility or most < SINGULAR_POSTURE * Psi.max()]
