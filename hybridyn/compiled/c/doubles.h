/* Doubles D beside numbers V: their bits, and masks of bits MD that choose; D is V where V is of doubles. */
#define ROUND 0x1.8p52 /* adding and subtracting it rounds to an integer, left in the low bits between */
#if W == 1
#define D double
#define MD unsigned long long
#define TO(type, x) ((type)(x))
#define BELOW(a, b) (-(MD)((a) < (b)))
#else
typedef double D __attribute__((vector_size(W * 8)));
typedef long long MD __attribute__((vector_size(W * 8)));
#define TO(type, x) __builtin_convertvector(x, type)
#define BELOW(a, b) ((a) < (b))
#endif
#define CD(x) ((double)(x) - (D){0})
#define BITS_OF(x) (((union { D number; MD bits; }){.number = (x)}).bits)
#define WITH_BITS(k) (((union { D number; MD bits; }){.bits = (k)}).number)
#define SELECT_D(m, a, b) WITH_BITS(((m) & BITS_OF(a)) | (~(m) & BITS_OF(b)))
#ifdef DOUBLE
#define FMA_D FMA
#else
#define FMA_D(a, b, c) ((a) * (b) + (c))
#endif
