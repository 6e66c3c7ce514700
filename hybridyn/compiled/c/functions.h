/* The functions of kernels. Needs LANES1, LANES2 and SCALAR, which gives the function of the scalar type. */
LANES1(TAN, SCALAR(tan))
LANES1(ASIN, SCALAR(asin))
LANES1(ACOS, SCALAR(acos))
LANES1(ATAN, SCALAR(atan))
LANES1(SINH, SCALAR(sinh))
LANES1(COSH, SCALAR(cosh))
LANES1(TANH, SCALAR(tanh))
LANES1(ASINH, SCALAR(asinh))
LANES1(ACOSH, SCALAR(acosh))
LANES1(ATANH, SCALAR(atanh))
LANES1(EXP, SCALAR(exp))
LANES1(EXPM1, SCALAR(expm1))
LANES1(LOG, SCALAR(log))
LANES1(LOG1P, SCALAR(log1p))
#ifndef COMPLEX
LANES1(FLOOR, SCALAR(floor))
LANES1(CEIL, SCALAR(ceil))
LANES1(ERF, SCALAR(erf))
LANES2(ATAN2, SCALAR(atan2))
LANES2(FMOD, SCALAR(fmod))
LANES2(REMAINDER, SCALAR(remainder))
LANES2(HYPOT, SCALAR(hypot))
LANES2(COPYSIGN, SCALAR(copysign))
#endif
LANES2(POW, SCALAR(pow))
INLINE V FMIN(V a, V b) { return SELECT(OR(LT(a, b), NE(b, b)), a, b); }
INLINE V FMAX(V a, V b) { return SELECT(OR(LT(b, a), NE(b, b)), a, b); }
INLINE V SIGN(V x) { return SELECT(LT(C(0), x), C(1), SELECT(LT(x, C(0)), C(-1), x)); }
