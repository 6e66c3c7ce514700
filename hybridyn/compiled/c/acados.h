/* The direct model over the motors as acados calls it, with two orders of derivatives: functions with the arguments of those
   that CasADi writes. x: positions and rates of the motors; u: their efforts; p: a posture from which the motors move
   straight to x. Matrices go by columns, and an array that is not given is zero. Where a guard is above 1, results are NaN, and
   the function gives 1. Needs `side.h`, the model and its derivatives over motors, and the numbers of `acados.acados_text`;
   NAMED gives functions their names. */
typedef struct { S x[NX], state[NQ + 2 * NV], given[TAKEN], found[FOUND], room[ROOM_OF_ACADOS]; } Acados;

static void take(S *y, const S *x, int n) {
    for (int k = 0; k < n; k++) y[k] = x ? x[k] : 0;
}

static int failed(S guard, S **res, const int *sizes, int n) {
    if (guard <= 1) return 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; res[i] && k < sizes[i]; k++) res[i][k] = (S)NAN;
    return 1;
}

/* Closes the loops, and runs a program of their positions, rates, efforts and what else `given` has; gives the guard. */
static S closed(Acados *w, const S *x, const S *u, const S *p) {
    S start[GIVEN];
    take(w->x, x, NX), take(start, 0, GIVEN), take(start, p, NQ);
    for (int m = 0; m < NU; m++) start[NQ + column(m)] = w->x[NU + m];
    const S guard = walk(start, w->x, w->state, w->room);
    take(w->given, 0, TAKEN), take(w->given, w->state, NQ + NV), take(w->given + NQ + NV, u, NU);
    return guard;
}

static S modelled(Acados *w, const S *x, const S *u, const S *p, S run(const S *, S *, S *)) {
    const S guard = closed(w, x, u, p);
    return guard <= 1 ? run(w->given, w->found, w->room) : guard;
}

static void rates(const Acados *w, S *f) {
    for (int m = 0; f && m < NU; m++) f[m] = w->x[NU + m], f[NU + m] = w->found[column(m)];
}

/* The derivative of the acceleration of a motor: over positions, rates and efforts, one after the other. */
static S slope(const Acados *w, int m, int k) { return w->found[NV + (k / NU * NU + m) * NU + k % NU]; }

int NAMED(expl_ode_fun)(const S **arg, S **res, casadi_int *iw, S *work, int mem) {
    const int sizes[] = {NX};
    Acados *w = (Acados *)(void *)work;
    (void)iw, (void)mem;
    if (failed(modelled(w, arg[0], arg[1], arg[2], ddm_run), res, sizes, 1)) return 1;
    rates(w, res[0]);
    return 0;
}

int NAMED(expl_vde_forw)(const S **arg, S **res, casadi_int *iw, S *work, int mem) {
    const int sizes[] = {NX, NX * NX, NX * NU}, columns[] = {NX, NU};
    Acados *w = (Acados *)(void *)work;
    S d[NX];
    (void)iw, (void)mem;
    if (failed(modelled(w, arg[0], arg[3], arg[4], ddm_motor_jacobian_run), res, sizes, 3)) return 1;
    rates(w, res[0]);
    for (int i = 0; i < 2; i++)
        for (int j = 0; res[1 + i] && j < columns[i]; j++) {
            S *y = res[1 + i] + j * NX;
            take(d, arg[1 + i] ? arg[1 + i] + j * NX : 0, NX);
            for (int m = 0; m < NU; m++) {
                y[m] = d[NU + m], y[NU + m] = i ? slope(w, m, NX + j) : 0;
                for (int k = 0; k < NX; k++) y[NU + m] += slope(w, m, k) * d[k];
            }
        }
    return 0;
}

int NAMED(expl_vde_adj)(const S **arg, S **res, casadi_int *iw, S *work, int mem) {
    const int sizes[] = {NX + NU};
    Acados *w = (Acados *)(void *)work;
    S weights[NX];
    (void)iw, (void)mem;
    if (failed(modelled(w, arg[0], arg[2], arg[3], ddm_motor_jacobian_run), res, sizes, 1)) return 1;
    take(weights, arg[1], NX);
    for (int k = 0; res[0] && k < NX + NU; k++) {
        res[0][k] = k / NU == 1 ? weights[k - NU] : 0;
        for (int m = 0; m < NU; m++) res[0][k] += weights[NU + m] * slope(w, m, k);
    }
    return 0;
}

/* Column j of what x and u follow, by Sx and Su: NX + NU numbers. */
static void followed(const S **arg, int j, S *d) {
    const S *S_j = j < NX ? arg[1] : arg[2];
    take(d, S_j ? S_j + (j < NX ? j : j - NX) * NX : 0, NX);
    for (int m = 0; m < NU; m++) d[NX + m] = j == NX + m;
}

int NAMED(expl_ode_hess)(const S **arg, S **res, casadi_int *iw, S *work, int mem) {
    const int sizes[] = {NX + NU, (NX + NU) * (NX + NU + 1) / 2};
    Acados *w = (Acados *)(void *)work;
    S weights[NX], d[NX + NU], *lower = res[1], *along = w->given + NQ + NV + NU;
    S guard = closed(w, arg[0], arg[4], arg[5]);
    (void)iw, (void)mem;
    if (failed(guard, res, sizes, 2)) return 1;
    take(weights, arg[3], NX);
    for (int m = 0; m < NU; m++) along[2 * NV + NU + column(m)] = weights[NU + m];
    for (int j = 0; j < NX + NU; j++) {
        followed(arg, j, d);
        for (int m = 0; m < NU; m++) along[column(m)] = d[m], along[NV + column(m)] = d[NU + m], along[2 * NV + m] = d[NX + m];
        if (failed(ddm_motor_product_run(w->given, w->found, w->room), res, sizes, 2)) return 1;
        for (int i = j; lower && i < NX + NU; i++, lower++) {
            followed(arg, i, d), *lower = 0;
            for (int m = 0; m < NU; m++)
                *lower += d[m] * w->found[Q_PRODUCT + column(m)] + d[NU + m] * w->found[V_PRODUCT + column(m)]
                    + d[NX + m] * w->found[TAU_PRODUCT + m];
        }
    }
    for (int m = 0; res[0] && m < NU; m++) {
        res[0][m] = w->found[Q_SLOPE + column(m)], res[0][NU + m] = weights[m] + w->found[V_SLOPE + column(m)];
        res[0][NX + m] = w->found[TAU_SLOPE + m];
    }
    return 0;
}
