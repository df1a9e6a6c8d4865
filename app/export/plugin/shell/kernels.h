/* The compiled kernels as the plug-in calls them, and the records that they share with it.

   layout.h is written by layout.py: records of the image and of the kernels' memory, whose fields Python names and
   explains, and the kernels' entries. */

#ifndef LS_KERNELS_H
#define LS_KERNELS_H

#include <stddef.h>

#include "layout.h"

/* The kernels for the processor that the plug-in runs on. Each returns 0, or that it failed. */
#define POINTER(_, name, ...) int32_t (*name)(void *result, void **error, __VA_ARGS__);
typedef struct { ENTRIES(POINTER, ) } kernels;
const kernels *kernels_here(void);
#define CALL(own, entry, ...) ((own)->kernels->entry(&(void *){NULL}, &(void *){NULL}, __VA_ARGS__))

static inline int64_t address_of(const void *pointer) { return (int64_t)(intptr_t)pointer; }

#endif
