/* A way that is walked in parts: of tables, designs (`advance.h`), exported C and Warp (`side.h`), W lanes or one. Needs
   `newton.h`. */
#define TURN (S)6.283185307179586

/* How far a position moves; an angle by the shorter way. */
INLINE S way_of(S from, S to, int angle) {
    const S way = to - from;
    return angle ? way - TURN * SCALAR(floor)(way / TURN + (S)0.5) : way;
}

/* Makes a part of the way, between 0 and 1; gives the lanes of `left` where it can be made, and takes out those that end.
   `times`: how many times as long the next part is; at most a half where this one cannot be made. */
typedef M Part(void *way, M *left, V done, V to, V *times);

/* How much of the way is done, and how long the next part of it is, at most `longest`. */
typedef struct {
    V done, step, longest;
} Walked;

/* Make the next part. Gives the lanes that come to the end with it. */
INLINE M part_walked(Part *part, void *way, M *left, Walked *w) {
    V step = SELECT(LT(w->longest, w->step), w->longest, w->step), times = C(0);
    const M last = LE(C(1) - w->done, step);
    const V to = SELECT(last, C(1), w->done + step);
    step = SELECT(last, C(1) - w->done, step);
    const M good = part(way, left, w->done, to, &times), whole = AND(good, last);
    *left = AND(*left, AND(NOT(whole), OR(good, LT(C(SHORTEST), step))));
    w->done = SELECT(good, to, w->done);
    w->step = times * step;
    return whole;
}

/* Walk in parts. Gives the lanes that come to the end. */
INLINE M walked(Part *part, void *way, M left, V first, V longest) {
    M whole = NOT(EVERY);
    Walked w = {C(0), first, longest};
    while (ANY(left)) whole = OR(whole, part_walked(part, way, &left, &w));
    return whole;
}
