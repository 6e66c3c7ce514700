/* Rows of a table closed one after the other (`advance.h`), for W designs at once, or for one robot (`one_lane.h`). */
EXPORT Long rows_work = sizeof(Work);
#if W == 1
#define to_rows_apart(to, from, width, apart, valid) memcpy(to, from, sizeof(S) * (width))
#endif

/* Numbers of each lane's row; lanes beyond the valid ones repeat the last. */
INLINE void fill(V *to, const S *from, Long n, Long apart, int valid) {
    S *x = (S *)to;
    for (int l = 0; l < W; l++) {
        const S *row = from + (l < valid ? l : valid - 1) * apart;
        for (Long k = 0; k < n; k++) x[k * W + l] = row[k];
    }
}

/* Close the rows of designs `from` to `to` from one posture or `each` from its own, or from a guess (`guess`).

   q_0, p_0: the posture. g_0: the positions there, or 0 where the first row need not be on its branch. g, g_dot, g_ddot:
   `rows` rows for all designs, or for each its `own`. q, v, a: `rows` rows for each design. count: how many rows of each
   are certain. */
EXPORT void closed_rows(Long from, Long to, Long rows, const S *slots, const S *q_0, const S *p_0, const S *g_0, int guess,
                        int each, int own, const S *g, const S *g_dot, const S *g_ddot, S *q, S *v, S *a, S *count, Work *w) {
    for (Long d = from; d < to; d += W) {
        const int valid = to - d < W ? (int)(to - d) : W;
        fill(w->newton.slots, slots + d * SLOTS, SLOTS, SLOTS, valid);
        memcpy(w->settle.slots, w->newton.slots, sizeof(w->newton.slots));
        memcpy(w->branch.slots, w->newton.slots, sizeof(w->newton.slots));
        const Long first = each ? d : 0, row = own ? d * rows : 0, apart = own ? rows : 0;
        fill(w->now.at.q, q_0 + first * NQ, NQ, each * NQ, valid);
        fill(w->now.at.p, p_0 + first * NP, NP, each * NP, valid);
        w->count = C(0);
        M good = EVERY;
        for (Long t = 0; t < rows && ANY(good); t++) {
            if (t) memcpy(w->settle.g_0, w->settle.row.g, sizeof(w->settle.g_0));
            else fill(w->settle.g_0, g_0 ? g_0 + first * NG : g + row * NG, NG, (g_0 ? each : apart) * NG, valid);
            fill(w->settle.row.g, g + (row + t) * NG, NG, apart * NG, valid);
            fill(w->settle.row.g_dot, g_dot + (row + t) * NR, NR, apart * NR, valid);
            fill(w->settle.row.g_ddot, g_ddot + (row + t) * NR, NR, apart * NR, valid);
            good = closed(w, good, !t && guess, !t && !g_0);
            w->count += NUMBER(good);
            to_rows_apart(q + (d * rows + t) * NQ, w->now.at.q, NQ, rows * NQ, valid);
            to_rows_apart(v + (d * rows + t) * NV, w->now.v, NV, rows * NV, valid);
            to_rows_apart(a + (d * rows + t) * NV, w->now.a, NV, rows * NV, valid);
        }
        to_rows_apart(count + d, &w->count, 1, 1, valid);
    }
}
