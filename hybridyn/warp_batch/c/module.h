/* The motion of one module from the motors': number k of those of its shape. `given` and `result` are those of `follow` in
   `modules.h`. Needs `side.h` of the shape, `numbers_of`, and the places in the robot of a module's coordinates `q_of`,
   freedoms `v_of` and motors `motor_of`. */
static S module_closed(int k, const S *given, S *result) {
    S start[GIVEN], goal[SIDE + !SIDE], found[NQ + 2 * NV];
    const S *motors = given + ROBOT_NQ;
    for (int i = 0; i < NQ; i++) start[i] = given[q_of(k, i)];
    for (int i = 0; i < 2 * NV; i++) start[NQ + i] = 0;
    for (int m = 0; m < SIDE; m++) {
        const int at = motor_of(k, m);
        goal[m] = motors[at];
        start[NQ + column(m)] = motors[MOTORS + at];
        start[NQ + NV + column(m)] = motors[2 * MOTORS + at];
    }
    numbers_of(k, motors + 3 * MOTORS, start + NQ + 2 * NV);
    const S guard = walk(start, goal, found, 0);
    for (int i = 0; i < NQ; i++) result[q_of(k, i)] = found[i];
    for (int i = 0; i < NV; i++) {
        result[ROBOT_NQ + v_of(k, i)] = found[NQ + i];
        result[ROBOT_NQ + ROBOT_NV + v_of(k, i)] = found[NQ + NV + i];
    }
    return guard;
}
