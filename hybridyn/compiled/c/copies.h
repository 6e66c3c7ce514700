/* Moves between numbers and the lanes of vectors, which hold copies: code that is read once, as calls with cold
   caches wait for every line of code. */
#define MOVE static __attribute__((noinline, unused))
#define ALIGNED __attribute__((aligned(sizeof(V))))
MOVE void set_lanes(V *to, const S *from, int n) {
    for (int k = 0; k < n; k++) to[k] = C(from[k]);
}
INLINE void copy_lanes(V *to, const V *from, int n) {
    for (int k = 0; k < n; k++) to[k] = from[k];
}
MOVE void gather_all(V *to, const S *from, const int *at, int n) {
    for (int k = 0; k < n; k++) to[k] = C(from[at[k]]);
}
MOVE void gather_lanes(V *to, const S *from, const int *at, int n) {
    for (int k = 0; k < n; k++, at += W) to[k] = (V){FROM(from, at)};
}
MOVE void scatter_lanes(S *to, const int *at, const V *from, int n, int valid) {
    for (int l = 0; l < valid; l++, at += n)
        for (int k = 0; k < n; k++) to[at[k]] = from[k][l];
}
/* Lanes that lie one after the other. */
MOVE void store_lanes(S *to, const int *at, const V *from, int n, int valid) {
    if (valid == W)
        for (int k = 0; k < n; k++) __builtin_memcpy(to + at[k], &from[k], sizeof(V));
    else
        for (int k = 0; k < n; k++) __builtin_memcpy(to + at[k], &from[k], (unsigned long)valid * sizeof(S));
}
MOVE void spread_lanes(S *to, const V *from, int n, int valid) {
    for (int l = 0; l < valid; l++)
        for (int k = 0; k < n; k++) to[l * n + k] = from[k][l];
}
INLINE void add_lanes(S *to, const V *from, int n, int valid) {
#pragma GCC unroll 1
    for (int k = 0; k < n; k++) {
        S sum = to[k];
        for (int l = 0; l < valid; l++) sum += from[k][l];
        to[k] = sum;
    }
}
INLINE S worst_number(S a, S b) { return b <= a || a != a ? a : b; }
INLINE S worst_of_lanes(S guard, V y, int valid) {
    for (int l = 0; l < valid; l++) guard = worst_number(guard, y[l]);
    return guard;
}
/* What has no copies: plain numbers. */
MOVE void copy_numbers(S *to, const S *from, int n) {
    for (int k = 0; k < n; k++) to[k] = from[k];
}
MOVE void gather_numbers(S *to, const S *from, const int *at, int n) {
    for (int k = 0; k < n; k++) to[k] = from[at[k]];
}
MOVE void scatter_numbers(S *to, const int *at, const S *from, int n) {
    for (int k = 0; k < n; k++) to[at[k]] = from[k];
}
INLINE void add_numbers(S *to, const S *from, int n) {
    for (int k = 0; k < n; k++) to[k] += from[k];
}
