/* The code of a program's single calls lies in one section. If the last call was long ago, others may have emptied
   the caches: the section is then read at once, as waiting for line after line while it runs takes twice the time.
   Reading the clock takes 10 ns; calls in a row need not read the code, which takes a tenth of their time. */
#if defined(__linux__) && defined(__ELF__) && defined(__GNUC__) && defined(__x86_64__)
#define FETCHED 64 /* bytes of a line */
#define LONG_AGO 100000 /* ticks of the clock, some 30 us */
#define IN_SECTION(part) __attribute__((section(#part)))
#define ENDS __attribute__((visibility("hidden"), weak)) /* null where the compiler leaves nothing in it */
static __attribute__((noinline, unused)) void fetch(const void *from, const void *to) {
    const char *line = (const char *)from; /* read, for wishes are dropped where the page is unknown, too */
    for (; line < (const char *)to; line += FETCHED) (void)*(const volatile char *)line;
}
#define FETCH(part, from, to)                                      \
    do {                                                           \
        extern const char __start_##part[] ENDS;                 \
        extern const char __stop_##part[] ENDS;                  \
        static unsigned long long last;                            \
        const unsigned long long now = __builtin_ia32_rdtsc();     \
        if (now - __atomic_load_n(&last, __ATOMIC_RELAXED) > LONG_AGO) { \
            fetch(__start_##part, __stop_##part);                  \
            fetch(from, to);                                       \
        }                                                          \
        __atomic_store_n(&last, now, __ATOMIC_RELAXED);            \
    } while (0)
#else
#define IN_SECTION(part)
#define FETCH(part, from, to) (void)0
#endif
