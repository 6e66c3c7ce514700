/* Sine and cosine of doubles D, numbers or lanes, with an error under one unit in the last place.

   x = n pi/2 + (hi + lo) by Cody and Waite: pi/2 in parts of 33 bits, so that n times a part is exact for
   n < 2^20; lo keeps what rounding takes from hi. Polynomials in z = hi^2, by Remez' exchange on
   |hi| <= pi/4: relative errors 2^-58 (sine), 2^-64 (cosine). A lane whose |x| is beyond LIMIT, or not a
   number, is left to the C library; the other lanes do not see it. */
#define LIMIT 1e6
#ifdef DOUBLE
#define SINCOS_D SINCOS
#define ANY_D ANY
#else
INLINE int ANY_D(MD m) {
    int any = 0;
    for (int i = 0; i < W; i++) any |= LANE(m, i) != 0;
    return any;
}
#endif

SELDOM void far_away(const D *x, D *s, D *c) {
    for (int i = 0; i < W; i++) {
        const double u = LANE(*x, i);
        if (!(__builtin_fabs(u) <= LIMIT)) {
            LANE(*s, i) = __builtin_sin(u);
            LANE(*c, i) = __builtin_cos(u);
        }
    }
}

INLINE void SINCOS_D(D x, D *s, D *c) {
    const D t = x * CD(0x1.45f306dc9c883p-1) + CD(ROUND);
    const D n = t - CD(ROUND);
    const D a = x - n * CD(0x1.921fb544p+0);
    const D w = n * CD(0x1.0b4611a6p-34);
    const D b = a - w;
    const D y = ((a - b) - w) - n * CD(0x1.3198a2e037073p-69);
    const D hi = b + y;
    const D lo = (b - hi) + y;

    const D z = hi * hi;
    D p = FMA_D(z, CD(0x1.5d93010a5c028p-33), CD(-0x1.ae5e663a92af1p-26));
    p = FMA_D(z, p, CD(0x1.71de3577b64e8p-19));
    p = FMA_D(z, p, CD(-0x1.a01a019c11987p-13));
    p = FMA_D(z, p, CD(0x1.111111110f87ap-7));
    p = FMA_D(z, p, CD(-0x1.5555555555549p-3));
    D q = FMA_D(z, CD(-0x1.8fae9d067ed71p-37), CD(0x1.1ee9ebea50e6fp-29));
    q = FMA_D(z, q, CD(-0x1.27e4f809f26e7p-22));
    q = FMA_D(z, q, CD(0x1.a01a019cb1c08p-16));
    q = FMA_D(z, q, CD(-0x1.6c16c16c1517ep-10));
    q = FMA_D(z, q, CD(0x1.555555555554cp-5));
    const D half = z * CD(0.5);
    const D one = CD(1.0) - half;
    const D sine = hi + FMA_D(hi * z, p, lo * one);
    const D cosine = one + (((CD(1.0) - one) - half) + FMA_D(z * z, q, -(hi * lo)));

    const MD k = BITS_OF(t), odd = -(k & 1);
    const D u = SELECT_D(odd, cosine, sine), v = SELECT_D(odd, sine, cosine);
    *s = WITH_BITS(BITS_OF(u) ^ ((k & 2) << 62));
    *c = WITH_BITS(BITS_OF(v) ^ (((k + 1) & 2) << 62));
    const MD far = (BITS_OF(x) & ~BITS_OF(CD(-0.0))) > BITS_OF(CD(LIMIT)); /* so are numbers that are none */
    if (__builtin_expect(ANY_D(far), 0)) far_away(&x, s, c);
}
#ifndef DOUBLE
SELDOM void SINCOS(V x, V *s, V *c) {
    D a, b;
    SINCOS_D(TO(D, x), &a, &b);
    *s = TO(V, a);
    *c = TO(V, b);
}
#endif
