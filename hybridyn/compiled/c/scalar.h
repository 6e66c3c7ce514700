/* Plain numbers: the code of every compiler, and of -DHYBRIDYN_SCALAR. */
#define V S
#define M int
#define W 1
#define C(x) ((S)(x))
#define LANE(x, i) (x)
#define ALIGNED
#ifdef FAST_FMA
#define FMA(a, b, c) SCALAR(fma)(a, b, c)
#else
#define FMA(a, b, c) ((a) * (b) + (c))
#endif
#define FMS(a, b, c) FMA(a, b, -(c))
#define FNMA(a, b, c) FMA(-(a), b, c)
#define LT(a, b) ((a) < (b))
#define LE(a, b) ((a) <= (b))
#define EQ(a, b) ((a) == (b))
#define NE(a, b) ((a) != (b))
#define NOT(m) (!(m))
#define AND(a, b) ((a) && (b))
#define OR(a, b) ((a) || (b))
#define ANY(m) ((m) != 0)
#define TRUE(x) ((x) != 0)
#define NUMBER(m) C(m)
#define CHOOSE(m, x) ((m) ? (x) : C(0))
#define SELECT(m, a, b) ((m) ? (a) : (b))
#define FMIN(a, b) ((a) < (b) || (b) != (b) ? (a) : (b))
#define FMAX(a, b) ((b) < (a) || (b) != (b) ? (a) : (b))
#define SIGN(x) ((x) > 0 ? C(1) : (x) < 0 ? C(-1) : (x))
