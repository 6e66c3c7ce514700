/* One row from the motors (MOTORS: the motor of each prescribed number), from the posture that the last call gave,
   whose platforms are kept. Needs `closing.h` in one lane, and the single call of "place". */
static Work motion;
static struct {
    Posture at;
    S g[NG];
} kept;

EXPORT void keep_place(const S *q, const S *p, const S *g) {
    memcpy(kept.at.q, q, sizeof(kept.at.q));
    memcpy(kept.at.p, p, sizeof(kept.at.p));
    memcpy(kept.g, g, sizeof(kept.g));
}

/* Keep a posture that closes the loops; 0 where it does. */
static int kept_at(const S *q) {
    static struct {
        S p[NP], g[NG];
    } at;
    if (place_single_at(&q, (S *)&at)) return 1;
    keep_place(q, at.p, at.g);
    return 0;
}

/* Close a row from (last q, positions, rates, accelerations of the motors) into q, v, a; 0 where it is certain, 1 where
   the arrays are others. From another posture than the last call gave, Newton's method must reach the row by itself. */
static int close_row(const Array *const *a, S *result) {
    static const int motors[NG] = {MOTORS};
    S *const given[3] = {motion.settle.row.g, motion.settle.row.g_dot, motion.settle.row.g_ddot};
    const S *last = numbers(a[0], NQ);
    if (!last) return 1;
    for (int n = 0; n < 3; n++) {
        const S *own = numbers(a[n + 1], NG);
        if (!own) return 1;
        for (int i = 0; i < NG; i++) given[n][i] = own[motors[i]];
    }
    const int other = memcmp(last, kept.at.q, sizeof(kept.at.q)) != 0;
    if (other && kept_at(last)) return 2;
    motion.now.at = kept.at;
    memcpy(motion.settle.g_0, kept.g, sizeof(kept.g));
    if (!closed(&motion, 1, other, 0)) return 2;
    kept.at = motion.now.at;
    memcpy(kept.g, motion.settle.row.g, sizeof(kept.g));
    memcpy(result, motion.now.at.q, sizeof(motion.now.at.q));
    memcpy(result + NQ, motion.now.v, sizeof(S[2 * NV])); /* and the accelerations after them */
    return 0;
}

/* A function of Python, METH_FASTCALL: the arrays of `close_row`, then the result. */
EXPORT const void *close_call(const void *self, const Array *const *a, Long count) {
    (void)self;
    S *result = count == 5 ? numbers(a[4], NQ + 2 * NV) : 0;
    return answered(result ? close_row(a, result) : 1);
}

/* The efforts of a control step: the arrays of `close_row`, then room for q, v, a and the efforts. Answers 0; 1 where the
   loops are not closed; 2 where they are, and the efforts are not certain. `self`: the address of "idm_single_at". */
EXPORT const void *control_call(const Array *self, const Array *const *a, Long count) {
    int (*idm)(const S *const *, S *);
    memcpy(&idm, self->data, sizeof(idm));
    S *result = count == 5 ? numbers(a[4], NQ + 2 * NV + NG) : 0;
    if (!result || close_row(a, result)) return answered(1);
    const S *in[3] = {result, result + NQ, result + NQ + NV};
    return answered(idm(in, result + NQ + 2 * NV));
}
