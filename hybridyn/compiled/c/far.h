/* Whether a joint moves further between prescribed positions, `apart` numbers apart, than the checks of one step can
   judge. Needs KINDS (the kind of each prescribed position, then -1) and FAR (the longest step of each). */
#define TURN (S)6.283185307179586
static int is_far(const S *g_0, const S *g_1, int apart) {
    for (int k = 0, i = 0; KINDS[k] >= 0; k++) {
        S way = g_1[i * apart] - g_0[i * apart];
        if (KINDS[k] == 1) way -= TURN * SCALAR(floor)(way / TURN + (S)0.5);
        if (!(way <= FAR[k]) || !(-way <= FAR[k])) return 1;
        i += KINDS[k] == 2 ? 7 : 1;
    }
    return 0;
}

