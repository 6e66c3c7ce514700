/* Vectors whose lanes hold equal legs (extensions of GCC and Clang), with the same bits. */
#ifdef DOUBLE
#define I long long
#define SCALAR_FMA __builtin_fma
#else
#define I int
#define SCALAR_FMA __builtin_fmaf
#endif
#define SCALAR(name) FUNCTION(name)
#define ROOM(x) ((V *)(((__UINTPTR_TYPE__)(x) + sizeof(V) - 1) / sizeof(V) * sizeof(V)))
