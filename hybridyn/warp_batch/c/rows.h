/* A row of an array of Warp, and the rows of a sample: what its motion follows from, and the motion of all joints. */
struct Row {
    char *data;
    long long apart;
    CUDA_CALLABLE S &operator[](int i) const { return *(S *)(data + i * apart); }
};
struct Rows {
    Row near, position, rate, acceleration, parameters, q, v, a;
};
