/* Motor efforts as functions of time and state: those of `scenes.controllers`, or a program of the user.
   Needs NQ, NV, EFFORTS, LAW (calls a program). Each gives 0 where the efforts are certain. */
#define PI (S)3.141592653589793
#define ROOM (EFFORTS ? EFFORTS : 1)
enum { CONSTANT, TABLE, PD, TORQUE, FUNCTION };

typedef struct {
    Long kind, pieces, holds;         /* holds: whether the reference rests after its end; else it ends there */
    S latest;                         /* latest time of the reference before its rest */
    const S *bound;                   /* limits of the efforts, or NULL */
    const S *time, *width, *piece;    /* the reference: times, widths, polynomials (pieces + 1, 6, EFFORTS) */
    const S *kp, *kd;
    const Long *at, *column, *turns;  /* of the motors, as `scenes.references.MotorAxes` */
#ifndef __cplusplus
    int (*close)(const S *const *, S *), (*idm)(const S *const *, S *);
    int (*ddm)(const S *const *, S *); /* in place of both where the loops do not give all accelerations */
    int (*function)(S);               /* reads q and v, writes `effort` */
#endif
    S *effort, *q, *v;
    S *gain;                          /* room for a matrix (EFFORTS, EFFORTS), where `ddm` is called */
} Law;

/* Motors' positions, rates and accelerations (or efforts in place of the positions) of the reference. */
static int referred(const Law *law, S t, S x[3][ROOM]) {
    Long low = 0, high = law->pieces;
    const int over = t > law->latest;
    if (!(t >= law->time[0]) || (over && !law->holds)) return 1;
    while (high - low > 1) {
        const Long middle = (low + high) / 2;
        if (law->time[middle] <= t) low = middle;
        else high = middle;
    }
    if (over) low = law->pieces; /* at rest */
    const S h = law->width[low], s = over ? 0 : (t - law->time[low]) / h;
    const S *c = law->piece + low * 6 * EFFORTS;
    for (int m = 0; m < EFFORTS; m++, c++) {
        const S c1 = c[EFFORTS], c2 = c[2 * EFFORTS], c3 = c[3 * EFFORTS], c4 = c[4 * EFFORTS], c5 = c[5 * EFFORTS];
        x[0][m] = c[0] + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))));
        x[1][m] = (c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * (5 * c5))))) / h;
        x[2][m] = (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * (20 * c5)))) / (h * h);
    }
    return 0;
}

/* Position errors of the motors in x[0], rate errors in x[1]. */
static void missed(const Law *law, const S *q, const S *v, S x[3][ROOM]) {
    for (int m = 0; m < EFFORTS; m++) {
        const S *own = q + law->at[m];
        S off = x[0][m] - (law->turns[m] ? SCALAR(atan2)(own[1], own[0]) : own[0]);
        if (law->turns[m]) {
            off = SCALAR(fmod)(off + PI, 2 * PI);
            off = (off < 0 ? off + 2 * PI : off) - PI;
        }
        x[0][m] = off;
        x[1][m] -= v[law->column[m]];
    }
}

#ifndef __cplusplus
/* The efforts that give the motors the accelerations x, other joints none: accelerations are those without efforts, and
   a symmetric matrix times the efforts, which Cholesky's method solves. Large efforts find its columns exactly. */
static int driving(const Law *law, const S *q, const S *v, const S *x, S *tau) {
    const S large = 1LL << 30, *in[3] = {q, v, tau};
    S a[NV], free[ROOM], *L = law->gain;
    for (int k = -1; k < EFFORTS; k++) {
        for (int m = 0; m < EFFORTS; m++) tau[m] = m == k ? large : 0;
        if (law->ddm(in, a)) return 1;
        for (int m = 0; m < EFFORTS; m++) {
            if (k < 0) free[m] = a[law->column[m]];
            else L[m * EFFORTS + k] = a[law->column[m]] - free[m];
        }
    }
    for (int k = 0; k < EFFORTS; k++) {
        S *row = L + k * EFFORTS;
        const S least = (S)1e-10 * row[k];
        tau[k] = x[k] - free[k];
        for (int m = 0; m <= k; m++) {
            const S *other = L + m * EFFORTS;
            for (int i = 0; i < m; i++) row[m] -= row[i] * other[i];
            if (m < k) row[m] /= other[m], tau[k] -= row[m] * tau[m];
        }
        if (!(row[k] > least)) return 1; /* motors that move the same */
        row[k] = SCALAR(sqrt)(row[k]);
        tau[k] /= row[k];
    }
    for (int k = EFFORTS - 1; k >= 0; k--) {
        for (int m = k + 1; m < EFFORTS; m++) tau[k] -= L[m * EFFORTS + k] * tau[m];
        tau[k] /= L[k * EFFORTS + k];
    }
    for (int k = 0; k < EFFORTS; k++) tau[k] *= large;
    return 0;
}
#endif

/* The inverse model of the motors' accelerations in x[2], of which the loops give those of all joints. */
static int inverse_of(const Law *law, const S *q, const S *v, const S x[3][ROOM], S *tau) {
#ifndef __cplusplus
    if (law->ddm) return driving(law, q, v, x[2], tau);
#endif
    S a[NV], closed[NQ + 2 * NV];
    for (int i = 0; i < NV; i++) a[i] = 0;
    for (int m = 0; m < EFFORTS; m++) a[law->column[m]] = x[2][m];
    const S *in[3] = {q, v, a};
    if (LAW(close)(in, closed)) return 1;
    in[2] = closed + NQ + NV;
    return LAW(idm)(in, tau);
}

static int efforts(const Law *law, S t, const S *q, const S *v, S *tau) {
    S x[3][ROOM];
    if (law->kind == CONSTANT) {
        memcpy(tau, law->effort, EFFORTS * sizeof(S));
    } else if (law->kind == FUNCTION) {
        memcpy(law->q, q, sizeof(S[NQ]));
        memcpy(law->v, v, sizeof(S[NV]));
        if (LAW(function)(t)) return 1;
        memcpy(tau, law->effort, EFFORTS * sizeof(S));
    } else {
        if (referred(law, t, x)) return 1;
        if (law->kind != TABLE) missed(law, q, v, x);
        for (int m = 0; m < EFFORTS; m++) {
            if (law->kind == TABLE) tau[m] = x[0][m];
            else if (law->kind == PD) tau[m] = law->kp[m] * x[0][m] + law->kd[m] * x[1][m];
            else x[2][m] += law->kp[m] * x[0][m] + law->kd[m] * x[1][m];
        }
        if (law->kind == TORQUE && inverse_of(law, q, v, (const S(*)[ROOM])x, tau)) return 1;
    }
    if (none_of(tau, EFFORTS) != 0) return 1;
    for (int m = 0; law->bound && m < EFFORTS; m++) {
        if (tau[m] > law->bound[m]) tau[m] = law->bound[m];
        else if (tau[m] < -law->bound[m]) tau[m] = -law->bound[m];
    }
    return 0;
}

/* Efforts at many states; gives at how many they are certain. */
EXPORT Long law_efforts(const Law *law, Long rows, const S *t, const S *q, const S *v, S *tau) {
    for (Long k = 0; k < rows; k++)
        if (efforts(law, t[k], q + k * NQ, v + k * NV, tau + k * EFFORTS)) return k;
    return rows;
}
