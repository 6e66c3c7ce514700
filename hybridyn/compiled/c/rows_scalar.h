/* Rows of samples in and out where a vector has one lane; B is the type outside. */
#define ALIGNED
/* Read rows; zero where all numbers are finite, else a NaN. */
INLINE V from_rows(V *to, const B *from, Long width, int valid) {
    (void)valid;
    for (Long k = 0; k < width; k++) to[k] = (V)from[k];
    return none(to, (int)width);
}
/* Write rows; zero where all numbers are finite, else a NaN. */
INLINE V to_rows(B *to, const V *from, Long width, int valid) {
    (void)valid;
    for (Long k = 0; k < width; k++) to[k] = (B)from[k];
    return none(from, (int)width);
}
INLINE V to_rows_apart(B *to, const V *from, Long width, Long apart, int valid) {
    (void)apart;
    return to_rows(to, from, width, valid);
}
