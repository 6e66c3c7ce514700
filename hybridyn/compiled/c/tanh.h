/* Hyperbolic tangent of doubles D, numbers or lanes, with an error under two units in the last place.

   Lambert's continued fraction up to 17 gives tanh y = y - y z N / B of z = y^2, polynomials with whole, positive
   coefficients, with a relative error under 2^-57 on |y| <= SMALL. Up to there y is |x|. Beyond,
   |x| = n ln 2 / 2 + y by Cody and Waite, with ln 2 / 2 in parts of 33 bits. There tanh(n ln 2 / 2) is
   (s - 1) / (s + 1) with s = 2^n, and the theorem of addition gives, with A = B - z N,
   1 - tanh |x| = (B - y A) / (B (s + 1) / 2 + y A (s - 1) / 2). So both are a difference, rounded once. What is
   subtracted is below 0.19 with six roundings, or below 0.29 with five: 1.9 units in all. At 20 it is lost in
   the rounding of 1. No lane branches. */
#define SMALL 0.9
#ifdef DOUBLE
#define TANH_D TANH
#endif

INLINE D TANH_D(D x) {
    const D size = WITH_BITS(BITS_OF(x) & ~BITS_OF(CD(-0.0)));
    const D least = SELECT_D(BELOW(CD(20.0), size), CD(20.0), size); /* no number stays none */
    const MD small = BELOW(least, CD(SMALL));
    const D t = SELECT_D(small, CD(ROUND), least * CD(0x1.71547652b82fep+1) + CD(ROUND));
    const D n = t - CD(ROUND);
    const D half = WITH_BITS((BITS_OF(t) + 1022) << 52); /* s / 2 */
    const D y = (least - n * CD(0x1.62e42fefp-2)) - n * CD(0x1.473de6af278edp-35);

    const D z = y * y;
    D p = FMA_D(z, CD(44.0), CD(12870.0));
    p = FMA_D(z, p, CD(810810.0));
    p = FMA_D(z, p, CD(11486475.0));
    D b = FMA_D(z, CD(45.0), CD(13860.0));
    b = FMA_D(z, b, CD(945945.0));
    b = FMA_D(z, b, CD(16216200.0));
    b = FMA_D(z, b, CD(34459425.0));
    const D u = y * z * p;
    const D a = FMA_D(y, b, -u);
    const D over = SELECT_D(small, u, b - a);
    const D under = FMA_D(half + CD(0.5), b, (half - CD(0.5)) * a);
    const D tangent = SELECT_D(small, y, CD(1.0)) - over / under;
    return WITH_BITS(BITS_OF(tangent) | (BITS_OF(x) & BITS_OF(CD(-0.0))));
}
#ifndef DOUBLE
SELDOM V TANH(V x) { return TO(V, TANH_D(TO(D, x))); }
#endif
