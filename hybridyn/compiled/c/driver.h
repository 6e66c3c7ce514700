/* Sums of the drivers, and what they fetch; `drivers.MOVES` has their moves. */

typedef long long Long;

/* Fetch part `t` of `parts` of memory that is needed next; a wish, which may go past the end. */
#define LINE 64
#ifndef __GNUC__
#define __builtin_prefetch(at, write) (void)(at)
#endif
#define ahead(from, size, write, t, parts)                                         \
    do {                                                                           \
        const Long lines = ((size) + LINE - 1) / LINE;                             \
        for (Long k = lines * (t) / (parts); k < lines * ((t) + 1) / (parts); k++) \
            __builtin_prefetch((const char *)(from) + k * LINE, write);            \
    } while (0)

/* Times this, what is above 1e50 is infinite: it is not for the models, and the general path refuses it. */
#ifdef SINGLE
#define OVER 1
#else
#define OVER 1.7976931348623155e258
#endif

/* Zero where all numbers are finite, else a NaN; four sums, so that they need not wait for each other. */
INLINE V none(const V *x, int n) {
    V sum[4] = {C(0), C(0), C(0), C(0)};
    for (int k = 0; k < n; k++) sum[k % 4] = FMA(x[k], C(0), sum[k % 4]);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}
INLINE S none_of(const S *x, int n) {
    S sum[16] = {0};
    int k = 0;
    for (; k + 16 <= n; k += 16)
        for (int i = 0; i < 16; i++) sum[i] += x[k + i] * 0;
    for (; k < n; k++) sum[0] += x[k] * 0;
    for (int i = 1; i < 16; i++) sum[0] += sum[i];
    return sum[0];
}
