/* A control step: the walk, then the efforts. `start` and `goal` are those of `walk`, and `result` q, v, a and the efforts.
   Needs `side.h` and the program "idm", which reads q, v, a, the parameters and WRENCHES numbers: these follow in `start`. */
static S control(const S *start, const S *goal, S *result, S *room) {
    S state[GIVEN + WRENCHES];
    const S closed = walk(start, goal, result, room);
    if (!(closed <= 1)) return closed;
    for (int k = 0; k < GIVEN + WRENCHES; k++) state[k] = k < NQ + 2 * NV ? result[k] : start[k];
    const S inverse = idm_run(state, result + NQ + 2 * NV, room);
    return inverse <= closed ? closed : inverse;
}
