/* The compiled kernels, for the processor that the plug-in runs on. Each returns 0, or that it failed. */

#ifndef LS_KERNELS_H
#define LS_KERNELS_H

#include <stdint.h>

typedef struct {
  int32_t (*render)(void *result, void **error, int64_t mixer, int64_t frames, int64_t out);
  int32_t (*begin)(void *result, void **error, int64_t player);
  int32_t (*kit_begin)(void *result, void **error, int64_t kit, int64_t table);
  int32_t (*kit_follow)(void *result, void **error, int64_t kit, int64_t which, double value);
  int32_t (*kit_prepare)(void *result, void **error, int64_t kit, int64_t table, int64_t player);
  int32_t (*partition)(void *result, void **error, int64_t response, int64_t frames, int64_t channels, int64_t memory, int64_t convolver);
} kernels;

const kernels *kernels_here(void);

#endif
