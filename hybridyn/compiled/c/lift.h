/* Newton's method onto the assembled postures, in the independent joints of `lift_program`. Needs NQ, NV, MODULES,
   LAST_STEP (the next would be rounding), and the single call of "lift". */
#define LIFTS 8           /* most Newton steps of a posture */
#define FARTHEST 0.1      /* rad, module lengths: a first step beyond may leave the branch */
#define CONTRACTION 0.25  /* a Newton step must be shorter than this part of the last */
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

/* Close the loops from the displacement xi on, with the independent rates of v; 0 where that is certain. */
static int lifted(const S *q_0, const S *xi, const S *v, Lifted *out, S *pivot) {
    const S *in[3] = {q_0, xi, v};
    S before = FARTHEST / CONTRACTION;
    for (int k = 0; k < LIFTS; k++) {
        if (lift_single_at(in, (S *)out)) return 1;
        const S step = largest_of(out->step, MODULES);
        for (int m = 0; m < MODULES; m++) {
            if (out->pivot[m] < *pivot) *pivot = out->pivot[m];
            if (!(out->pivot[m] >= GOOD)) return 1;
        }
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
