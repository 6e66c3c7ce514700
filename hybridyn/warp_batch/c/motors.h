/* The motion of all joints from the motors': `given` holds a posture, and positions, rates and accelerations of the
   motors; `result` q, v, a, and what else WAY gives, `walk` or `control`. Needs `column`, the places of the motors in v. */
static S follow(const S *given, S *result) {
    S start[GIVEN];
    for (int k = 0; k < GIVEN; k++) start[k] = 0;
    for (int k = 0; k < NQ; k++) start[k] = given[k];
    for (int m = 0; m < SIDE; m++) {
        start[NQ + column(m)] = given[NQ + SIDE + m];
        start[NQ + NV + column(m)] = given[NQ + 2 * SIDE + m];
    }
    for (int k = NQ + 2 * NV; k < GIVEN; k++) start[k] = given[NQ + 3 * SIDE + k - NQ - 2 * NV]; /* parameters */
    return WAY(start, given + NQ, result, 0);
}
