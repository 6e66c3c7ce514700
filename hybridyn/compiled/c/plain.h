#if (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0) || defined(_M_FP_FAST)
#error "guards must see what is not finite: build without -ffast-math and -ffinite-math-only"
#endif
#if defined(__ASSOCIATIVE_MATH__) || defined(__NO_SIGNED_ZEROS__)
#error "sines and guards count on rounding and zeros: build without -fassociative-math and -fno-signed-zeros"
#endif

#ifdef SINGLE
typedef float S;
#define SCALAR(name) name##f
#else
typedef double S;
#define DOUBLE
#define SCALAR(name) name
#endif
#if defined(FP_FAST_FMA) || (defined(__GNUC__) && (defined(__FMA__) || defined(__aarch64__)))
#define FAST_FMA
#endif

#ifdef __GNUC__
#define INLINE static inline __attribute__((always_inline, unused))
#define SELDOM static __attribute__((noinline, cold, unused))
#if __FLT_EVAL_METHOD__ == 0
#define EXACT /* every operation rounds to its type: the sines below count on it */
#endif
#else
#define INLINE static inline
#endif
#if defined(EXACT) && defined(__AVX__) && !defined(HYBRIDYN_SCALAR) /* shorter vectors gain nothing */
#define VECTORS
#endif
