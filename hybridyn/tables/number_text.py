"""Write arrays of numbers as text, with the characters of `repr`, all numbers at once.

The shortest decimal that reads as x has 15 to 17 digits, less zeros at its end. With x t in [1e16, 1e17), t a
power of ten, that product is exact as a sum of two doubles: x is exact, and so is t. A decimal of n digits
reads as x if it is nearer to the product than half the distance between doubles there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..description.records import Array

Bytes = NDArray[np.uint8]

#: Powers of ten that are doubles.
POWERS = np.array([float(f"1e{k}") for k in range(23)])
#: Zeros before the first digit of numbers below one: `repr` writes smaller numbers with an exponent.
ZEROS = 4
#: Digits of a number with its zeros, and room for its text: a sign, the digits, a point, a comma.
DIGITS, WIDTH = ZEROS + 17, 26
#: Distances between a decimal and x, or halves of steps, that are nearer than this are left to `repr`: ties.
TIED = 1e-6
#: The digits of numbers below 10,000, one row for each place.
FOUR = (48 + np.arange(10_000) // np.array([[1000], [100], [10], [1]]) % 10).astype(np.uint8)
#: Byte of a place without a character.
UNUSED = b"\0"
#: Numbers that are written at once: their arrays stay in the processor's cache.
AT_ONCE = 8192
#: Multiplied by it, a double splits into halves of 26 bits.
SPLIT = 2.0**27 + 1.0


def csv_text(rows: Array) -> str:
    """Return rows as lines of numbers separated by commas, as `repr` writes each number."""
    if not rows.size:
        return "\n" * len(rows)
    count = max(1, AT_ONCE // rows.shape[1])
    parts = [_lines(rows[i : i + count]) for i in range(0, len(rows), count)]
    return b"".join(parts).decode("ascii")


def _lines(rows: Array) -> bytes:
    """Write rows that are few enough to be written at once."""
    x = np.ascontiguousarray(rows, dtype=float).ravel()
    text = np.zeros((WIDTH, len(x)), np.uint8)
    for i in np.flatnonzero(~_fill(x, text)).tolist():
        text[:, i] = np.frombuffer(repr(float(x[i])).encode().ljust(WIDTH, UNUSED), np.uint8)
    text[-1] = ord(",")
    text[-1, rows.shape[1] - 1 :: rows.shape[1]] = ord("\n")
    return text.T.tobytes().translate(None, UNUSED)


def _fill(x: Array, text: Bytes) -> NDArray[np.bool_]:
    """Write numbers to columns of `text`; return which of them have been written, shape (n,)."""
    size = np.abs(x)
    good: NDArray[np.bool_] = (size >= 1.1e-4) & (size < 0.9e15) & (np.frexp(size)[0] != 0.5)
    nothing, size = size == 0.0, np.where(good, size, 1.5)
    exponent = np.floor(np.log10(size)).astype(np.int64)
    power: Array = POWERS[16 - exponent]
    high = size * power
    good &= (high >= 1e16) & (high < 0.9999e17)
    whole, rest = high.astype(np.int64), _rounding(size, power, high)
    number, tied = _shortest(whole, rest, 0.5 * np.asarray(np.spacing(size)) * power)
    good &= ~tied
    digits = np.full((DIGITS + 2, len(x)), ord("0"), np.uint8)  # one more row at both ends
    for k in (18, 14, 10, 6):
        number, all_four = number // 10_000, number
        np.take(FOUR, all_four - 10_000 * number, axis=1, out=digits[k : k + 4])
    digits[1 + ZEROS] += number.astype(np.uint8)
    last, point = np.zeros(len(x), np.uint8), (ZEROS + 1 + exponent).astype(np.uint8)
    for k in range(DIGITS):
        last = np.maximum(last, (digits[1 + k] != ord("0")) * np.uint8(k))
    first, end = np.minimum(ZEROS, point - 1), np.maximum(last, point) + 1
    for place in range(DIGITS + 1):  # digits behind the point move by one
        own = np.where(place < point, digits[1 + place], digits[place])
        own = np.where(place == point, np.uint8(ord(".")), own)
        np.multiply(own, (place >= first) & (place <= end), out=text[1 + place])
    text[1:, nothing] = np.frombuffer(b"0.0".ljust(WIDTH - 1, UNUSED), np.uint8)[:, None]
    text[0, np.signbit(x)] = ord("-")
    good |= nothing
    return good


def _rounding(x: Array, y: Array, product: Array) -> Array:
    """Compute x y less its rounded product, exactly (Dekker)."""
    (a, b), (c, d) = ((s := SPLIT * v - (SPLIT * v - v), v - s) for v in (x, y))
    out: Array = ((a * c - product) + a * d + b * c) + b * d
    return out


def _shortest(
    whole: NDArray[np.int64], rest: Array, half: Array
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the shortest decimal within `half` of whole + rest, as 17 digits, and where that is not certain.

    The decimals of 15 digits within `half` are one at most, so that shorter ones are that one.
    """
    out, found = whole.copy(), np.zeros(len(whole), bool)
    tied = np.zeros(len(whole), bool)
    for step in (100, 10, 1):
        count = whole // step
        past = (whole - step * count) + rest
        more = np.rint(past * (1.0 / step))
        off = np.abs(past - step * more)
        tied |= ~found & ((np.abs(off - half) < TIED) | (np.abs(off - 0.5 * step) < TIED))
        here = ~found & (off < half)
        np.copyto(out, step * (count + more.astype(np.int64)), where=here)
        found |= here
    return out, tied | ~found
