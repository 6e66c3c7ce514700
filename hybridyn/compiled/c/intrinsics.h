/* Fused products and roots of other compilers than GCC, and of other widths. */
#ifndef ROOT
#if defined(__AVX__) || defined(__SSE2__)
#include <immintrin.h>
#endif
#if defined(__AVX512F__) && W == 8 && defined(DOUBLE)
#define X86(operation) _mm512_##operation##_pd
#define ANY_BIT(m) (_mm512_test_epi64_mask((__m512i)m, (__m512i)m) != 0)
#elif defined(__AVX__) && W == 4 && defined(DOUBLE)
#define X86(operation) _mm256_##operation##_pd
#elif defined(__SSE2__) && W == 2 && defined(DOUBLE)
#define X86(operation) _mm_##operation##_pd
#elif defined(__AVX512F__) && W == 16
#define X86(operation) _mm512_##operation##_ps
#elif defined(__AVX__) && W == 8 && !defined(DOUBLE)
#define X86(operation) _mm256_##operation##_ps
#elif defined(__SSE2__) && W == 4 && !defined(DOUBLE)
#define X86(operation) _mm_##operation##_ps
#endif
#ifdef X86
#define ROOT(x) X86(sqrt)(x)
#ifdef __FMA__
#define FUSED(operation, a, b, c) X86(operation)(a, b, c)
#endif
#endif
#endif
