/* Rows of a table closed one after the other on the branch of the row before, as `assembly.follow` does it.
   Needs NQ, NP, NV, NG, NR, MODULES, the constants of `closing_source`, `far.h`, and the single calls of "newton",
   "settle" and "branch". */
typedef struct {
    S q[NQ], p[NP], step[MODULES], wrist[MODULES], open[MODULES];
} Moved;
typedef struct {
    S q[NQ], p[NP], v[NV], a[NV], step[MODULES], open[MODULES], turning[MODULES];
} Closed;
typedef struct {
    S off[MODULES], turned[MODULES];
} Branch;

static S largest_of(const S *x, int n) {
    S out = 0;
    for (int i = 0; i < n; i++)
        if (!(x[i] <= out)) out = x[i];
    return out;
}

/* Newton's method from (q, p), where g_0 holds, to the given positions; the first step goes to `first`, the sum of the
   lengths of those after it to `later`. 0 where it closes. */
static int closed(const S *q, const S *p, const S *g_0, const S *const *given, Moved *first, Closed *out, S *later) {
    static Moved at;
    const S *in[3] = {q, p, given[0]};
    S before = LONGEST;
    *later = 0;
    for (int k = 0; k < ITERATIONS; k++) {
        S step;
        if (k && before <= NEAR) {
            const S *near[8] = {at.q, at.p, q, p, g_0, given[0], given[1], given[2]};
            if (settle_single_at(near, (S *)out)) return 1;
            step = largest_of(out->step, MODULES);
            *later += step;
            if (step <= LAST_STEP) return !(largest_of(out->open, MODULES) <= OPEN);
            memcpy(at.q, out->q, sizeof(at.q));
            memcpy(at.p, out->p, sizeof(at.p));
        } else {
            if (newton_single_at(in, (S *)&at)) return 1;
            const S wrist = largest_of(at.wrist, MODULES);
            step = largest_of(at.step, MODULES);
            if (wrist > step) step = wrist;
            if (k) *later += step;
            else memcpy(first, &at, sizeof(at));
        }
        if (!(step <= before)) return 1;
        before = step;
        in[0] = at.q, in[1] = at.p;
    }
    return 1;
}

/* Whether Newton's method from a guess comes to the given positions without damping: 0 where it does. */
static int reaches(const S *q, const S *p, const S *const *given) {
    static Moved at;
    static S before[MODULES];
    const S *in[3] = {q, p, given[0]};
    for (int k = 0; k < PATIENCE; k++) {
        int left = 0;
        if (newton_single_at(in, (S *)&at)) return 1;
        for (int m = 0; m < MODULES; m++) {
            if (k && !(at.open[m] < before[m]) && !(at.step[m] < NEAR)) return 1;
            before[m] = at.open[m];
            left += !(at.step[m] <= NEAR && at.wrist[m] <= NEAR);
        }
        if (!left) return 0;
        in[0] = at.q, in[1] = at.p;
    }
    return 1;
}

/* Whether a step keeps its branch by bounds of what "branch" computes: the joints have turned by twice the later steps
   at most, as rotations about several axes do not add up. */
static int surely_same(const Moved *first, const Closed *out, S later) {
    for (int m = 0; m < MODULES; m++) {
        if (!(2 * later <= SAME_BRANCH * first->step[m] + SMALL_STEP)) return 0;
        if (!(out->turning[m] <= MOST_BOUND)) return 0;
    }
    return 1;
}

/* Close the loops at the given positions on the branch of (q, p), where g_0 holds; 0 where that is certain. */
static int advanced(const S *q, const S *p, const S *g_0, const S *const *given, Closed *out) {
    static Moved first;
    static Branch about;
    S later;
    if (is_far(g_0, given[0], 1)) return 1;
    if (closed(q, p, g_0, given, &first, out, &later)) return 1;
    if (surely_same(&first, out, later)) return 0;
    const S *in[8] = {q, p, g_0, first.q, first.p, out->q, out->p, given[0]};
    if (branch_single_at(in, (S *)&about)) return 1;
    for (int m = 0; m < MODULES; m++) {
        if (!(about.off[m] <= SAME_BRANCH * first.step[m] + SMALL_STEP)) return 1;
        if (!(first.step[m] <= SMALL_STEP) && !(about.turned[m] <= MOST_TURNING)) return 1;
    }
    return 0;
}

/* Follow the branch from (q, p), where g_0 holds, in steps as long as predictions hold; 0 where it leads on. */
static int walked(const S *q, const S *p, const S *g_0, const S *const *given, Closed *out) {
    static S here[NQ], pose[NP], g[NG], at[NG];
    static const S still[NR];
    S done = 0, step = (S)0.25;
    memcpy(here, q, sizeof(here));
    memcpy(pose, p, sizeof(pose));
    memcpy(at, g_0, sizeof(at));
    while (done < 1) {
        if (step >= 1 - done) step = 1 - done;
        const int last = done + step >= 1;
        if (!last) between(g_0, given[0], done + step, g, 1);
        const S *way[3] = {g, still, still};
        if (!advanced(here, pose, at, last ? given : way, out)) {
            memcpy(here, out->q, sizeof(here));
            memcpy(pose, out->p, sizeof(pose));
            memcpy(at, g, sizeof(at));
            done += step, step *= 2;
        } else if (step <= SHORTEST) {
            return 1;
        } else {
            step /= 2;
        }
    }
    return 0;
}

/* Close rows of g, g_dot, g_ddot from the closed posture (q, p), where g_0 holds, into rows of q, v, a.

   (q, p, g_0) become those of the last row that was closed. `first`: the posture is a guess, from which Newton's
   method must reach the first row by itself, too. Gives how many rows could be closed. */
EXPORT Long closed_rows(Long rows, int first, const S *g, const S *g_dot, const S *g_ddot, S *q, S *p, S *g_0,
                        S *q_out, S *v_out, S *a_out) {
    static Closed out;
    for (Long k = 0; k < rows; k++) {
        const S *given[3] = {g + k * NG, g_dot + k * NR, g_ddot + k * NR};
        if (first && !k && reaches(q, p, given)) return 0;
        if (advanced(q, p, g_0, given, &out) && walked(q, p, g_0, given, &out)) return k;
        memcpy(q, out.q, sizeof(out.q));
        memcpy(p, out.p, sizeof(out.p));
        memcpy(g_0, given[0], sizeof(S[NG]));
        memcpy(q_out + k * NQ, out.q, sizeof(out.q));
        memcpy(v_out + k * NV, out.v, sizeof(out.v));
        memcpy(a_out + k * NV, out.a, sizeof(out.a));
    }
    return rows;
}

#ifdef MOTORS
/* One row from the motors (MOTORS: the motor of each prescribed number), from the posture that the last call gave,
   whose platforms are kept. */
static struct {
    S q[NQ], p[NP], g[NG];
} kept;

EXPORT void keep_place(const S *q, const S *p, const S *g) {
    memcpy(kept.q, q, sizeof(kept.q));
    memcpy(kept.p, p, sizeof(kept.p));
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
EXPORT int close_row(const Array *const *a, S *result) {
    static const int motors[NG] = {MOTORS};
    static S given[3][NG];
    static Closed out;
    const S *last = numbers(a[0], NQ);
    if (!last) return 1;
    for (int n = 0; n < 3; n++) {
        const S *own = numbers(a[n + 1], NG);
        if (!own) return 1;
        for (int i = 0; i < NG; i++) given[n][i] = own[motors[i]];
    }
    const S *in[3] = {given[0], given[1], given[2]};
    if (memcmp(last, kept.q, sizeof(kept.q)) && (kept_at(last) || reaches(kept.q, kept.p, in))) return 2;
    if (advanced(kept.q, kept.p, kept.g, in, &out) && walked(kept.q, kept.p, kept.g, in, &out)) return 2;
    keep_place(out.q, out.p, given[0]);
    memcpy(result, out.q, sizeof(out.q));
    memcpy(result + NQ, out.v, sizeof(out.v));
    memcpy(result + NQ + NV, out.a, sizeof(out.a));
    return 0;
}

/* A function of Python, METH_FASTCALL: the arrays of `close_row`, then the result. */
EXPORT const void *close_call(const void *self, const Array *const *a, Long count) {
    (void)self;
    S *result = count == 5 ? numbers(a[4], NQ + 2 * NV) : 0;
    return answered(result ? close_row(a, result) : 1);
}
#endif
