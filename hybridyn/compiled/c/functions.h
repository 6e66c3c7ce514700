/* The functions of kernels. Needs LANES1, LANES2 and SCALAR, which gives the function of the scalar type. */
#define LT(a, b) ((a) < (b))
#define LE(a, b) ((a) <= (b))
#define EQ(a, b) ((a) == (b))
#define NE(a, b) ((a) != (b))
/* library */
INLINE V FMIN(V a, V b) { return SELECT(OR(LT(a, b), NE(b, b)), a, b); }
INLINE V FMAX(V a, V b) { return SELECT(OR(LT(b, a), NE(b, b)), a, b); }
INLINE V SIGN(V x) { return SELECT(LT(C(0), x), C(1), SELECT(LT(x, C(0)), C(-1), x)); }
