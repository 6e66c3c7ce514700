/* The efforts behind a motion of which `closed` is the guard. Needs `rows.h` and the program "idm", which reads q, v, a and
   parameters. */
static S efforts(const Rows &r, const Row &tau, S closed) {
    enum { STATE = ROBOT_NQ + 2 * ROBOT_NV };
    S state[STATE + PARAMETERS], found[MOTORS];
    if (!(closed <= 1)) return closed;
    for (int k = 0; k < ROBOT_NQ; k++) state[k] = r.q[k];
    for (int k = 0; k < ROBOT_NV; k++) state[ROBOT_NQ + k] = r.v[k], state[ROBOT_NQ + ROBOT_NV + k] = r.a[k];
    for (int k = 0; k < PARAMETERS; k++) state[STATE + k] = r.parameters[k];
    const S inverse = idm_run(state, found, 0);
    for (int m = 0; m < MOTORS; m++) tau[m] = found[m];
    return inverse <= closed ? closed : inverse;
}
