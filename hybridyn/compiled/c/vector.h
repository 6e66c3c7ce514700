/* Arithmetic of W equal lanes (vector extensions of GCC and Clang). Needs S, its integer I, and W. */
typedef S V __attribute__((vector_size(W * sizeof(S))));
typedef I M __attribute__((vector_size(W * sizeof(S))));

#define C(x) ((S)(x) - (V){0}) /* exact, also for -0 */
#define LANE(x, i) ((x)[i])

/* GCC's builtins are what its intrinsics expand to. <immintrin.h> takes longer to parse than most units. */
#if defined(__has_builtin) && !defined(__clang__) && defined(__FMA__) && defined(DOUBLE)
#if defined(__AVX512F__) && W == 8
#if __has_builtin(__builtin_ia32_vfnmsubpd512_mask) && __has_builtin(__builtin_ia32_ptestmq512)
#define FUSED(operation, a, b, c) __builtin_ia32_v##operation##pd512_mask(a, b, c, -1, 4)
#define ROOT(x) __builtin_ia32_sqrtpd512_mask(x, x, -1, 4)
#define ANY_BIT(m) (__builtin_ia32_ptestmq512(m, m, -1) != 0)
#endif
#elif W == 4
#if __has_builtin(__builtin_ia32_vfnmsubpd256) && __has_builtin(__builtin_ia32_sqrtpd256)
#define FUSED(operation, a, b, c) __builtin_ia32_v##operation##pd256(a, b, c)
#define ROOT(x) __builtin_ia32_sqrtpd256(x)
#endif
#endif
#endif

/* intrinsics.h */

/* a b + c with one rounding where the machine has it; never left to the compiler's taste. */
#ifdef FUSED
INLINE V FMA(V a, V b, V c) { return (V)FUSED(fmadd, a, b, c); }
INLINE V FMS(V a, V b, V c) { return (V)FUSED(fmsub, a, b, c); }
INLINE V FNMA(V a, V b, V c) { return (V)FUSED(fnmadd, a, b, c); }
INLINE V FNMS(V a, V b, V c) { return (V)FUSED(fnmsub, a, b, c); }
#else
INLINE V FMA(V a, V b, V c) {
#if defined(__FMA__) || defined(__aarch64__) || defined(FAST_FMA)
    V r;
    for (int i = 0; i < W; i++) r[i] = SCALAR_FMA(a[i], b[i], c[i]);
    return r;
#else
    return a * b + c;
#endif
}
INLINE V FMS(V a, V b, V c) { return FMA(a, b, -c); }
INLINE V FNMA(V a, V b, V c) { return FMA(-a, b, c); }
INLINE V FNMS(V a, V b, V c) { return FMA(-a, b, -c); }
#endif

#ifdef ROOT
INLINE V SQRT(V x) { return (V)ROOT(x); }
#else
INLINE V SQRT(V x) {
    V r;
    for (int i = 0; i < W; i++) r[i] = SCALAR(__builtin_sqrt)(x[i]);
    return r;
}
#endif

INLINE V CHOOSE(M m, V x) { return (V)(m & (M)x); }
INLINE V SELECT(M m, V a, V b) { return (V)((m & (M)a) | (~m & (M)b)); }
INLINE V NUMBER(M m) { return CHOOSE(m, C(1)); }
#define TRUE(x) ((x) != C(0))
#define NOT(m) (~(m))
#define AND(a, b) ((a) & (b))
#define OR(a, b) ((a) | (b))
INLINE V FABS(V x) { return (V)((M)x & ~(M)C(-0.0)); }
INLINE int ANY(M m) {
#ifdef ANY_BIT
    return ANY_BIT(m);
#else
    I any = 0;
    for (int i = 0; i < W; i++) any |= m[i];
    return any != 0;
#endif
}

/* Functions of the C library, lane after lane. */
#define LANES1(name, function)                                \
    static __attribute__((noinline, unused)) V name(V x) {     \
        V r;                                                   \
        for (int i = 0; i < W; i++) r[i] = function(x[i]);     \
        return r;                                              \
    }
#define LANES2(name, function)                                     \
    static __attribute__((noinline, unused)) V name(V x, V y) {     \
        V r;                                                        \
        for (int i = 0; i < W; i++) r[i] = function(x[i], y[i]);    \
        return r;                                                   \
    }
