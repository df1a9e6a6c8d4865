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
  int32_t (*drive)(void *result, void **error, int64_t mixer, double drive_db, double tone_db, double level_db);
  int32_t (*begin_convolver)(void *result, void **error, int64_t convolver, double rate_hz, int64_t frames);
  int32_t (*measure)(void *result, void **error, int64_t body, double rate_hz, double size, double t60_s, int64_t needs);
  int32_t (*prepare)(void *result, void **error, int64_t body, int64_t noise, double rate_hz, double size, double t60_s, int64_t found, int64_t memory);
  int32_t (*weigh)(void *result, void **error, int64_t found, double body_mix, double room_mix, int64_t weights);
  int32_t (*mix)(void *result, void **error, int64_t found, int64_t weights, int64_t into, int64_t first, int64_t count);
} kernels;

const kernels *kernels_here(void);

#endif
