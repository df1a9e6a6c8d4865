/* See kernels.h. */

#include "kernels.h"

#define KERNELS(number)                                                                                                 \
  int32_t ls##number##_render(void *, void **, int64_t, int64_t, int64_t);                                              \
  int32_t ls##number##_begin(void *, void **, int64_t);                                                                 \
  int32_t ls##number##_kit_begin(void *, void **, int64_t, int64_t);                                                    \
  int32_t ls##number##_kit_follow(void *, void **, int64_t, int64_t, double);                                           \
  int32_t ls##number##_kit_prepare(void *, void **, int64_t, int64_t, int64_t);                                         \
  int32_t ls##number##_drive(void *, void **, int64_t, double, double, double);                                         \
  int32_t ls##number##_begin_convolver(void *, void **, int64_t, double, int64_t);                                      \
  int32_t ls##number##_measure(void *, void **, int64_t, double, double, double, int64_t);                              \
  int32_t ls##number##_prepare(void *, void **, int64_t, int64_t, double, double, double, int64_t, int64_t);            \
  int32_t ls##number##_weigh(void *, void **, int64_t, double, double, int64_t);                                        \
  int32_t ls##number##_mix(void *, void **, int64_t, int64_t, int64_t, int64_t, int64_t);                               \
  static const kernels kernels##number = {ls##number##_render, ls##number##_begin, ls##number##_kit_begin,              \
    ls##number##_kit_follow, ls##number##_kit_prepare, ls##number##_drive, ls##number##_begin_convolver,                \
    ls##number##_measure, ls##number##_prepare, ls##number##_weigh, ls##number##_mix};

KERNELS(0)

#if defined(__x86_64__)
#include <cpuid.h>

KERNELS(1)

/* Whether the processor has the level x86-64-v3 of the x86-64 psABI, and the system keeps its wide registers. */
static int has_v3(void) {
  const uint32_t features = bit_FMA | bit_MOVBE | bit_OSXSAVE | bit_AVX | bit_F16C, more = bit_BMI | bit_AVX2 | bit_BMI2;
  uint32_t a, b, c, d, kept, high;
  if (!__get_cpuid(1, &a, &b, &c, &d) || (c & features) != features) return 0;
  if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || (b & more) != more) return 0;
  if (!__get_cpuid(0x80000001, &a, &b, &c, &d) || !(c & bit_LZCNT)) return 0;
  __asm__("xgetbv" : "=a"(kept), "=d"(high) : "c"(0));
  return (kept & 6) == 6;
}

const kernels *kernels_here(void) { return has_v3() ? &kernels1 : &kernels0; }
#else
const kernels *kernels_here(void) { return &kernels0; }
#endif
