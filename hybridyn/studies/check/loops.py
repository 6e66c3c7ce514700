"""Loops, mobility and motors of every module, and what the home posture loses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...assembly.findings import SINGULAR_POSTURE, architecturally_singular, home_residuals, motor_share
from ...assembly.free_motions import free_motions, own_inertia
from ...description.lost_loops import lost_loops
from ...description.names import LISTED_NAMES, listed
from ...linkage.reduction import ROUNDED_ROWS
from ...spatial import Array
from ...structure.module import Module
from ...structure.robot import HybridRobot
from .finding import Finding
from .subject import Subject


def check_modules(subject: Subject) -> Iterator[Finding]:
    """Judge every module; of equal modules the first."""
    robot = subject.robot
    if robot is None:
        return
    if robot.mobility and not robot.motors:
        yield Finding(
            "no-motors",
            "",
            f"no motor for {_counted(robot.mobility, 'freedom')} ({subject.description.motors_from})",
            "inverse dynamics has nothing to give, and simulations fall freely",
            "write motors = [...] in model.toml, <transmission> in the URDF or name_mot in robot.yaml",
            subject.description.source,
        )
    told: set[int] = set()
    for module, open_by in zip(robot.modules, home_residuals(robot), strict=True):
        if id(module.mechanism) in told or not module.joints or module.joints[0] not in subject.joints:
            continue  # a free base is no joint of the file
        told.add(id(module.mechanism))
        yield from _Judge(subject, robot, module, open_by).findings()


def check_lost_loops(subject: Subject) -> Iterator[Finding]:
    """Tell the signs of loops that the files do not state."""
    why = "opened as a tree it is another robot: too many motors, and efforts that are not its own"
    for sign in lost_loops(subject.description):
        told = (sign.message, why, sign.mend)
        if sign.link:
            yield subject.of_link("lost-loops", sign.link, *told)
        elif sign.joint:
            yield subject.of_joint("lost-loops", sign.joint, *told)
        else:
            yield Finding("lost-loops", "", *told, subject.places.file)


def _counted(number: int, thing: str) -> str:
    return f"{number} {thing}" + ("" if number == 1 else "s")


def _named(motions: tuple[str, ...]) -> str:
    """Return motions by name, each once, many of them shortened."""
    names = [*dict.fromkeys(motions)]
    more = f" and {len(names) - LISTED_NAMES} more" if len(names) > LISTED_NAMES else ""
    return ", ".join(names[:LISTED_NAMES]) + more


class _Judge:
    """The judge of one module."""

    def __init__(self, subject: Subject, robot: HybridRobot, module: Module, open_by: float) -> None:
        self.subject, self.robot, self.module, self.open_by = subject, robot, module, open_by

    def findings(self) -> Iterator[Finding]:
        """Give everything about the module."""
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
                "what starts at home must assemble first, and may find another branch than you think",
                "state a home posture that closes them ([home] in model.toml); 'hybridyn idm' finds one",
            )
        if not module.mobility:
            yield self._about(
                "locked",
                f"its {report.rank} independent closure rows leave its {m.reduction.n} freedoms no motion",
                "nothing can move; a plan for such a module has no solution",
                "a weld ('6d', 'fixed') where a hinge or a ball is meant? Check types and axes of "
                f"{listed(module.closures)}",
            )
        if (spare := report.rows - report.rank) > 0:
            rounded = report.dropped > ROUNDED_ROWS
            yield self._about(
                "rounded" if rounded else "redundant-closures",
                f"{spare} of {report.rows} closure rows say what others say"
                + (f", up to the file's rounding ({report.dropped:.1e} relative)" if rounded else ""),
                "wrenches inside the loops are not unique there; motion and motor efforts are",
                f"write more digits, if the mobility of {module.mobility} is not what you expect"
                if rounded
                else "nothing to do where that is meant; a spherical closure has fewer rows than a hinge",
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
                "no effort holds the platform along that motion, and no position of the motors tells it",
                "change the geometry (similar hexagons?) or the choice of motors",
            )
            return
        opposed = len(module.motors) - module.mobility + len(free.uncontrolled) + len(free.idle)
        counts = f"{_counted(len(module.motors), 'motor')} for {_counted(module.mobility, 'freedom')}"
        if free.uncontrolled and module.motors and opposed > 0:
            yield self._about(
                "motors-opposed",
                f"{counts}, but none drives the motion of {_named(free.uncontrolled)}, while {opposed} "
                "work against others",
                "efforts of that motion are missing, and others are not unique",
                "choose motors that move every freedom once: motors = [...] in model.toml",
            )
        elif free.uncontrolled and self.robot.motors:
            yield self._about(
                "motors-missing",
                f"{counts}: no motor drives the motion of {_named(free.uncontrolled)}",
                'idm refuses a motion that needs an effort there; passive="solved" lets it move freely',
                "add a motor, or leave the passive motion if it is meant",
            )
        elif opposed > 0:
            yield self._about(
                "motors-redundant",
                f"{counts}",
                "efforts are shared by effort limits or weights: many solutions move it alike",
                "pass --weights to idm where the sharing matters",
            )
        if free.idle:
            yield self._about(
                "idle-motion",
                f"the motion of {_named(free.idle)} moves no platform and no centre of mass",
                "a rod between two balls spins freely; its rate is taken as least, never as an error",
                "nothing to do; a universal joint in place of one ball removes it",
            )

    def _held_motors(self) -> Iterator[Finding]:
        m, module = self.module.mechanism, self.module
        if not module.motors or not module.mobility:
            return
        Psi = m.basis(m.generic_K[:1]).Psi[0] / m.reduction.col_scale[:, None]
        for name, column in zip(module.motors, module.motor_columns, strict=True):
            if np.abs(Psi[column]).max() < SINGULAR_POSTURE * np.abs(Psi).max():
                yield self._about(
                    "motor-cannot-move",
                    "is a motor, but the closures hold it at every posture",
                    "its effort is whatever you like, and moves nothing",
                    "another joint is the motor, or a closure has too many rows",
                    name,
                )

    def _masses(self) -> Iterator[Finding]:
        m, module = self.module.mechanism, self.module
        if not module.mobility:
            return
        Psi = m.basis(m.generic_K[:1]).Psi[0]
        if own_inertia(m, Psi).max() <= 0.0:
            if not self._carries():
                yield self._about(
                    "no-mass",
                    "none of its bodies has mass, and it carries nothing",
                    "its direct dynamics has no solution",
                    "add <inertial> to its links",
                )
            return
        for name in free_motions(module).massless:
            yield self._about(
                "massless-motion",
                f"the motion of {name} has no inertia",
                "an effort along it would accelerate it without limit: ddm and simulate need inertia there",
                "give the link an <inertial>, or the joint a rotor_inertia in model.toml",
            )

    def _carries(self) -> bool:
        """Say whether a module with mass stands on this one."""
        number = next(i for i, other in enumerate(self.robot.modules) if other is self.module)
        return any(other.parent == number for other in self.robot.modules)

    def _singular_home(self) -> Iterator[Finding]:
        m, module = self.module.mechanism, self.module
        if not module.closures or not module.mobility:
            return
        basis = m.basis(m.closures.matrix(m.tree.sweep(m.home[None])))
        if basis.pivot[0] < SINGULAR_POSTURE:
            yield self._about(
                "singular-closures",
                f"its closures lose rank at the home posture (smallest pivot {basis.pivot[0]:.1e})",
                "more motions are possible there for an instant, and two branches meet",
                "choose another home posture: [home] in model.toml",
            )
            return
        share = motor_share(module, basis.Psi)
        usual = motor_share(module, m.basis(m.generic_K).Psi)
        if share is not None and usual is not None and share[0] < SINGULAR_POSTURE <= np.median(usual):
            yield self._about(
                "singular-parallel",
                f"with its motors locked it still moves at the home posture (share of the motors "
                f"{share[0]:.1e})",
                "efforts grow without bound there",
                "choose another home posture, away from this one",
            )
        lost = self._serial_loss(basis.Psi)
        if lost is not None:
            yield self._about(
                "singular-serial",
                f"its platform '{module.outputs[0]}' loses a direction at the home posture ({lost:.1e} of "
                "what is usual): a leg is stretched or folded",
                "the platform cannot be asked to move that way there",
                "choose another home posture, away from this one",
            )

    def _serial_loss(self, Psi: Array) -> float | None:
        """Give how little the outputs move along the motion that moves them least, where that is singular."""
        m = self.module.mechanism
        if not m.spec.outputs:
            return None
        units = np.array([m.length] * 3 + [1.0] * 3)[:, None]

        def values(q: Array, Psi: Array) -> Array:
            motion = m.tree.sweep(q)
            J = np.concatenate([m.tree.jacobian(motion, body) / units for body in m.spec.outputs], axis=1)
            motions = np.linalg.qr(Psi / m.reduction.col_scale[:, None])[0]
            scaled = J @ (motions * m.reduction.col_scale[:, None])
            out: Array = np.linalg.svd(scaled, compute_uv=False).astype(float)
            return out

        usual = np.median(values(m.postures, m.basis(m.generic_K).Psi), axis=0)
        rank = int(np.sum(usual > SINGULAR_POSTURE * usual[0]))
        if not rank:
            return None
        least = float(values(m.home[None], Psi)[0, rank - 1] / usual[0])
        return least if least < SINGULAR_POSTURE else None
