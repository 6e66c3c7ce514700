/* The motion of one module from the motors': number k of those of its shape. Needs `side.h` of the shape, `numbers_of`, and
   the places in the robot of a module's coordinates `q_of`, freedoms `v_of` and motors `motor_of`. */
static S module_closed(int k, const Rows &r) {
    S start[GIVEN], goal[SIDE + !SIDE], found[NQ + 2 * NV];
    for (int i = 0; i < NQ; i++) start[i] = r.near[q_of(k, i)];
    for (int i = 0; i < 2 * NV; i++) start[NQ + i] = 0;
    for (int m = 0; m < SIDE; m++) {
        const int at = motor_of(k, m);
        goal[m] = r.position[at];
        start[NQ + column(m)] = r.rate[at];
        start[NQ + NV + column(m)] = r.acceleration[at];
    }
    numbers_of(k, r.parameters, start + NQ + 2 * NV);
    const S guard = walk(start, goal, found, 0);
    for (int i = 0; i < NQ; i++) r.q[q_of(k, i)] = found[i];
    for (int i = 0; i < NV; i++) r.v[v_of(k, i)] = found[NQ + i], r.a[v_of(k, i)] = found[NQ + NV + i];
    return guard;
}
