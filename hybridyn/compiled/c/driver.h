/* Moves and sums of the drivers; nothing here rounds but the sums. */

typedef long long Long;

INLINE V worst(V a, V b) { return SELECT(OR(LE(b, a), NE(a, a)), a, b); } /* a NaN stays */
INLINE void set_all(V *to, const S *from, int n) {
    for (int k = 0; k < n; k++) to[k] = C(from[k]);
}
INLINE void copy(V *to, const V *from, int n) {
    for (int k = 0; k < n; k++) to[k] = from[k];
}
INLINE void gather(V *to, const V *from, const int *at, int n) {
    for (int k = 0; k < n; k++) to[k] = from[at[k]];
}
INLINE void scatter(V *to, const int *at, const V *from, int n) {
    for (int k = 0; k < n; k++) to[at[k]] = from[k];
}
INLINE void add(V *to, const V *from, int n) {
    for (int k = 0; k < n; k++) to[k] += from[k];
}
