/* Arithmetic of W equal lanes (vector extensions of GCC and Clang), after `plain.h`. */
#ifdef DOUBLE
typedef long long I;
#else
typedef int I;
#endif
typedef S V __attribute__((vector_size(W * sizeof(S))));
typedef I M __attribute__((vector_size(W * sizeof(S))));

#define C(x) ((S)(x) - (V){0}) /* exact, also for -0 */
#define LANE(x, i) ((x)[i])

/* GCC's builtins, what its intrinsics expand to: it leaves loops over lanes as they are. Clang does not. */
#if defined(__FMA__) && !defined(__clang__)
#ifdef DOUBLE
#define REGISTER (64 * W)
#define X86(operation, width) __builtin_ia32_##operation##pd##width
#else
#define REGISTER (32 * W)
#define X86(operation, width) __builtin_ia32_##operation##ps##width
#endif
#if REGISTER == 512 && defined(__AVX512F__)
#define FUSED(operation, a, b, c) X86(v##operation, 512_mask)(a, b, c, -1, 4)
#define ROOT(x) X86(sqrt, 512_mask)(x, x, -1, 4)
#elif REGISTER == 256
#define FUSED(operation, a, b, c) X86(v##operation, 256)(a, b, c)
#define ROOT(x) X86(sqrt, 256)(x)
#elif REGISTER == 128
#define FUSED(operation, a, b, c) X86(v##operation, )(a, b, c)
#define ROOT(x) X86(sqrt, )(x)
#endif
#endif

/* a b + c with one rounding where the machine has it; never left to the compiler's taste. */
#ifdef FUSED
INLINE V FMA(V a, V b, V c) { return FUSED(fmadd, a, b, c); }
INLINE V FMS(V a, V b, V c) { return FUSED(fmsub, a, b, c); }
INLINE V FNMA(V a, V b, V c) { return FUSED(fnmadd, a, b, c); }
INLINE V SQRT(V x) { return ROOT(x); }
#else
INLINE V FMA(V a, V b, V c) {
#ifdef FAST_FMA
    for (int i = 0; i < W; i++) a[i] = SCALAR(__builtin_fma)(a[i], b[i], c[i]);
    return a;
#else
    return a * b + c;
#endif
}
INLINE V FMS(V a, V b, V c) { return FMA(a, b, -c); }
INLINE V FNMA(V a, V b, V c) { return FMA(-a, b, c); }
INLINE V SQRT(V x) {
    for (int i = 0; i < W; i++) x[i] = SCALAR(__builtin_sqrt)(x[i]);
    return x;
}
#endif

#define LT(a, b) ((a) < (b))
#define LE(a, b) ((a) <= (b))
#define EQ(a, b) ((a) == (b))
#define NE(a, b) ((a) != (b))
#define NOT(m) (~(m))
#define AND(a, b) ((a) & (b))
#define OR(a, b) ((a) | (b))
#define TRUE(x) ((x) != C(0))
INLINE V CHOOSE(M m, V x) { return (V)(m & (M)x); }
INLINE V SELECT(M m, V a, V b) { return (V)((m & (M)a) | (~m & (M)b)); }
INLINE V NUMBER(M m) { return CHOOSE(m, C(1)); }
INLINE V FABS(V x) { return (V)((M)x & ~(M)C(-0.0)); }
INLINE V FMIN(V a, V b) { return SELECT(OR(LT(a, b), NE(b, b)), a, b); }
INLINE V FMAX(V a, V b) { return SELECT(OR(LT(b, a), NE(b, b)), a, b); }
INLINE V SIGN(V x) { return SELECT(LT(C(0), x), C(1), SELECT(LT(x, C(0)), C(-1), x)); }
INLINE int ANY(M m) {
#if defined(FUSED) && defined(DOUBLE) && REGISTER == 512
    return __builtin_ia32_ptestmq512(m, m, -1) != 0;
#else
    I any = 0;
    for (int i = 0; i < W; i++) any |= m[i];
    return any != 0;
#endif
}

/* Functions of the C library, lane after lane. */
#define LANES1(name, function)                             \
    static __attribute__((noinline, unused)) V name(V x) { \
        for (int i = 0; i < W; i++) x[i] = function(x[i]); \
        return x;                                          \
    }
#define LANES2(name, function)                                   \
    static __attribute__((noinline, unused)) V name(V x, V y) {  \
        for (int i = 0; i < W; i++) x[i] = function(x[i], y[i]); \
        return x;                                                \
    }
