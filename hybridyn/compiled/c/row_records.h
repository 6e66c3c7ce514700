/* What the programs "newton", "settle" and "branch" read and write, and the memory of `advance.h`. Needs its numbers. */
#ifndef SOME /* C99 has no arrays without numbers: there, they have one */
#define SOME(n) n
#endif
typedef struct {
    V q[NQ], p[SOME(NP)];
} Posture;
typedef struct {
    Posture at;
    V v[NV], a[NV];
} State;
typedef struct {
    V g[NG], g_dot[NR], g_ddot[NR];
} Given;
typedef struct {
    Posture at;
    V g[NG], slots[SOME(SLOTS)];
} NewtonIn;
typedef struct {
    Posture at;
    V step[MODULES], wrist[MODULES], open[MODULES], kept[SOME(KEPT)];
} NewtonOut;
typedef struct {
    Posture at, start;
    V g_0[NG];
    Given row;
    V kept[SOME(KEPT)], slots[SOME(SLOTS)];
} SettleIn;
typedef struct {
    State now;
    V step[MODULES], open[MODULES], turning[MODULES];
} SettleOut;
typedef struct {
    Posture start;
    V g_0[NG];
    Posture predicted, found;
    V g[NG], slots[SOME(SLOTS)];
} BranchIn;
typedef struct {
    V off[MODULES], turned[MODULES];
} BranchOut;
typedef struct {
    NewtonIn newton;
    NewtonOut moved;
    SettleIn settle;
    SettleOut settled;
    BranchIn branch;
    BranchOut about;
    State now;
    V first[MODULES], turning[MODULES], before[MODULES], taken[MODULES], later[MODULES], far, count, programs[PROGRAMS_WORK];
    Posture last, here; /* of a walk: the row before, how far it has come */
    V there[NG];
    Given row;
    State end;
} Work;
