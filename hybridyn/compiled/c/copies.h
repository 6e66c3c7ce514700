/* Moves between numbers and the lanes of vectors, which hold copies. */
#define ALIGNED __attribute__((aligned(sizeof(V))))
INLINE void gather_all(V *to, const S *from, const int *at, int n) {
    for (int k = 0; k < n; k++) to[k] = C(from[at[k]]);
}
INLINE void scatter_first(S *to, const int *at, const V *from, int n) {
    for (int k = 0; k < n; k++) to[at[k]] = from[k][0];
}
INLINE void gather_lanes(V *to, const S *from, const int *at, int n) {
    for (int k = 0; k < n; k++, at += W) to[k] = (V){FROM(from, at)};
}
INLINE void scatter_lanes(S *to, const int *at, const V *from, int n, int valid) {
    for (int l = 0; l < valid; l++, at += n)
        for (int k = 0; k < n; k++) to[at[k]] = from[k][l];
}
/* Lanes that lie one after the other. */
INLINE void store_lanes(S *to, const int *at, const V *from, int n, int valid) {
    if (valid == W)
        for (int k = 0; k < n; k++) __builtin_memcpy(to + at[k], &from[k], sizeof(V));
    else
        for (int k = 0; k < n; k++) __builtin_memcpy(to + at[k], &from[k], (unsigned long)valid * sizeof(S));
}
INLINE void spread_lanes(V *to, const V *from, int n, int valid) {
    for (int l = 0; l < valid; l++)
        for (int k = 0; k < n; k++) to[l * n + k] = C(from[k][l]);
}
INLINE void add_lanes(V *to, const V *from, int n, int valid) {
    for (int k = 0; k < n; k++) {
        S sum = to[k][0];
        for (int l = 0; l < valid; l++) sum += from[k][l];
        to[k] = C(sum);
    }
}
INLINE S worst_of_lanes(S guard, V y, int valid) {
    for (int l = 0; l < valid; l++)
        if (!(y[l] <= guard) && guard == guard) guard = y[l];
    return guard;
}
