/* The same names for plain numbers. Needs S (float, double, long double, __float128). */
typedef S V;
typedef int M;

#define W 1
#define C(x) ((S)(x))
#define LANE(x, i) (x)

#if defined(__FMA__) && defined(SCALAR_FMA)
INLINE V FMA(V a, V b, V c) { return SCALAR_FMA(a, b, c); }
#else
INLINE V FMA(V a, V b, V c) { return a * b + c; }
#endif
INLINE V FMS(V a, V b, V c) { return FMA(a, b, -c); }
INLINE V FNMA(V a, V b, V c) { return FMA(-a, b, c); }
INLINE V FNMS(V a, V b, V c) { return FMA(-a, b, -c); }

INLINE V CHOOSE(M m, V x) { return m ? x : C(0); }
INLINE V SELECT(M m, V a, V b) { return m ? a : b; }
INLINE V NUMBER(M m) { return C(m); }
#define TRUE(x) ((x) != C(0))
#define NOT(m) (!(m))
#define AND(a, b) ((a) && (b))
#define OR(a, b) ((a) || (b))
#define ANY(m) (m)
#define LANES1(name, function) \
    INLINE V name(V x) { return function(x); }
#define LANES2(name, function) \
    INLINE V name(V x, V y) { return function(x, y); }
