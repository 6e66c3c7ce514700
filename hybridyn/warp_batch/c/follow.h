/* The motion of all joints, one module after the other. Needs `joined.h` and `module_of`. */
static S follow(const Rows &r) {
    S guard = 0;
    for (int k = 0; k < MODULES && guard <= 1; k++) guard = worse(guard, module_of(k, r));
    return based(r, guard);
}
