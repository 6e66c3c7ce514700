/* What is left when the modules are closed: the base, and the guard, NaN where a number that is read is not finite. Needs
   `rows.h`, BASE (coordinates of a base that moves, else 0), MODULES, and sizes of what is read. */
static S worse(S guard, S other) { return guard != guard || other <= guard ? guard : other; }

static S based(const Rows &r, S guard) {
    S squares = 0;
    for (int k = 0; k < ROBOT_NQ; k++) guard += r.near[k] * (S)0;
    for (int m = 0; m < MOTORS; m++) guard += (r.position[m] + r.rate[m] + r.acceleration[m]) * (S)0;
    for (int k = 0; k < PARAMETERS; k++) guard += r.parameters[k] * (S)0;
    for (int k = 3; k < BASE; k++) squares += r.near[k] * r.near[k];
    for (int k = 0; k < BASE; k++) r.q[k] = k < 3 ? r.near[k] : r.near[k] / SCALAR(sqrt)(squares);
    for (int k = 0; k < BASE - 1; k++) r.v[k] = r.a[k] = 0;
    return guard;
}

/* The same where threads have closed the modules, with their `guards`. */
static S joined(const Rows &r, const Row &guards) {
    S guard = 0;
    for (int k = 0; k < MODULES; k++) guard = worse(guard, guards[k]);
    return based(r, guard);
}
