/* Whether a joint moves further between prescribed positions, `apart` numbers apart, than the checks of one step can
   judge. Needs `walk.h`, KINDS (the kind of each prescribed position, then -1) and FAR (the longest step of each). */
static int is_far(const S *g_0, const S *g_1, int apart) {
    for (int k = 0, i = 0; KINDS[k] >= 0; k++) {
        const S way = way_of(g_0[i * apart], g_1[i * apart], KINDS[k] == 1);
        if (!(way <= FAR[k]) || !(-way <= FAR[k])) return 1;
        i += KINDS[k] == 2 ? 7 : 1;
    }
    return 0;
}

/* What is prescribed between g_0 and g_1, numbers `apart`: angles by the shorter way, poses about a fixed axis. */
static void between(const S *g_0, const S *g_1, S f, S *g, int apart) {
    for (int k = 0, i = 0; KINDS[k] >= 0; k++) {
        const int numbers = KINDS[k] == 2 ? 3 : 1;
        for (int j = 0; j < numbers; j++, i += apart) g[i] = g_0[i] + f * way_of(g_0[i], g_1[i], KINDS[k] == 1);
        if (KINDS[k] != 2) continue;
        S cosine = 0, sine = 0, other[4];
        for (int j = 0; j < 4; j++) cosine += g_0[i + j * apart] * g_1[i + j * apart];
        const S sign = cosine < 0 ? -1 : 1;
        for (int j = 0; j < 4; j++) {
            other[j] = sign * g_1[i + j * apart] - sign * cosine * g_0[i + j * apart];
            sine += other[j] * other[j];
        }
        sine = SCALAR(sqrt)(sine);
        const S angle = f * SCALAR(atan2)(sine, sign * cosine);
        for (int j = 0; j < 4; j++, i += apart)
            g[i] = SCALAR(cos)(angle) * g_0[i] + (sine > 0 ? SCALAR(sin)(angle) / sine * other[j] : 0);
    }
}
