/* Real functions continued along the imaginary axis, for derivatives by complex steps. */
INLINE V FABS(V x) { return creal(x) < 0 ? -x : x; }
INLINE V FLOOR(V x) { return floor(creal(x)); }
INLINE V CEIL(V x) { return ceil(creal(x)); }
INLINE V ATAN2(V y, V x) {
    const double a = creal(x), b = creal(y);
    return atan2(b, a) + (a * cimag(y) - b * cimag(x)) / (a * a + b * b) * _Complex_I;
}
INLINE V HYPOT(V x, V y) { return csqrt(x * x + y * y); }
INLINE V FMOD(V x, V y) { return x - y * trunc(creal(x) / creal(y)); }
INLINE V REMAINDER(V x, V y) { return x - y * rint(creal(x) / creal(y)); }
INLINE V COPYSIGN(V x, V y) { return (signbit(creal(x)) != 0) == (signbit(creal(y)) != 0) ? x : -x; }
INLINE V ERF(V x) {
    const double a = creal(x);
    return erf(a) + 1.1283791670955126 * exp(-a * a) * cimag(x) * _Complex_I;
}
