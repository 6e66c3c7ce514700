/* The loops closed from one side's positions, along the branch of a posture: for exported C and for Warp. Needs the numbers
   of `walking.walk_text`: NQ, NV, SIDE (joints of the side), GIVEN (size of what the program reads), NUMBERS (of which at its
   end are parameters), POSED (whether the side's positions are among it), and the rules of a walk; the programs "close" and
   "turning"; `at` and `turns`, the places of the side's joints in q, and `farthest`, how far each may move in one part of the
   way; `unit_size`, how many coordinates of length one begin at each coordinate. `room`: memory of the programs. */
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

/* Newton's method from the posture that `given` begins with; the guard, which measures the last step. */
static S newton(S *given, S *result, S *room) {
    S guard = 2, before = (S)(LONGEST / CONTRACTION);
    for (int n = 0; n < NEWTON_STEPS; n++) {
        const int once_more = guard <= 1;
        guard = close_run(given, result, room);
        const S step = guard * (S)CLOSED;
        if (guard <= (S)SETTLED || (once_more && guard <= 1)) return guard;
        if (!(step <= (S)CONTRACTION * before || guard <= 1)) return guard;
        before = step;
        for (int k = 0; k < NQ; k++) given[k] = result[k];
    }
    return guard;
}

/* The guard of a part of the way: above 1 where another branch could lie between its ends. */
static S turned(const S *given, const S *here, const S *there, S *room) {
    S both[2 * NQ + NUMBERS];
    for (int k = 0; k < NQ; k++) both[k] = here[k], both[NQ + k] = there[k];
    for (int k = 0; k < NUMBERS; k++) both[2 * NQ + k] = given[GIVEN - NUMBERS + k];
    return turning_run(both, both, room);
}

/* Walk to the positions `goal` in steps as long as Newton's method agrees, from `start`, what the program reads of a closed
   posture. Gives the guard: OTHER_BRANCH where no way leads there. */
static S walk(const S *start, const S *goal, S *result, S *room) {
    S given[GIVEN], here[NQ], from[SIDE], way[SIDE], done = 0, part = 1, longest = 1, guard;
    for (int k = 0; k < GIVEN; k++) given[k] = start[k];
    for (int k = 0; k < NQ; k++) here[k] = start[k];
    make_unit(here);
    for (int m = 0; m < SIDE; m++) {
        from[m] = position_of(here, m);
        way[m] = goal[m] - from[m];
        if (turns(m)) way[m] -= (S)6.283185307179586 * SCALAR(floor)(way[m] / (S)6.283185307179586 + (S)0.5);
        if (!(SCALAR(fabs)(way[m]) * longest <= farthest(m))) longest = farthest(m) / SCALAR(fabs)(way[m]);
    }
    if (!(longest > 0)) return longest / longest; /* NaN: the way is not finite */
    if (longest < (S)SHORTEST_PART) return (S)OTHER_BRANCH; /* a wild goal */
    for (;;) {
        if (part > longest) part = longest;
        const int last = done + part >= 1;
        for (int k = 0; k < NQ; k++) given[k] = here[k];
        for (int m = 0; m < SIDE; m++) place(given, m, last ? goal[m] : from[m] + (done + part) * way[m]);
        guard = newton(given, result, room);
        const S turn = guard <= 1 ? turned(start, here, result, room) : 0;
        if (!(turn <= 1)) guard = turn;
        if (guard <= 1) {
            if (last) return guard;
            for (int k = 0; k < NQ; k++) here[k] = result[k];
            done += part, part *= 2;
        } else if (guard != guard) {
            return guard;
        } else if (part <= (S)SHORTEST_PART) {
            return (S)OTHER_BRANCH;
        } else {
            part /= 2;
        }
    }
}
