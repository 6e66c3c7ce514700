#define D double
#define MD unsigned long long
#define CD(x) ((double)(x))
#define LANES 1
#ifdef DOUBLE
#define FMA_D FMA
#else
#define FMA_D(a, b, c) ((a) * (b) + (c))
#endif
INLINE MD BITS_OF(double x) {
    MD k;
    __builtin_memcpy(&k, &x, 8);
    return k;
}
INLINE double WITH_BITS(MD k) {
    double x;
    __builtin_memcpy(&x, &k, 8);
    return x;
}
#define SELECT_D(m, a, b) ((m) ? (a) : (b))
#define BEYOND(x) (!(__builtin_fabs(x) <= LIMIT))
#define ANY_D(m) ((m) != 0)
/* trigonometry.h */
INLINE void SINCOS(V x, V *s, V *c) {
    double a, b;
    SINCOS_D((double)x, &a, &b);
    *s = (V)a;
    *c = (V)b;
}
