/* The arithmetic of `newton.h` and `walk.h` for one row at a time, whose programs hold copies of legs in the lanes of
   vectors. */
#undef V
#undef M
#undef W
#undef C
#undef AND
#undef OR
#undef NOT
#undef ANY
#undef NUMBER
#undef SELECT
#undef FMAX
#define W 1
#define V S
#define M int
#define C(x) ((S)(x))
#define AND(a, b) ((a) && (b))
#define OR(a, b) ((a) || (b))
#define NOT(m) (!(m))
#define ANY(m) (m)
#define NUMBER(m) C(m)
#define SELECT(m, a, b) ((m) ? (a) : (b))
#define FMAX larger
INLINE S larger(S a, S b) { return LT(b, a) || NE(b, b) ? a : b; }
