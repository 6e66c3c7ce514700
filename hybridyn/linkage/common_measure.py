"""The greatest common divisor of coefficients, which tells how often a coupling of endless joints repeats."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import gcd, lcm
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fractions import Fraction

#: A ratio of coefficients is replaced by the simplest fraction within this relative error, the rounding of
#: the file's decimals. With a denominator of more than `DIGITS` digits, neighbouring phases of a gear could
#: not be told apart.
FRACTION, DIGITS = 1e-13, 6
#: Largest relative error of a fraction with such a denominator: after a thousand turns it opens a coupling by
#: less than what counts as closed. Ratios such as 0.3333333 need larger denominators.
FRACTION_AT_MOST = 1e-10


def common_measure(numbers: Sequence[float]) -> float:
    """Compute the greatest common divisor of numbers with rational ratios; 0 if there are none."""
    return _measure(tuple(numbers))


@lru_cache(maxsize=1024)
def _measure(numbers: tuple[float, ...]) -> float:
    """Compute `common_measure`, cached: the same few couplings need it at every step."""
    sizes = [abs(x) for x in numbers if x]
    if not sizes:
        return 0.0
    ratios = [_fraction(x / sizes[0]) for x in sizes]
    denominator = lcm(*(r.denominator for r in ratios))
    return sizes[0] * gcd(*(int(r * denominator) for r in ratios)) / denominator


def _fraction(x: float) -> Fraction:
    """Return the simplest fraction within `FRACTION` of x, or `FRACTION_AT_MOST` for large denominators."""
    from fractions import Fraction  # only couplings of endless joints need it

    exact, digits = Fraction(x), 1
    while True:
        rough = exact.limit_denominator(10**digits)
        within = FRACTION if digits < DIGITS else FRACTION_AT_MOST
        if abs(rough - exact) <= within * abs(exact):
            return rough
        digits += 1
