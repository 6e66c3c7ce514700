/* Explicit Runge-Kutta steps on the assembled postures, as `integrators.Explicit` takes them, in the independent
   joints of `lift_program`. Needs NQ, NV, MODULES, and the single calls of "lift" and "ddm". */
#define STAGES 8          /* most stages of a method */
#define LIFTS 8           /* most Newton steps of a posture */
#define FARTHEST 0.1      /* rad, module lengths: a first step beyond is not small enough to be the right branch's */
#define CONTRACTION 0.25  /* a Newton step must be shorter than this part of the last */
#define LAST_STEP 1e-12   /* the next one would be rounding */
#define GOOD 5e-2         /* pivots below this part of their usual size are for the general path */

typedef struct {
    S q[NQ], xi[NV], v[NV], rate[NV], independent[NV], step[MODULES], pivot[MODULES], residual[MODULES];
} Lifted;

static S largest_of(const S *x, int n) {
    S out = 0;
    for (int i = 0; i < n; i++)
        if (!(x[i] <= out)) out = x[i];
    return out;
}
static S least_of(const S *x, int n) {
    S out = x[0];
    for (int i = 1; i < n; i++)
        if (!(x[i] >= out)) out = x[i];
    return out;
}

/* Close the loops from the displacement xi on, with the independent rates of v; 0 where that is certain. */
static int lifted(const S *q_0, const S *xi, const S *v, Lifted *out, S *pivot) {
    const S *in[3] = {q_0, xi, v};
    S before = FARTHEST / CONTRACTION;
    for (int k = 0; k < LIFTS; k++) {
        if (lift_single_at(in, (S *)out)) return 1;
        const S step = largest_of(out->step, MODULES), least = least_of(out->pivot, MODULES);
        if (least < *pivot) *pivot = least;
        if (!(least >= GOOD)) return 1;
        if (step <= LAST_STEP) return 0;
        if (!(step <= CONTRACTION * before)) return 1;
        before = step;
        in[1] = out->xi;
    }
    return 1;
}

EXPORT int lifted_posture(const S *q_0, const S *xi, const S *v, S *out, S *pivot) {
    return lifted(q_0, xi, v, (Lifted *)out, pivot);
}

/* Take steps of h from row 0 of q, v, a, each into the next row; gives how many could be taken.

   A, b, e: the method; e may be NULL, else the error of positions and rates over the last step goes to `error`. */
EXPORT Long explicit_steps(Long steps, S h, int stages, const S *A, const S *b, const S *e, const S *tau, S *q,
                           S *v, S *a, S *pivots, S *error) {
    static S rate[STAGES + 1][NV], acceleration[STAGES + 1][NV], xi[NV], u[NV];
    static Lifted at;
    for (Long k = 0; k < steps; k++, q += NQ, v += NV, a += NV) {
        S pivot = 1;
        memcpy(rate[0], v, sizeof(rate[0]));
        memcpy(acceleration[0], a, sizeof(rate[0]));
        for (int s = 1; s <= stages; s++) {
            const S *weights = s < stages ? A + s * stages : b;
            for (int i = 0; i < NV; i++) xi[i] = 0, u[i] = 0;
            for (int j = 0; j < s; j++) {
                if (weights[j] == 0) continue;
                const S w = h * weights[j];
                for (int i = 0; i < NV; i++) xi[i] += w * rate[j][i], u[i] += w * acceleration[j][i];
            }
            for (int i = 0; i < NV; i++) u[i] += v[i];
            if (lifted(q, xi, u, &at, &pivot)) return k;
            const S *in[3] = {at.q, at.v, tau};
            if (ddm_single_at(in, acceleration[s])) return k;
            memcpy(rate[s], at.rate, sizeof(rate[0]));
        }
        if (e) {
            for (int part = 0; part < 2; part++) {
                for (int i = 0; i < NV; i++) u[i] = 0;
                for (int j = 0; j <= stages; j++)
                    for (int i = 0; i < NV; i++) u[i] += h * e[j] * (part ? acceleration : rate)[j][i];
                static Lifted direction;
                const S *in[3] = {q, at.xi, u};
                if (lift_single_at(in, (S *)&direction)) return k;
                memcpy(error + part * NV, direction.v, sizeof(rate[0]));
            }
        }
        memcpy(q + NQ, at.q, sizeof(at.q));
        memcpy(v + NV, at.v, sizeof(at.v));
        memcpy(a + NV, acceleration[stages], sizeof(at.v));
        pivots[k] = pivot;
    }
    return steps;
}
