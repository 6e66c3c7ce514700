/* Exponential of doubles D, numbers or lanes, with an error under 1.4 units in the last place.

   x = n ln 2 + y by Cody and Waite, with ln 2 in parts of 33 bits. Lambert's continued fraction up to 11 gives
   tanh h = h A / B of h = y / 2, z = h^2, with a relative error under 2^-60, and
   exp y = (B + h A) / (B - h A) = 1 + y + 2 z (A - h N) / (B - h A), where N = (B - A) / z. What stands behind y
   is below 0.07 with six roundings, y has one. 2^n is two factors, so that what is below the normal numbers
   is rounded once more. Beyond 710 and -746 it is infinite and zero. No lane branches. */
#ifdef DOUBLE
#define EXP_D EXP
#endif

INLINE D EXP_D(D x) {
    const D least = SELECT_D(BELOW(CD(710.0), x), CD(710.0), x); /* no number stays none */
    const D near = SELECT_D(BELOW(least, CD(-746.0)), CD(-746.0), least);
    const D n = (near * CD(0x1.71547652b82fep+0) + CD(ROUND)) - CD(ROUND);
    const D y = (near - n * CD(0x1.62e42fefp-1)) - n * CD(0x1.473de6af278edp-34);

    const D h = y * CD(0.5), z = h * h;
    const D p = FMA_D(z, FMA_D(z, CD(1.0), CD(189.0)), CD(3465.0));
    const D a = FMA_D(z, FMA_D(z, CD(21.0), CD(1260.0)), CD(10395.0));
    const D under = FMA_D(z, p, a) - h * a;
    const D power = (z + z) * (a - h * p) / under + y + CD(1.0);
    const D t = n * CD(0.5) + CD(ROUND); /* n / 2, rounded */
    const D u = (n - (t - CD(ROUND))) + CD(ROUND);
    return power * WITH_BITS((BITS_OF(t) + 1023) << 52) * WITH_BITS((BITS_OF(u) + 1023) << 52);
}
#ifndef DOUBLE
SELDOM V EXP(V x) { return TO(V, EXP_D(TO(D, x))); }
#endif
