/* The motion of all joints from the motors', then the efforts. Needs `motors.h`, INVERSE and EFFORTS. */
static S control(const S *given, S *result) {
    S state[INVERSE];
    const S closed = follow(given, result);
    if (!(closed <= 1)) return closed;
    for (int k = 0; k < NQ + 2 * NV; k++) state[k] = result[k];
    for (int k = NQ + 2 * NV; k < INVERSE; k++) state[k] = given[NQ + 3 * SIDE + k - NQ - 2 * NV];
    const S inverse = idm_run(state, result + NQ + 2 * NV);
    return inverse <= closed ? closed : inverse;
}
