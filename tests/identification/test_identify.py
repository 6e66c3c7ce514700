"""Identification of known numbers, and what it says where a model or a log is wrong."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import stats

import hybridyn
from hybridyn.effects import Payload
from hybridyn.errors import HybridynError, ModelError, TrajectoryError
from hybridyn.identification.base_parameters import base_parameters
from hybridyn.identification.estimators import estimate
from hybridyn.identification.logs import read_log
from hybridyn.identification.possible import Possible, consistent, pseudo_inertia
from hybridyn.identification.rows import LogSource
from hybridyn.identification.sought import linear_model
from tests.identification.logs import PERIOD, Case, Table, case
from tests.support.extras import needs
from tests.support.samples import slow

#: Base parameters without noise, of the largest.
EXACT = 1e-9
#: Harmonics of the motions that a log holds.
BAND = 2.0
#: Probability with which a test of chance fails although all is right.
CHANCE = 1e-4
#: Runs whose errors are compared with their covariance.
RUNS = 80


def off(found: hybridyn.Identification, of: Case) -> float:
    return float(np.abs(found.values - of.base).max() / np.abs(of.base).max())


@pytest.mark.parametrize(
    ("name", "symmetric"),
    [("five_bar", False), slow("delta", True), slow("delta", False), slow("gough_stewart", False),
     slow("gough_stewart", True), slow("rps3", True), slow("lx4", True)],
)  # fmt: skip
def test_without_noise_base_parameters_come_back(name: str, symmetric: bool) -> None:
    """From positions and efforts alone, and from rates as well; the identified robot has them."""
    needs("identify")
    one = case(name, symmetric)
    for log, words in ((one.log(), {"period": PERIOD, "band": BAND}), (one.log(rates=True), {})):
        found = hybridyn.identify(one.robot, log, symmetric=symmetric, **words)
        assert off(found, one) <= EXACT
        assert np.abs(found.of_robot - one.base).max() <= EXACT * np.abs(one.base).max()
        assert found.fit.relative.max() <= EXACT


def test_the_filter_leaves_little_behind() -> None:
    """Columns that are no numbers are left alone."""
    one = case("five_bar")
    log = one.log() | {"phase": np.full(len(one.time), "moving")}
    assert off(hybridyn.identify(one.robot, log, symmetric=True), one) <= 1e-4


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ({"prior": 0.0}, "the prior must be above 0"),
        ({"every": 0}, "every at least 1"),
        ({"every": 10_000}, "1 sample of 2 motors cannot determine 15 parameters: record a longer motion"),
        ({"band": 90.0}, "the band of 90 Hz must lie between 0 and 0.4 of the rate, 80 Hz"),
        ({"method": "iv"}, "takes a reference"),
        ({"method": "wsl"}, "did you mean 'wls'"),
    ],
)
def test_impossible_wishes_are_refused(words: dict[str, Any], says: str) -> None:
    one = case("five_bar")
    with pytest.raises(HybridynError, match=says):
        hybridyn.identify(one.robot, one.log(), **words)


def rows(of: Case) -> np.ndarray:
    """Return Y of the base parameters, shape (T, motors, rank)."""
    base = base_parameters(of.robot, effects="model", symmetric=True)
    source = LogSource(of.robot, linear_model(base), None, every=2)
    return source.rows(read_log(of.robot, of.log(rates=True))).Y


@pytest.mark.parametrize("method", ["wls", "irls", "iv"])
def test_errors_are_those_of_the_cramer_rao_bound(method: str) -> None:
    """Each motor has noise of its own: errors over their covariance are chi-square."""
    one = case("five_bar")
    Y = rows(one)
    tau, rng, names = Y @ one.base, np.random.default_rng(2), [str(i) for i in range(Y.shape[2])]
    spread = 0.02 * tau.std(axis=0) * [3.0, 0.3]
    sums = []
    for _ in range(RUNS):
        found = estimate(Y, tau + spread * rng.normal(size=tau.shape), names, method, Y)
        sums.append(float(np.sum(np.linalg.solve(found.root, found.x - one.base) ** 2)))
    low, high = stats.chi2.ppf([CHANCE, 1 - CHANCE], RUNS * len(names)) / RUNS / len(names)
    assert low * 0.95 <= np.mean(sums) / len(names) <= high * 1.05  # 5 %: the noise itself is estimated
    bound = stats.kstest(sums, stats.chi2(len(names)).cdf).pvalue
    assert bound > CHANCE


def test_outliers_count_little_in_the_robust_estimate() -> None:
    one = case("five_bar")
    Y, rng = rows(one), np.random.default_rng(3)
    tau = Y @ one.base
    tau = tau + 0.02 * tau.std() * rng.normal(size=tau.shape)
    tau[rng.random(tau.shape) < 0.05] += 3.0
    names = [str(i) for i in range(Y.shape[2])]
    plain, robust = (estimate(Y, tau, names, method) for method in ("wls", "irls"))
    assert np.linalg.norm(robust.x - one.base) < 0.2 * np.linalg.norm(plain.x - one.base)
    assert np.mean(robust.weights < 0.5) > 0.03


@pytest.mark.parametrize(("runs", "rate"), [(6, 50.0), slow(40, 100.0)])
def test_instruments_are_unbiased_where_least_squares_is_not(runs: int, rate: float) -> None:
    """Noise of the encoders makes accelerations noisy: least squares takes inertias for too small.

    The rows are those of `identify`, with which the first log is compared.
    """
    one = case("five_bar", rate=rate)
    command, rng, means = one.log(), np.random.default_rng(4), {}
    base = base_parameters(one.robot, effects="model", symmetric=True)
    source = LogSource(one.robot, linear_model(base), None, band=15.0, every=1)
    errors: dict[str, list[np.ndarray]] = {"wls": [], "iv": []}
    instruments = None
    for _ in range(runs):
        log = one.log(tau=one.tau + 0.01 * rng.normal(size=one.tau.shape))
        for motor in one.robot.motors:
            log[f"{motor}/position"] = log[f"{motor}/position"] + 3e-4 * rng.normal(size=len(one.time))
        data = source.rows(read_log(one.robot, log))
        if instruments is None:
            instruments = source.instruments(read_log(one.robot, command, efforts=False), data)
            whole = hybridyn.identify(
                one.robot, log, symmetric=True, method="iv", reference=command, band=15.0, every=1
            )
        for method, other in (("wls", None), ("iv", instruments)):
            found = estimate(data.Y, data.measured - data.known, base.names, method, other)
            errors[method].append(found.x - one.base)
    np.testing.assert_array_equal(whole.values - one.base, errors["iv"][0])
    for method, all_ in errors.items():
        spread = np.std(all_, axis=0, ddof=1) / np.sqrt(runs)
        means[method] = np.abs(np.mean(all_, axis=0) / spread).max()
    limit = stats.t.ppf(1 - CHANCE / len(one.base), runs - 1)
    assert means["iv"] < limit < means["wls"]


def test_a_friction_left_out_is_seen() -> None:
    """Noise alone passes the test; without the friction in the model, the residual is no noise."""
    one = case("five_bar", rate=100.0)
    rng = np.random.default_rng(5)
    log = one.log(tau=one.tau + 0.02 * one.tau.std() * rng.normal(size=one.tau.shape))
    words = {"symmetric": True, "period": PERIOD, "band": BAND}
    assert not hybridyn.identify(one.robot, log, **words).fit.coloured.any()
    assert hybridyn.identify(one.robot, log, effects=None, **words).fit.coloured.all()


def test_a_payload_that_was_not_told_is_seen_in_a_second_motion() -> None:
    """The first motion is without the payload; then the payload itself is identified, all else known."""
    one, rng = case("five_bar", rate=100.0), np.random.default_rng(6)

    def measured(of: hybridyn.HybridRobot) -> Table:
        """Return a log of the motion, backwards in time, with noise."""
        motion = one.motion[0][::-1], -one.motion[1][::-1], one.motion[2][::-1]
        tau = hybridyn.idm(of, *hybridyn.assemble(of, motors=motion), effects="model")
        back = one._replace(motion=motion)
        return back.log(tau=tau + 0.02 * tau.std() * rng.normal(size=tau.shape))

    words = {"symmetric": True, "period": PERIOD, "band": BAND}
    log = one.log(tau=one.tau + 0.02 * one.tau.std() * rng.normal(size=one.tau.shape))
    loaded = hybridyn.with_effects(one.true, [Payload("m1_tool", mass=0.2)])
    told = hybridyn.identify(one.robot, log, validate=measured(one.true), **words)
    untold = hybridyn.identify(one.robot, log, validate=measured(loaded), **words)
    assert told.validation is not None
    assert untold.validation is not None
    assert not told.validation.coloured.any()
    assert untold.validation.coloured.all()
    guess = hybridyn.with_effects(told.identified, [Payload("m1_tool", mass=0.1)])
    found = hybridyn.identify(guess, measured(loaded), only=["m of payload*"], **words)
    assert found.names == ("m of payload on m1_tool",)
    assert abs(found.values[0] - 0.2) < 0.05  # the first estimate errs, too


def test_currents_give_a_constant_for_each_motor() -> None:
    """Masses and centres are known, so that efforts have a scale."""
    one = case("five_bar", rate=50.0)
    constants = np.array([0.5, 0.8])
    log = one.log(tau=one.tau / constants, of="current")
    with pytest.raises(TrajectoryError, match="log has currents"):
        hybridyn.identify(one.true, log, symmetric=True, period=PERIOD, band=BAND)
    found = hybridyn.identify(one.true, log, symmetric=True, period=PERIOD, band=BAND, known=["m*"])
    assert found.constants is not None
    np.testing.assert_allclose(found.constants[0], constants, rtol=1e-9)


def shorter(log: Table, motors: tuple[str, ...]) -> None:
    for name in log:
        log[name] = log[name][:40]


def still(log: Table, motors: tuple[str, ...]) -> None:
    log[f"{motors[1]}/position"] = log[f"{motors[1]}/position"] * 0 + 0.1


def scaled(what: str, factor: float) -> Callable[[Table, tuple[str, ...]], None]:
    def change(log: Table, motors: tuple[str, ...]) -> None:
        for name in log:
            if name == what or name.endswith(f"/{what}"):
                log[name] = log[name] * factor

    return change


def turned(log: Table, motors: tuple[str, ...]) -> None:
    log[f"{motors[0]}/effort"] = -log[f"{motors[0]}/effort"]


def left_out(log: Table, motors: tuple[str, ...]) -> None:
    del log[f"{motors[0]}/effort"]


def one_row_less(log: Table, motors: tuple[str, ...]) -> None:
    log["time"] = log["time"][:-1]


def backwards(log: Table, motors: tuple[str, ...]) -> None:
    log["time"] = np.where(np.arange(800) == 300, log["time"][298], log["time"])


def twice(log: Table, motors: tuple[str, ...]) -> None:
    log["time"] = log["time"][np.r_[:300, 299, 301:800]]


def not_finite(log: Table, motors: tuple[str, ...]) -> None:
    log[f"{motors[0]}/effort"] = np.where(log["time"] > 1, np.inf, 1.0)


def ends_early(log: Table, motors: tuple[str, ...]) -> None:
    log[f"{motors[0]}/effort"] = np.where(log["time"] > 1, np.nan, 1.0)


def interrupted(log: Table, motors: tuple[str, ...]) -> None:
    for name in log:
        log[name] = np.delete(log[name], slice(300, 330))


def ambiguous(log: Table, motors: tuple[str, ...]) -> None:
    log[f"/joint_states/{motors[0]}/position"] = log.pop(f"{motors[0]}/position")
    log[f"/reference/{motors[0]}/position"] = log[f"/joint_states/{motors[0]}/position"]


REFUSED = {
    "40 samples are too few": shorter,
    "'m1_right_drive' never moves: move every motor": still,
    "degrees\\? Positions are in m and rad": scaled("position", 180 / np.pi),
    "N mm or mN\\? Efforts are in N and N m": scaled("effort", 1e3),
    "kN\\?": scaled("effort", 1e-3),
    "milliseconds\\? Times are in s": scaled("time", 1e3),
    "column 'm1_left_drive/effort': efforts have the opposite sign": turned,
    "column 'm1_right_drive/effort': .* N mm": scaled("m1_right_drive/effort", 1e3),
    "column 'm1_right_drive/effort': is -?0 in every row": scaled("m1_right_drive/effort", 0.0),
    "have 799 to 800 rows: give columns of one length": one_row_less,
    "column 'm1_left_drive/effort': is missing": left_out,
    "row 301, column 'time': 1.49 s does not come after 1.495 s: sort the rows": backwards,
    "row 301, column 'time': 1.495 s does not come after 1.495 s": twice,
    "row 202: a number is not finite": not_finite,
    "row 202, column 'm1_left_drive/effort': has no number for 2.995 s: at most 10 of its steps": ends_early,
    "row 301, column .*: has no number for 0.155 s: .* cut the log there": interrupted,
    "one of 2 columns that could be 'm1_left_drive/position'": ambiguous,
}


@pytest.mark.parametrize("words", REFUSED)
def test_bad_logs_are_refused_in_one_line(words: str) -> None:
    one = case("five_bar")
    log = dict(one.log())
    REFUSED[words](log, one.robot.motors)
    with pytest.raises(HybridynError, match=words) as error:
        hybridyn.identify(one.robot, log, symmetric=True, period=log["time"][-1] * 800 / 799, band=None)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("words", "options"),
    [("the base is floating", {"base": "floating"}), ("the robot has no motors", {"motors": []})],
    ids=["floating", "without"],
)
def test_robots_whose_motors_do_not_say_how_they_move_are_refused(
    words: str, options: dict[str, Any]
) -> None:
    robot = hybridyn.load("five_bar", **options)
    with pytest.raises(ModelError, match=words):
        hybridyn.identify(robot, case("five_bar").log())
    with pytest.raises(ModelError, match=words):
        hybridyn.excitation(robot)


def test_a_motion_that_is_too_poor_names_what_it_does_not_tell() -> None:
    """One slow harmonic of all motors alike tells few parameters."""
    one = case("five_bar", rate=50.0)
    x = np.tile(0.1 * np.sin(2 * np.pi * one.time / PERIOD)[:, None], 2)
    log = one._replace(motion=(x, x, x)).log()
    with pytest.raises(TrajectoryError, match=r"the motion does not tell .* rank .* record a richer motion"):
        hybridyn.identify(one.robot, log, symmetric=False, period=PERIOD, band=BAND)


def test_the_conic_program_finds_the_nearest_body_that_can_exist() -> None:
    """A body whose inertia the noise has made impossible becomes possible, and stays near."""
    needs("identify")
    prior = np.array([2.0, 0.1, 0.0, 0.2, 0.05, 0.0, 0.06, 0.0, 0.0, 0.04])
    bad = prior.copy()
    bad[4] = -0.01
    least = np.where(np.arange(10) == 0, 0.0, -np.inf)
    steps = np.diag(np.abs(prior) + 0.01)

    def found(base: np.ndarray) -> Possible:
        """Find the possible numbers near some."""
        return consistent(np.eye(10), base, 1e-3 * np.eye(10), prior, steps, [np.arange(10)], least)

    x, constrained, remark = found(bad)
    assert constrained
    assert not remark
    assert np.linalg.eigvalsh(pseudo_inertia(x)).min() > 0
    assert np.abs(x - bad).max() < 0.1
    same, constrained, _ = found(prior)
    assert not constrained
    np.testing.assert_allclose(same, prior, rtol=1e-12)


def test_outliers_of_positions_are_replaced() -> None:
    one = case("five_bar")
    log = dict(one.log())
    name = f"{one.robot.motors[0]}/position"
    log[name] = log[name].copy()
    log[name][[100, 333]] += 0.3
    found = hybridyn.identify(one.robot, log, symmetric=True, period=PERIOD, band=BAND)
    assert "2 outliers of positions replaced" in found.remarks
    assert off(found, one) <= 1e-6
