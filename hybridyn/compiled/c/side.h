/* The loops closed from one side's positions, along the branch of a posture: for exported C and for Warp. Needs the numbers
   of `walking`: NQ, NV, SIDE (joints of the side), GIVEN (size of what the program reads), NUMBERS (of which at its end are
   parameters), POSED (whether the side's positions are among it), and the rules of a walk (WILD: the shortest first part);
   the programs "close", STEP (the same where RATED, else its step without rates), and "turning"; `newton.h`, `walk.h`; `at`
   and `turns`, the places of the side's joints in q, and `farthest`, how far each may move in one part of the way;
   `unit_size`, how many coordinates of length one begin at each coordinate. `room`: memory of the programs. */
static S position_of(const S *q, int m) { return turns(m) ? SCALAR(atan2)(q[at(m) + 1], q[at(m)]) : q[at(m)]; }

static void place(S *given, int m, S x) {
    S *q = given + at(m);
    if (POSED) given[NQ + m] = x;
    if (turns(m)) q[0] = SCALAR(cos)(x), q[1] = SCALAR(sin)(x);
    else q[0] = x;
}

/* Divide quaternions, and cosines and sines, by their length: those of a file have its digits. */
static void make_unit(S *q) {
    for (int k = 0; k < NQ; k++) {
        S squares = 0;
        for (int i = 0; i < unit_size(k); i++) squares += q[k + i] * q[k + i];
        for (int i = 0; i < unit_size(k); i++) q[k + i] /= SCALAR(sqrt)(squares);
    }
}

/* The guard of a part of the way: above 1 where another branch could lie between its ends. */
static S turned(const S *given, const S *here, const S *there, S *room) {
    S both[2 * NQ + NUMBERS];
    for (int k = 0; k < NQ; k++) both[k] = here[k], both[NQ + k] = there[k];
    for (int k = 0; k < NUMBERS; k++) both[2 * NQ + k] = given[GIVEN - NUMBERS + k];
    return turning_run(both, both, room);
}

/* A walk from a closed posture, in `given` with what else the program reads, to the positions `goal`. */
typedef struct {
    const S *goal;
    S *result, *room, given[GIVEN], here[NQ], from[SIDE + !SIDE], way[SIDE + !SIDE], guard;
    Walked walked;
    int left, whole;
} Side;

/* A step of Newton's method; its size is the guard, which measures it by that of closed loops. */
static S side_step(void *of, int k, int *left) {
    Side *w = (Side *)of;
    (void)left;
    for (int i = 0; k && i < NQ; i++) w->given[i] = w->result[i];
    return w->guard = STEP(w->given, w->result, w->room);
}

/* How many times as long the next part of a walk is: as long as lets the rows turn by AIM of what is allowed, if they turn
   evenly, but not shorter than half of SHORTEST; at most a half where this one, of some `length`, cannot be made. */
static S times_as_long(S turn, S length, int good) {
    const S most = good ? 2 : (S)0.5, least = (S)SHORTEST / 2 / length, times = turn * most <= (S)AIM ? most : (S)AIM / turn;
    return least < most && !(least <= times) ? least : times < most ? times : most;
}

/* One part of the walk, in which Newton's method agrees. Ends where numbers are not finite. */
static int side_part(void *of, int *left, S done, S to, S *times) {
    const S near = to < 1 ? (S)ROUGH : (S)LAST;
    const Limits limits = {(S)(LONGEST / CLOSED), (S)CONTRACTION, near, 1, FEW_STEPS, 0};
    Side *w = (Side *)of;
    S turn = 1;
    for (int k = 0; k < NQ; k++) w->given[k] = w->here[k];
    for (int m = 0; m < SIDE; m++) place(w->given, m, to < 1 ? w->from[m] + to * w->way[m] : w->goal[m]);
    const int there = iterated(side_step, w, 1, limits, 0);
    if (there) turn = turned(w->given, w->here, w->result, w->room);
    const int good = there && turn <= 1;
    *times = times_as_long(turn, to - done, good);
    if (turn != turn) w->guard = turn;
    *left = w->guard == w->guard;
    for (int k = 0; good && k < NQ; k++) w->here[k] = w->result[k];
    return good;
}

/* The rates, where the steps gave none: those before a step are those after it, as it is the second one that is small. */
static S side_rated(Side *w) {
    for (int k = 0; k < NQ; k++) w->given[k] = w->result[k];
    return close_run(w->given, w->result, w->room);
}

/* Begin a walk to `goal`, which is `left` unless its way is not finite or too long. */
static void side_begun(Side *w, const S *start) {
    S longest = 1;
    for (int k = 0; k < GIVEN; k++) w->given[k] = start[k];
    for (int k = 0; k < NQ; k++) w->here[k] = start[k];
    make_unit(w->here);
    for (int m = 0; m < SIDE; m++) {
        w->from[m] = position_of(w->here, m);
        w->way[m] = way_of(w->from[m], w->goal[m], turns(m));
        if (!(SCALAR(fabs)(w->way[m]) * longest <= farthest(m))) longest = farthest(m) / SCALAR(fabs)(w->way[m]);
    }
    w->walked.done = 0, w->walked.step = w->walked.longest = longest;
    w->left = longest >= (S)WILD, w->whole = 0;
    w->guard = longest / longest; /* NaN: the way is not finite */
}

static void side_walked(Side *w) { w->whole = part_walked(side_part, w, &w->left, &w->walked); }

/* Gives the guard: OTHER_BRANCH where no way leads to the end. */
static S side_ended(Side *w) {
    if (!w->whole) return w->guard != w->guard ? w->guard : (S)OTHER_BRANCH;
    return RATED ? w->guard : side_rated(w);
}

static S walk(const S *start, const S *goal, S *result, S *room) {
    Side w;
    w.goal = goal, w.result = result, w.room = room;
    side_begun(&w, start);
    while (w.left) side_walked(&w);
    return side_ended(&w);
}
