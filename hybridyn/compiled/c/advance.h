/* A row closed on the branch of the row before, as `assembly.follow` does it: for W designs at once, each lane from its
   own row before, or for one robot (`one_lane.h`). Needs NQ, NP, NV, NG, NR, SLOTS, MODULES, KEPT, the constants of
   `closing_source`, `newton.h`, `walk.h`, `far.h`, `row_records.h`, and the programs "newton", "settle" and "branch". */
#define NUMBERS(x) (sizeof(x) / sizeof(V))
/* RUN: a program; gives the lanes in which its guard is within the limit. */
#if W == 1
#define take(where, to, from, n) (void)((where) && memcpy(to, from, sizeof(S) * (n)))
#ifndef RUN
#define RUN(program, in, out) (memcpy(program##_memory.given, &(in), sizeof(in)), !program##_run((S *)&(out), 0))
#endif
#else
#define RUN(program, in, out) run(program##_samples, program##_SHARED, (V *)&(in), NUMBERS(in), (V *)&(out), NUMBERS(out), w)
typedef void Samples(const V *given, V *result, V *shared, V *own, V *guard);
INLINE M run(Samples *samples, Long shared, const V *in, Long given, V *out, Long result, Work *w) {
    V worst_yet = C(0);
    for (Long k = 0; k < given; k++) worst_yet += in[k] * C(0); /* not finite: NaN */
    samples(in, out, w->programs, w->programs + shared, &worst_yet);
    worst_yet += none(out, (int)result); /* not finite: NaN */
    return LE(worst_yet, C(GUARD_LIMIT));
}
INLINE void take(M where, V *to, const V *from, Long n) {
    for (Long k = 0; k < n; k++) to[k] = SELECT(where, from[k], to[k]);
}
#endif

INLINE V largest_lanes(const V *x) {
    V out = x[0];
    for (int m = 1; m < MODULES; m++) out = FMAX(out, x[m]);
    return out;
}
INLINE V size_in(const NewtonOut *out, int m) { return FMAX(out->step[m], out->wrist[m]); }
INLINE V size_of(const NewtonOut *out) { return FMAX(largest_lanes(out->step), largest_lanes(out->wrist)); }

/* Where a step opens each module less than the one before, in `before`, or is one of the last. */
static M nearer(const Work *w) {
    M good = EVERY;
    for (int m = 0; m < MODULES; m++) good = AND(good, OR(LT(w->moved.open[m], w->before[m]), LT(w->moved.step[m], C(NEAR))));
    return good;
}

/* Compare a step with its prediction. */
static M on_branch(Work *w) {
    w->branch.found = w->now.at;
    memcpy(w->branch.g_0, w->settle.g_0, sizeof(w->branch.g_0));
    M good = RUN(branch, w->branch, w->about);
    for (int m = 0; m < MODULES; m++) {
        const M near = LE(w->about.off[m], C(SAME_BRANCH) * w->first[m] + C(SMALL_STEP));
        const M straight = OR(LE(w->first[m], C(SMALL_STEP)), LE(w->about.turned[m], C(MOST_TURNING)));
        good = AND(good, AND(near, straight));
    }
    return good;
}

/* Where a step keeps its branch by bounds of what "branch" computes: the joints have turned by twice its module's later
   steps at most, as rotations about several axes do not add up. */
static M surely_same(Work *w) {
    M good = EVERY;
    for (int m = 0; m < MODULES; m++) {
        const M near = LE(C(2) * w->later[m], C(SAME_BRANCH) * w->first[m] + C(SMALL_STEP));
        good = AND(good, AND(near, LE(w->turning[m], C(MOST_BOUND))));
    }
    return good;
}

/* Where the steps to a row are no longer than the checks can judge. */
static M not_far(Work *w) {
    for (int l = 0; l < W; l++) ((S *)&w->far)[l] = is_far((S *)w->settle.g_0 + l, (S *)w->settle.row.g + l, W);
    return LE(w->far, C(0));
}

/* Newton's method towards a row: `lone` where it has no branch, `guess` where the method must come there by itself, without
   damping. */
typedef struct {
    Work *w;
    int lone, guess;
} Approach;

static V row_step(void *of, int k, M *left) {
    const Approach *const a = (const Approach *)of;
    Work *const w = a->w;
    w->newton.at = w->now.at;
    M good = RUN(newton, w->newton, w->moved);
    const V size = size_of(&w->moved);
    if (a->guess) good = AND(good, nearer(w));
    if (KEPT && k && !a->lone) /* the general path damps steps that open chains */
        for (int m = 0; m < MODULES; m++)
            good = AND(good, OR(LE(w->taken[m], C(NEVER_DAMPED)), LT(w->moved.open[m], w->before[m])));
    memcpy(w->before, w->moved.open, sizeof(w->before));
    take(*left, (V *)&w->now.at, (V *)&w->moved.at, NUMBERS(Posture));
    if (!k) {
        w->branch.predicted = w->moved.at;
        memcpy(w->first, w->moved.step, sizeof(w->first));
        memcpy(w->settle.kept, w->moved.kept, sizeof(w->settle.kept));
    }
    for (int m = 0; m < MODULES; m++) {
        w->taken[m] = size_in(&w->moved, m);
        if (k) w->later[m] += SELECT(*left, w->taken[m], C(0));
    }
    *left = AND(*left, good);
    return size;
}

/* The last steps, before which the rates are those after it; gives infinity where rows are open. */
static V last_step(void *of, int k, M *left) {
    Work *const w = (Work *)of;
    (void)k;
    w->settle.at = w->now.at;
    const M trusted = RUN(settle, w->settle, w->settled);
    take(*left, (V *)&w->now, (V *)&w->settled.now, NUMBERS(State));
    take(*left, w->turning, w->settled.turning, MODULES);
    for (int m = 0; m < MODULES; m++) w->later[m] += SELECT(*left, w->settled.step[m], C(0));
    *left = AND(*left, trusted);
    return SELECT(LE(largest_lanes(w->settled.open), C(OPEN)), largest_lanes(w->settled.step), C(INFINITY));
}

/* Close a row on the branch of the row before, in `at`, from there with what is told of steps on one branch. Gives where it
   is certain; `reach` gets where Newton's method comes near it by itself, or is 0. */
static M advanced(Work *w, M certain, int lone, M *reach) {
    const Limits near = {LONGEST, 1, NEAR, 0, ITERATIONS + 1, PATIENCE};
    const Limits last = {INFINITY, INFINITY, LAST_STEP, 0, LAST_STEPS, 0};
    const Approach approach = {w, lone, reach != 0};
    w->settle.start = w->branch.start = w->now.at;
    memcpy(w->newton.g, w->settle.row.g, sizeof(w->newton.g));
    memcpy(w->branch.g, w->settle.row.g, sizeof(w->branch.g));
    for (int m = 0; m < MODULES; m++) w->later[m] = C(0), w->before[m] = C(INFINITY);
    M good = lone ? certain : AND(certain, not_far(w));
    const M there = iterated(row_step, (void *)&approach, reach ? certain : good, near, reach ? &good : 0);
    if (reach) *reach = there;
    good = iterated(last_step, w, lone ? there : AND(good, there), last, 0);
    if (lone || !ANY(good)) return good;
    const M sure = surely_same(w);
    return ANY(AND(good, NOT(sure))) ? AND(good, OR(sure, on_branch(w))) : good;
}

/* A part of the way to a row; the next one is twice as long, or half as long where this one cannot be made. */
static M row_part(void *way, M *left, V done, V to, V *times) {
    Work *const w = (Work *)way;
    const M last = LE(C(1), to);
    const V part = (to - done) / (C(1) - done);
    for (int l = 0; l < W; l++)
        between((S *)w->there + l, (S *)w->row.g + l, ((const S *)&part)[l], (S *)w->settle.row.g + l, W);
    take(last, w->settle.row.g, w->row.g, NG);
    for (int i = 0; i < NR; i++) {
        w->settle.row.g_dot[i] = SELECT(last, w->row.g_dot[i], C(0));
        w->settle.row.g_ddot[i] = SELECT(last, w->row.g_ddot[i], C(0));
    }
    memcpy(w->settle.g_0, w->there, sizeof(w->there));
    w->now.at = w->here;
    const M good = advanced(w, *left, 0, 0), moved = AND(good, NOT(last));
    take(AND(good, last), (V *)&w->end, (V *)&w->now, NUMBERS(State));
    take(moved, (V *)&w->here, (V *)&w->now.at, NUMBERS(Posture));
    take(moved, w->there, w->settle.row.g, NG);
    *times = SELECT(good, C(2), C(0.5));
    return good;
}

/* Follow the branch from the row before, in `last`, where a step to the row was too long for its checks, in steps as
   long as predictions hold. Gives the lanes of `whole` and those where it leads on. */
static M led_on(Work *w, M certain, M whole) {
    w->end = w->now;
    w->here = w->last;
    memcpy(w->there, w->settle.g_0, sizeof(w->there));
    w->row = w->settle.row;
    const M led = walked(row_part, w, AND(certain, NOT(whole)), C(0.25), C(1));
    w->now = w->end;
    w->settle.row = w->row;
    return OR(AND(certain, whole), led);
}

/* Close the row in `settle` on the branch of the posture in `now`, where settle.g_0 holds.
   `guess`: from that posture Newton's method must reach the row by itself, too; `lone`: it has no branch. */
static M closed(Work *w, M good, int guess, int lone) {
    M reach = good;
    w->last = w->now.at;
    const M whole = advanced(w, good, lone, guess || lone ? &reach : 0);
    return !KEPT && !lone && ANY(AND(reach, NOT(whole))) ? led_on(w, reach, whole) : whole; /* a chain walks in other steps */
}
