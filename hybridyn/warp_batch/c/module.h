/* The motion of one module from the motors': number k of those of its shape. Needs `side.h` of the shape, `numbers_of`, and
   the places in the robot of a module's coordinates `q_of`, freedoms `v_of` and motors `motor_of`. */
static void module_begun(Side *w, S *goal, int k, const Rows &r) {
    S start[GIVEN];
    for (int i = 0; i < NQ; i++) start[i] = r.near[q_of(k, i)];
    for (int i = 0; i < 2 * NV; i++) start[NQ + i] = 0;
    for (int m = 0; m < SIDE; m++) {
        const int at = motor_of(k, m);
        goal[m] = r.position[at];
        start[NQ + column(m)] = r.rate[at];
        start[NQ + NV + column(m)] = r.acceleration[at];
    }
    numbers_of(k, r.parameters, start + NQ + 2 * NV);
    side_begun(w, start);
}

static S module_ended(Side *w, const S *found, int k, const Rows &r) {
    const S guard = side_ended(w);
    for (int i = 0; i < NQ; i++) r.q[q_of(k, i)] = found[i];
    for (int i = 0; i < NV; i++) r.v[v_of(k, i)] = found[NQ + i], r.a[v_of(k, i)] = found[NQ + NV + i];
    return guard;
}

static S module_closed(int k, const Rows &r) {
    S goal[SIDE + !SIDE], found[NQ + 2 * NV];
    Side w;
    w.goal = goal, w.result = found, w.room = 0;
    module_begun(&w, goal, k, r);
    while (w.left) side_walked(&w);
    return module_ended(&w, found, k, r);
}

/* Close modules of this shape in all samples, of which `first` is the number of the first one: every `threads`-th from number
   `thread`, in parts of the way. So threads that run at once begin the next one while others are still on theirs. */
static void modules_closed(int thread, int threads, int count, int modules, int first, const Tables &t) {
    S goal[SIDE + !SIDE], found[NQ + 2 * NV];
    Side w;
    w.goal = goal, w.result = found, w.room = 0;
    for (long long n = thread, begun = -1; n < (long long)count * modules;) {
        const int k = (int)(n / count), i = (int)(n % count);
        const Rows r = t[i];
        if (begun != n) module_begun(&w, goal, k, r), begun = n;
        if (w.left) side_walked(&w);
        if (!w.left) t.guards[i][first + k] = module_ended(&w, found, k, r), n += threads;
    }
}
