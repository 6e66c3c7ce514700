#define LANES W
#ifdef DOUBLE
#define D V
#define MD M
#define CD C
#define FMA_D FMA
#else
typedef double D __attribute__((vector_size(W * 8)));
typedef long long MD __attribute__((vector_size(W * 8)));
#define CD(x) ((double)(x) - (D){0})
#define FMA_D(a, b, c) ((a) * (b) + (c))
#endif
#define BITS_OF(x) ((MD)(x))
#define WITH_BITS(k) ((D)(k))
#define SELECT_D(m, a, b) ((D)(((m) & (MD)(a)) | (~(m) & (MD)(b))))
#define BEYOND(x) (~((D)((MD)(x) & ~(MD)CD(-0.0)) <= CD(LIMIT)))
INLINE int ANY_D(MD m) {
#ifdef DOUBLE
    return ANY(m);
#else
    long long any = 0;
    for (int i = 0; i < W; i++) any |= m[i];
    return any != 0;
#endif
}
/* trigonometry.h */
#ifdef DOUBLE
#define SINCOS SINCOS_D
#else
SELDOM void SINCOS(V x, V *s, V *c) {
    D a, b;
    SINCOS_D(__builtin_convertvector(x, D), &a, &b);
    *s = __builtin_convertvector(a, V);
    *c = __builtin_convertvector(b, V);
}
#endif
