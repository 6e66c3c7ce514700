/* Explicit Runge-Kutta steps on the assembled postures, as `integrators.Explicit` takes them. Needs `laws.h`, `lift.h`,
   STAGES (most of a method), DDM (the direct model). */
typedef struct {
    Long stages;
    const S *A, *b, *c, *e; /* weights of the stages and the result, times of the stages, weights of the error or NULL */
} Tableau;

/* Lengths of steps by the estimated error, as `stepping.Stepper` chooses them. */
typedef struct {
    S end, rtol, atol, power, shortest, same_point;
    const S *unit;
} Control;

typedef struct {
    S rate[STAGES + 1][NV], acceleration[STAGES + 1][NV], xi[NV], u[NV], error[2][NV];
    Lifted at, direction;
} Work;

/* One step of h from (q, v, a) into the next rows; 0 where it can be trusted. */
static int step_of(const Tableau *m, const Law *law, S t, S h, S *q, S *v, S *a, S *pivot, Work *w) {
    S tau[ROOM];
    *pivot = 1;
    memcpy(w->rate[0], v, sizeof(w->rate[0]));
    memcpy(w->acceleration[0], a, sizeof(w->rate[0]));
    for (int s = 1; s <= m->stages; s++) {
        const S *weights = s < m->stages ? m->A + s * m->stages : m->b;
        for (int i = 0; i < NV; i++) w->xi[i] = 0, w->u[i] = 0;
        for (int j = 0; j < s; j++) {
            if (weights[j] == 0) continue;
            const S x = h * weights[j];
            for (int i = 0; i < NV; i++) w->xi[i] += x * w->rate[j][i], w->u[i] += x * w->acceleration[j][i];
        }
        for (int i = 0; i < NV; i++) w->u[i] += v[i];
        if (lifted(q, w->xi, w->u, &w->at, pivot)) return 1;
        if (efforts(law, s < m->stages ? t + h * m->c[s] : t + h, w->at.q, w->at.v, tau)) return 1;
        const S *in[3] = {w->at.q, w->at.v, tau};
        if (DDM(in, w->acceleration[s])) return 1;
        memcpy(w->rate[s], w->at.rate, sizeof(w->rate[0]));
    }
    for (int part = 0; m->e && part < 2; part++) {
        for (int i = 0; i < NV; i++) w->u[i] = 0;
        for (int j = 0; j <= m->stages; j++)
            for (int i = 0; i < NV; i++) w->u[i] += h * m->e[j] * (part ? w->acceleration : w->rate)[j][i];
        const S *in[3] = {q, w->at.xi, w->u};
        if (lift_single_at(in, (S *)&w->direction)) return 1;
        memcpy(w->error[part], w->direction.v, sizeof(w->rate[0]));
    }
    memcpy(q + NQ, w->at.q, sizeof(w->at.q));
    memcpy(v + NV, w->at.v, sizeof(w->at.v));
    memcpy(a + NV, w->acceleration[m->stages], sizeof(w->at.v));
    return 0;
}

/* The largest of |x| / unit. */
static S scaled(const S *x, const S *unit) {
    S out = 0;
    for (int i = 0; i < NV; i++) {
        const S size = SCALAR(fabs)(x[i] / unit[i]);
        if (!(size <= out)) out = size;
    }
    return out;
}

/* The error of the last step over its tolerance, from the rates before and after it. */
static S excess(const Control *c, const S *v, const Work *w) {
    const S before = scaled(v, c->unit), after = scaled(v + NV, c->unit);
    const S of_q = scaled(w->error[0], c->unit) / (c->atol + c->rtol);
    const S of_v = scaled(w->error[1], c->unit) / (c->atol + c->rtol * (before > after ? before : after));
    const S out = of_q > of_v ? of_q : of_v;
    return out - out == 0 && of_q == of_q ? out : INFINITY;
}

/* Take at most `most` steps from row 0 of t, q, v, a, each into the next row; gives how many could be taken.

   Without `c`, all have the length next[0], and t gives their starts. With it, next[k] is the length wanted for step k,
   rejected[k] how many longer ones were refused. `error`: of positions and rates over the last step, or NULL. */
EXPORT Long explicit_steps(Long most, const Tableau *m, const Control *c, const Law *law, S *t, S *next, Long *rejected,
                           S *q, S *v, S *a, S *pivots, S *error, Work *w) {
    for (Long k = 0; k < most; k++, q += NQ, v += NV, a += NV) {
        S wanted = next[k];
        rejected[k] = 0;
        while (1) {
            const S left = c ? c->end - t[k] : 0;
            const int last = c && SCALAR(fabs)(wanted) >= SCALAR(fabs)(left) * (1 - c->same_point);
            const S h = last ? left : wanted;
            if (step_of(m, law, t[k], h, q, v, a, pivots + k, w)) return k;
            next[k + 1] = wanted;
            if (!c) break;
            const S off = excess(c, v, w);
            S factor = (S)0.9 * SCALAR(pow)(off > (S)1e-10 ? off : (S)1e-10, c->power);
            factor = factor < (S)0.2 ? (S)0.2 : factor > 5 ? 5 : factor;
            if (off <= 1) {
                if (!(last && factor > 1 && SCALAR(fabs)(h) < SCALAR(fabs)(wanted))) next[k + 1] = h * factor;
                t[k + 1] = last ? c->end : t[k] + h;
                if (last) most = k + 1;
                break;
            }
            wanted = h * (factor < (S)0.9 ? factor : (S)0.9);
            if (SCALAR(fabs)(wanted) < c->shortest) return k;
            rejected[k]++;
        }
    }
    if (error && m->e) memcpy(error, w->error, sizeof(w->error));
    return most;
}
