/* Newton's method: of rows of tables and designs (`advance.h`), of exported control steps and Warp (`side.h`), and of steps
   in time (`lift.h`), W lanes or one. */
#define EVERY LE(C(0), C(0))
#define CONTRACTION 0.25 /* of a step over the last, where no other posture may be found */
#define FEW_STEPS 8      /* four suffice where the way is short */

/* Takes step number k in the lanes of `left`, and gives its size; takes out those in which it cannot be trusted. */
typedef V Step(void *of, int k, M *left);

/* Sizes of steps: how long the `first` is at most, and each next one as `part` of the last. After one that is `near`, the
   next would be rounding. Two that are `small` come there, too, or the last one. `count` steps, or `patience` where some
   may be longer. */
typedef struct {
    S first, part, near, small;
    int count, patience;
} Limits;

/* Take steps, and give the lanes that come there. The others end where a step is too long; with `steady` they leave these
   and go on. */
INLINE M iterated(Step *step, void *of, M left, Limits limits, M *steady) {
    const M every = EVERY;
    M there = NOT(every), once = there;
    V longest = C(limits.first);
    const int steps = steady ? limits.patience : limits.count;
    for (int k = 0; k < steps && ANY(left); k++) {
        if (steady && k == limits.count) *steady = AND(*steady, NOT(left));
        const V size = step(of, k, &left);
        const M small = LE(size, C(limits.small)), enough = k + 1 < steps ? once : every;
        const M near = AND(left, OR(LE(size, C(limits.near)), AND(small, enough)));
        const M short_enough = OR(OR(near, small), LE(size, longest));
        if (steady) *steady = AND(*steady, OR(NOT(left), short_enough));
        else left = AND(left, short_enough);
        there = OR(there, near);
        left = AND(left, NOT(near));
        once = small;
        longest = C(limits.part) * size;
    }
    return there;
}
