typedef double V;
typedef double S;
typedef int M;

#define C(x) (x)
#define ALIGNED
#ifdef FP_FAST_FMA
#define FMA(a, b, c) fma(a, b, c)
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
#define TRUE(x) ((x) != 0.0)
#define NUMBER(m) ((m) ? 1.0 : 0.0)
#define CHOOSE(m, x) ((m) ? (x) : 0.0)
#define FMIN(a, b) fmin(a, b)
#define FMAX(a, b) fmax(a, b)
#define SIGN(x) ((double)(((x) > 0.0) - ((x) < 0.0)))
