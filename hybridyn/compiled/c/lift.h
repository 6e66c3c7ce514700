/* Newton's method onto the assembled postures, in the independent joints of `lift_program`. Needs NQ, NV, MODULES,
   LAST_STEP (the next would be rounding), `newton.h` in one lane, and the single call of "lift". */
#define FARTHEST 0.1 /* rad, module lengths: a first step beyond may leave the branch */
#define GOOD 5e-2    /* pivots below this part of their usual size are for the general path */

typedef struct {
    S q[NQ], xi[NV], v[NV], rate[NV], independent[NV], step[MODULES], pivot[MODULES], residual[MODULES];
} Lifted;

static S largest_of(const S *x, int n) {
    S out = 0;
    for (int i = 0; i < n; i++)
        if (!(x[i] <= out)) out = x[i];
    return out;
}

/* What a step reads and gives, and the smallest pivot. */
typedef struct {
    const S *in[3];
    Lifted *out;
    S *pivot;
} Lift;

static S lift_step(void *of, int k, int *left) {
    Lift *l = (Lift *)of;
    if (k) l->in[1] = l->out->xi;
    *left = !lift_single_at(l->in, (S *)l->out);
    for (int m = 0; *left && m < MODULES; m++) {
        if (l->out->pivot[m] < *l->pivot) *l->pivot = l->out->pivot[m];
        *left = l->out->pivot[m] >= GOOD;
    }
    return largest_of(l->out->step, MODULES);
}

/* Close the loops from the displacement xi on, with the independent rates of v; 0 where that is certain. */
static int lifted(const S *q_0, const S *xi, const S *v, Lifted *out, S *pivot) {
    const Limits limits = {(S)FARTHEST, (S)CONTRACTION, (S)LAST_STEP, 0, FEW_STEPS, 0};
    Lift l = {{q_0, xi, v}, out, pivot};
    return !iterated(lift_step, &l, 1, limits, 0);
}

EXPORT int lifted_posture(const S *q_0, const S *xi, const S *v, S *out, S *pivot) {
    return lifted(q_0, xi, v, (Lifted *)out, pivot);
}
