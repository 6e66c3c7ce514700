/* The motion of all joints, then the efforts behind it in `result`. Needs `modules.h`, and the program "idm", which reads q, v,
   a and what follows the motors in `given`. */
static S control(const S *given, S *result) {
    enum { STATE = ROBOT_NQ + 2 * ROBOT_NV, READ = ROBOT_NQ + 3 * MOTORS };
    S state[STATE + ROBOT_GIVEN - READ];
    const S closed = follow(given, result);
    if (!(closed <= 1)) return closed;
    for (int k = 0; k < STATE; k++) state[k] = result[k];
    for (int k = READ; k < ROBOT_GIVEN; k++) state[STATE + k - READ] = given[k];
    const S inverse = idm_run(state, result + STATE, 0);
    return inverse <= closed ? closed : inverse;
}
