/* The motion of all joints from the motors': `given` holds a posture, positions, rates and accelerations of the motors, and
   parameters; `result` gets q, v, a. Needs MODULES, `module_of`, BASE (coordinates of a base that moves, else 0), and GIVEN. */
static S follow(const S *given, S *result) {
    S guard = 0, squares = 0;
    for (int k = 0; k < ROBOT_GIVEN; k++) guard += given[k] * (S)0; /* not finite: NaN */
    for (int k = 0; k < ROBOT_NQ; k++) result[k] = given[k];
    for (int k = 0; k < 2 * ROBOT_NV; k++) result[ROBOT_NQ + k] = 0;
    for (int k = 3; k < BASE; k++) squares += given[k] * given[k];
    for (int k = 3; k < BASE; k++) result[k] /= SCALAR(sqrt)(squares);
    for (int k = 0; k < MODULES && guard <= 1; k++) {
        const S own = module_of(k, given, result);
        if (!(own <= guard)) guard = own;
    }
    return guard;
}
