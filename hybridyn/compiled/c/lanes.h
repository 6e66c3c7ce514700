/* Rows of samples, of numbers of type B, to the lanes of vectors, and back. */
#include <string.h>

#if defined(__has_builtin) && W == 8 && defined(DOUBLE)
#if __has_builtin(__builtin_shufflevector)
#define TRANSPOSE
#define MIX __builtin_shufflevector
/* Eight rows to eight columns: pairs of rows, then of pairs, then halves. */
INLINE void transpose(const V *r, V *c) {
    V a[8];
    for (int i = 0; i < 8; i += 2) {
        a[i] = MIX(r[i], r[i + 1], 0, 8, 2, 10, 4, 12, 6, 14);
        a[i + 1] = MIX(r[i], r[i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
    }
    for (int j = 0; j < 2; j++) {
        const V low = MIX(a[j], a[j + 2], 0, 1, 8, 9, 4, 5, 12, 13);
        const V high = MIX(a[j], a[j + 2], 2, 3, 10, 11, 6, 7, 14, 15);
        const V low2 = MIX(a[j + 4], a[j + 6], 0, 1, 8, 9, 4, 5, 12, 13);
        const V high2 = MIX(a[j + 4], a[j + 6], 2, 3, 10, 11, 6, 7, 14, 15);
        c[j] = MIX(low, low2, 0, 1, 2, 3, 8, 9, 10, 11);
        c[j + 2] = MIX(high, high2, 0, 1, 2, 3, 8, 9, 10, 11);
        c[j + 4] = MIX(low, low2, 4, 5, 6, 7, 12, 13, 14, 15);
        c[j + 6] = MIX(high, high2, 4, 5, 6, 7, 12, 13, 14, 15);
    }
}
typedef V Row __attribute__((aligned(sizeof(S)), may_alias)); /* anywhere in memory */
#endif
#endif

/* Read rows; zero where all numbers are at most 1e50, else a NaN. The last block of columns overlaps the one before. */
INLINE V from_rows(V *to, const B *from, Long width, int valid) {
    const B *row[W];
    Long k = 0;
    V sum = C(0);
    for (int l = 0; l < W; l++) row[l] = from + (l < valid ? l : valid - 1) * width;
#ifdef TRANSPOSE
    for (; width >= W && k < width; k += W) {
        const Long at = k + W <= width ? k : width - W;
        V r[W], c[W];
        for (int l = 0; l < W; l++) r[l] = *(const Row *)(row[l] + at);
        transpose(r, c);
        copy(to + at, c, W);
        for (int l = 0; l < W; l++) c[l] *= C(OVER);
        sum += none(c, W);
    }
#endif
    for (; k < width; k++) {
        to[k] = (V){ROWS(row, k)};
        sum = FMA(to[k] * C(OVER), C(0), sum);
    }
    return sum;
}
/* Write rows that begin `apart` numbers apart; zero where all numbers are finite, else a NaN. */
INLINE V to_rows_apart(B *to, const V *from, Long width, Long apart, int valid) {
    Long done = 0;
#ifdef TRANSPOSE
    for (; width >= W && done < width; done += W) {
        const Long at = done + W <= width ? done : width - W;
        V r[W];
        transpose(from + at, r);
        for (int l = 0; l < W && l < valid; l++) *(Row *)(to + l * apart + at) = r[l];
    }
#endif
    for (int l = 0; l < valid; l++)
        for (Long k = done; k < width; k++) to[l * apart + k] = (B)LANE(from[k], l);
    return none(from, (int)width);
}
INLINE V to_rows(B *to, const V *from, Long width, int valid) {
    return to_rows_apart(to, from, width, width, valid);
}
