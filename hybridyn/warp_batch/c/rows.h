/* A row of an array of Warp, and the rows of a sample: what its motion follows from, and the motion of all joints. */
struct Row {
    char *data;
    long long apart;
    CUDA_CALLABLE S &operator[](int i) const { return *(S *)(data + i * apart); }
};
struct Rows {
    Row near, position, rate, acceleration, parameters, q, v, a;
};

/* The same of all samples, and the guards of their modules. */
struct Table {
    char *data;
    long long rows, apart;
    CUDA_CALLABLE Row operator[](int i) const { return {data + i * rows, apart}; }
};
struct Tables {
    Table near, position, rate, acceleration, parameters, q, v, a, guards;
    CUDA_CALLABLE Rows operator[](int i) const {
        return {near[i], position[i], rate[i], acceleration[i], parameters[i], q[i], v[i], a[i]};
    }
};
