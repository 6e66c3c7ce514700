/* Steps of Runge-Kutta's method of order four on the closed loops. `given`: q, v, the length of a step, their number, then
   what the law reads, then parameters. Needs `laws.h`, `steps.h`, KIND, and `at`, `column`, `turns` of the motors. */
static S stepped(const S *given, S *result) {
    static const S A[16] = {0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1, 0};
    static const S b[4] = {(S)(1.0 / 6), (S)(1.0 / 3), (S)(1.0 / 3), (S)(1.0 / 6)}, c[4] = {0, 0.5, 0.5, 1};
    const Tableau method = {4, A, b, c, 0};
    const S *clock = given + NQ + NV, *x = clock + 2;
    const S time[2] = {0, (S)1e30}, width[2] = {1, 1};
    S piece[12 * ROOM], kp[ROOM], kd[ROOM], effort[ROOM], tau[ROOM], q[2 * NQ], v[2 * NV], a[2 * NV], least = 1;
    Long first[ROOM], places[ROOM], turning[ROOM];
    for (int k = 0; k < 12 * ROOM; k++) piece[k] = 0;
    for (int m = 0; m < EFFORTS; m++) {
        first[m] = at(m), places[m] = column(m), turning[m] = turns(m);
        effort[m] = x[m];
        if (KIND == CONSTANT) continue;
        for (int n = 0; n < 3; n++) piece[n * EFFORTS + m] = x[n * EFFORTS + m] / (n == 2 ? 2 : 1);
        if (KIND == TABLE) continue;
        kp[m] = x[3 * EFFORTS + m], kd[m] = x[4 * EFFORTS + m];
    }
    Law law;
    law.kind = KIND, law.pieces = 1, law.holds = 0, law.latest = time[1], law.bound = 0;
    law.time = time, law.width = width, law.piece = piece, law.kp = kp, law.kd = kd;
    law.at = first, law.column = places, law.turns = turning, law.effort = effort;
    law.v = (S *)x + (KIND == CONSTANT ? 1 : KIND == TABLE ? 3 : 5) * EFFORTS;
    for (int k = 0; k < NQ; k++) q[k] = given[k];
    for (int k = 0; k < NV; k++) v[k] = given[NQ + k];
    const S *in[3] = {q, v, tau};
    if (efforts(&law, 0, q, v, tau) || ddm_with(law.v, in, a)) return (S)HUGE_VAL;
    Work w;
    for (int n = 0; n < (int)clock[1]; n++) {
        S pivot;
        if (step_of(&method, &law, n * clock[0], clock[0], q, v, a, &pivot, &w)) return (S)HUGE_VAL;
        if (pivot < least) least = pivot;
        for (int k = 0; k < NQ; k++) q[k] = q[NQ + k];
        for (int k = 0; k < NV; k++) v[k] = v[NV + k], a[k] = a[NV + k];
    }
    for (int k = 0; k < NQ; k++) result[k] = q[k];
    for (int k = 0; k < NV; k++) result[NQ + k] = v[k], result[NQ + NV + k] = a[k];
    return (S)GOOD / least;
}
