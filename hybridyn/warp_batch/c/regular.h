/* The guard of a posture as a step measures it: the part of its usual size that a pivot must have, over the smallest pivot.
   `given`: q, v. Needs the lift of `steps.h`. */
static S regular(const S *given) {
    S xi[NV], least = 1;
    Lifted at;
    for (int k = 0; k < NV; k++) xi[k] = 0;
    return lifted(given, xi, given + NQ, &at, &least) ? (S)HUGE_VAL : (S)GOOD / least;
}
