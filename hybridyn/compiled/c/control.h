/* The efforts of a control step: the loops closed from the motors, then the inverse model of the motion found, whose
   guard need not compare the loops again. Needs NQ, NV, EFFORTS, and the single call of "idm". */
typedef int (*CloseRow)(const Array *const *, S *);

/* A function of Python, METH_FASTCALL: the arrays of `close_row`, then room for q, v, a and the efforts. Answers 0; 1
   where the loops are not closed; 2 where they are, and the efforts are not certain. `self` is an array of the address
   of `close_row` in `closing.h`: robots whose loops differ may share this library. */
EXPORT const void *control_call(const Array *self, const Array *const *a, Long count) {
    CloseRow close_row;
    memcpy(&close_row, self->data, sizeof(close_row));
    S *result = count == 5 ? numbers(a[4], NQ + 2 * NV + EFFORTS) : 0;
    if (!result || close_row(a, result)) return answered(1);
    const S *in[3] = {result, result + NQ, result + NQ + NV};
    return answered(idm_single_at(in, result + NQ + 2 * NV));
}
