"""Derivatives of numbers that have no equations, against closed forms."""

import numpy as np
import pytest

from hybridyn.errors import ModelError
from hybridyn.gradients.slot_changes import changes_of
from hybridyn.spatial import Array
from hybridyn.structure.parameters.entries import Numbers

#: Rounding of numbers over a tenth of their interval, with the weights of a polynomial of degree seven.
AGREE = 1e-11


def numbers(p: Array) -> Numbers:
    """Return a number of its own, an offset, a curve, and what follows the other parameter alone."""
    x, y = p.T
    return np.stack([x, 0.3 + x, x**3, np.sin(3 * x) + 0.1 * y, y], axis=1), {}


@pytest.mark.parametrize("x", [0.0, 1e-20, 1e-12, 1e-9, 1e-5, 1e-2, -0.3, 40.0])
def test_no_digits_are_lost_near_zero(x: float) -> None:
    found = changes_of(numbers, np.array([x, 2.0]))
    wanted = [[1, 0], [1, 0], [3 * x**2, 0], [3 * np.cos(3 * x), 0.1], [0, 1]]
    # a parameter of forty has an interval of 0.8, in which the sine of three times as much turns once
    keep = [0, 1, 2, 4] if x == 40.0 else slice(None)
    assert np.abs(found - wanted)[keep].max() <= AGREE * max(1.0, 3 * x**2)
    assert not found[4, 0]


@pytest.mark.parametrize("power", [1, 2])
def test_a_range_may_be_much_wider_than_its_least_number(power: int) -> None:
    """A polynomial over a part of the range does not follow 1 / p where p is small."""
    found = changes_of(lambda p: (1 / p**power, {}), np.array([1e-3]), np.array([[1e-3, 0.1]]))
    assert found[0, 0] == pytest.approx(-power * 1e-3 ** (-power - 1), rel=AGREE)


@pytest.mark.parametrize("x", [0.0, 1e-9])
def test_near_zero_a_range_is_the_interval(x: float) -> None:
    """In micrometres, say: a step of 1e-3 leaves few digits beside 3e5."""
    found = changes_of(lambda p: (3e5 + p, {}), np.array([x]), np.array([[-1e5, 1e5]]))
    assert found[0, 0] == pytest.approx(1.0, rel=AGREE)


def root(p: Array) -> Numbers:
    """Return what is possible from 0.2 on."""
    errors = {int(i): ModelError("too short") for i in np.flatnonzero(p[:, 0] < 0.2)}
    return np.sqrt(np.where(p < 0.2, np.nan, p - 0.1)), errors


@pytest.mark.parametrize("ranges", [None, [[0.2, 0.3]], [[0.2, np.inf]]])
def test_at_a_bound_points_lie_on_one_side(ranges: object) -> None:
    bounds = None if ranges is None else np.array(ranges)
    found = changes_of(root, np.array([0.2]), bounds)
    assert abs(found[0, 0] - 0.5 / np.sqrt(0.1)) <= AGREE


def test_what_is_not_possible_on_either_side_is_an_error() -> None:
    def alone(p: Array) -> Numbers:
        return p, {int(i): ModelError("no") for i in np.flatnonzero(p[:, 0] != 0.2)}

    for at in (0.2, 0.5):
        with pytest.raises(ModelError, match="no"):
            changes_of(alone, np.array([at]))
