/* The compiled kernels of the processors for which they were built, and the choice between them. */

#include "kernels.h"

#define DECLARED(number, name, ...) int32_t ls##number##_##name(void *, void **, __VA_ARGS__);
#define ENTRY(number, name, ...) .name = ls##number##_##name,
#define KERNELS(number) ENTRIES(DECLARED, number) static const kernels kernels##number = {ENTRIES(ENTRY, number)};

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
