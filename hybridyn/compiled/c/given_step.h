/* A control step from what is given: poses of links, and positions of joints. Needs `advance.h` in one lane, `side.h` (for
   `make_unit`), the programs "place", "measure" and "idm", OWN (numbers of the joints among those given) and WRENCHES. */
static S given_step(const S *last, const S *given, const S *rates, const S *accelerations, const S *wrenches, S *result,
                    Work *w) {
    S state[NQ + 2 * NV + WRENCHES], own[SOME(OWN)], guard;
    int k;
    for (k = 0; k < NQ; k++) w->now.at.q[k] = last[k];
    make_unit(w->now.at.q);
    guard = place_run(&w->now.at, &w->now.at, own, w->programs) * (S)(ROUNDING / CLOSED);
    if (!(guard <= 1)) return guard; /* the loops of `last` are open */
    guard = measure_run(&w->now.at, own, given, w->settle.g_0, w->settle.row.g, w->programs);
    if (!(guard <= 1)) return guard; /* a quaternion or a direction has another length than one */
    for (k = 0; k < NR; k++) {
        w->settle.row.g_dot[k] = rates[k];
        w->settle.row.g_ddot[k] = accelerations[k];
        guard += (rates[k] + accelerations[k]) * 0; /* not finite: NaN */
    }
    if (guard != guard) return guard;
    if (!closed(w, 1, 0, 0)) return (S)OTHER_BRANCH;
    for (k = 0; k < NQ; k++) result[k] = state[k] = w->now.at.q[k];
    for (k = 0; k < NV; k++) result[NQ + k] = state[NQ + k] = w->now.v[k];
    for (k = 0; k < NV; k++) result[NQ + NV + k] = state[NQ + NV + k] = w->now.a[k];
    for (k = 0; k < WRENCHES; k++) state[NQ + 2 * NV + k] = wrenches[k];
    return idm_run(state, result + NQ + 2 * NV, w->programs);
}
