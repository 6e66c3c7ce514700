"""`hybridyn idm`: compute the motor efforts for a motion, and what they say of motors, joints and effects."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..description.loop_signs import has_mass
from ..description.names import did_you_mean
from ..dynamics.inverse import inverse_model
from ..effects import Effects, choose
from ..effects.choice import stated_names
from ..effects.words import DEFAULT, FROM_FILES
from ..errors import ModelError
from ..spatial import Array
from ..streams.departures import departures
from ..streams.one_pass import BlockResults, Pass
from ..streams.postures import TreeSamples
from ..streams.reaction_columns import reaction_rows
from ..structure.robot import HybridRobot
from ..tables.columns import SUPPLY
from ..tables.layout import Layout
from .common.each_table import for_each_table
from .common.engine_choice import EngineChoice, engine_for_table
from .common.one_table import CommandTables
from .common.options import RobotChoice, refuse
from .common.summary import Summary, about
from .common.table_pass import CommandPlan, Observer
from .common.table_pass import run as run_pass

if TYPE_CHECKING:
    from ..dynamics.reactions import Reactions
    from ..effects.dc_motors import OnDcMotors

#: Exit status where the motion exceeds a limit.
EXCEEDED = 1
#: Options whose result is a report.
REPORTS = ("loads", "bearings", "by_effect")

InnerRows = Callable[[HybridRobot, "Reactions"], Array]


def run(**words: Any) -> int:
    """Compute efforts, or a report on them, for each table."""
    return for_each_table(_one, words, report=any(words[name] for name in REPORTS))


def _one(
    load: RobotChoice, tables: CommandTables, loads: bool, bearings: bool, by_effect: bool,
    outputs: Sequence[str] | None, effects: tuple[str, ...], fail_on: str | None, engine: str | None,
    **model: Any,
) -> int:  # fmt: skip
    report = loads or bearings or by_effect
    refuse(
        (
            loads + bearings + by_effect + bool(outputs) > 1,
            "--loads, --bearings, --by-effect and --map exclude each other",
        ),
        (report and tables.reactions, "--reactions belongs to a table of efforts"),
        (
            by_effect and model != {"weights": {}, "passive": "given", "on_singular": "raise"},
            "--passive, --on-singular and --weights do not apply to --by-effect",
        ),
    )
    wanted = effects or (("model",) if report else ("default",))
    if by_effect:
        from .common.reports import tell_effects

        tell_effects(load, tables, wanted, engine)
        return 0

    plan = partial(
        _plan, tables=tables, loads=loads, bearings=bearings, outputs=outputs, effects=wanted, engine=engine,
        model=model,
    )  # fmt: skip
    left = run_pass(tables, load, plan, outputs=outputs or ())
    fails = (fail_on or ("limit" if loads else "never")) == "limit"
    return EXCEEDED if fails and any(left) else 0


def _plan(
    given: Pass, *, tables: CommandTables, loads: bool, bearings: bool, outputs: Sequence[str] | None,
    effects: Sequence[str], engine: str | None, model: dict[str, Any],
) -> CommandPlan:  # fmt: skip
    """Build the plan for a robot and a table.

    Args:
        model: Options of the inverse model: passive, on_singular, weights.
    """
    robot, layout, on = given.robot, given.layout, choose(given.robot, effects)
    dc, remarks = on.dc, about(robot, layout, on)
    if loads or bearings:  # the report on motors names what exceeds bounds; bearings do not ask
        on = on.unbounded
    _check(robot, layout, on, model["weights"], only_map=bool(outputs) and not on.names)
    obstacles = {
        "--bearings": bearings,
        "--reactions": bool(tables.reactions),
        "--passive solved": model["passive"] != "given",
        "--on-singular least-norm": model["on_singular"] != "raise",
        "--weights": bool(model["weights"]),
    }
    chosen = engine_for_table(engine, given, on, obstacles)
    inverse = partial(efforts, effects=on, engine=chosen, **model)
    if bearings:
        from ..studies.bearings import bearing_rows
        from .common.bearing_report import BearingReport

        states = partial(inverse, inner=bearing_rows)
        return CommandPlan(states, None, [BearingReport(robot, tables)], chosen, remarks)
    inverse = partial(inverse, inner=reaction_rows if tables.reactions else None)
    if loads:
        from .common.reports import LoadReport, motor_states

        states = partial(motor_states, efforts=inverse, dc=dc)
        return CommandPlan(states, None, [LoadReport(robot, tables, dc)], chosen, remarks)
    rows, columns, observers = _columns(robot, outputs, on, inverse)
    observers.append(Summary(robot, "effort", robot.effort_units, columns))
    return CommandPlan(rows, columns, observers, chosen, remarks)


def _columns(
    robot: HybridRobot, outputs: Sequence[str] | None, on: Effects, inverse: Callable[..., Any]
) -> tuple[Callable[..., Any], list[str], list[Observer]]:
    """Return what computes the columns of a table of efforts, their names, and who else is told of them."""
    columns, observers = [f"{name}/effort" for name in robot.motors], list[Observer]()
    if outputs:
        from ..studies.map_table import map_columns
        from .common.maps import MapSummary, map_rows

        columns = map_columns(robot, outputs, motion=True, efforts=bool(on.names), dc=on.dc)
        inverse = partial(map_rows, joints=outputs, efforts=inverse if on.names else None, dc=on.dc)
        observers.append(MapSummary(robot, outputs))
    elif on.dc is not None:
        columns += [f"{robot.motors[i]}/{what}" for what in SUPPLY for i in on.dc.motors]
        inverse = partial(with_supply, efforts=inverse, dc=on.dc)
    return inverse, columns, observers


def _check(
    robot: HybridRobot, layout: Layout, on: Effects, weights: Mapping[str, float], *, only_map: bool
) -> None:
    """Refuse weights of what is no motor, and a robot whose efforts would all be zero."""
    for name in weights:
        hint = did_you_mean(name, robot.motors)
        refuse((name not in robot.motors, f"--weights: there is no motor '{name}'{hint}"))
    idle = {*DEFAULT, *FROM_FILES, "limits"} - {*stated_names(robot)}
    loaded = layout.wrenches or not {*on.names} <= idle or has_mass(robot.description)
    if robot.motors and not loaded and not only_map:
        raise ModelError(
            "nothing has mass, so that every effort would be zero: give the links an <inertial>",
            file=robot.description.source,
        )


def with_supply(
    robot: HybridRobot, block: TreeSamples, *, efforts: Callable[..., BlockResults], dc: "OnDcMotors"
) -> BlockResults:
    """Compute the efforts of a block, and the currents and voltages of DC motors beside them."""
    made = efforts(robot, block)
    supply = dc.currents(made.rows), dc.voltages(made.rows, block.v[:, robot.motor_v])
    return made._replace(rows=np.concatenate([made.rows, *supply], axis=1))


def efforts(
    robot: HybridRobot, block: TreeSamples, *, effects: Effects, inner: InnerRows | None,
    engine: EngineChoice, weights: Mapping[str, float], **model: Any,
) -> BlockResults:  # fmt: skip
    """Compute the efforts of a block, shape (T, motors), and what is wanted of its reactions.

    Args:
        block: The motion.
        inner: Writes rows of reactions; None where none are wanted.
        engine: What computes.
        model: Options of `hybridyn.idm`, as `effects` and `weights` are.
    """
    if (compiled := engine.model) is not None:
        before = compiled.recomputed
        tau = compiled.idm(block.q, block.v, block.a)
        left = departures(robot, block.q, block.v, tau)
        again = compiled.recomputed - before
        return BlockResults(tau, handed_over=again, left=left, residual=compiled.closure_residual(block.q))
    found = inverse_model(
        robot,
        block.q,
        block.v,
        block.a,
        wrenches=block.motion.wrenches or None,
        weights=weights or None,
        effects=effects,
        time=block.motion.time,
        reactions=inner is not None,
        **model,
    )
    left = departures(robot, block.q, block.v, found.values)
    rows = None if inner is None or found.reactions is None else inner(robot, found.reactions)
    return BlockResults(found.values, rows, left=left, residual=found.residual)
