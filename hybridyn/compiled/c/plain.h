#if (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0) || defined(_M_FP_FAST)
#error "guards must see what is not finite: build without -ffast-math and -ffinite-math-only"
#endif

#ifdef SINGLE
typedef float S;
#define FUNCTION(name) name##f
#ifdef FP_FAST_FMAF
#define FAST_FMA
#endif
#else
typedef double S;
#define FUNCTION(name) name
#ifdef FP_FAST_FMA
#define FAST_FMA
#endif
#endif
typedef S V;
typedef int M;

#define C(x) ((V)(x))
#define ALIGNED
#ifdef FAST_FMA
#define FMA(a, b, c) FUNCTION(fma)(a, b, c)
#else
#define FMA(a, b, c) ((a) * (b) + (c))
#endif
#define FMS(a, b, c) FMA(a, b, -(c))
#define FNMA(a, b, c) FMA(-(a), b, c)
#define FNMS(a, b, c) FMA(-(a), b, -(c))
#define LT(a, b) ((a) < (b))
#define LE(a, b) ((a) <= (b))
#define EQ(a, b) ((a) == (b))
#define NE(a, b) ((a) != (b))
#define NOT(m) (!(m))
#define AND(a, b) ((a) && (b))
#define OR(a, b) ((a) || (b))
#define TRUE(x) ((x) != 0)
#define NUMBER(m) ((m) ? C(1) : C(0))
#define CHOOSE(m, x) ((m) ? (x) : C(0))
#define FMIN(a, b) FUNCTION(fmin)(a, b)
#define FMAX(a, b) FUNCTION(fmax)(a, b)
#define SIGN(x) C(((x) > 0) - ((x) < 0))
