/* A thread of the system's own kind. */

#ifndef LS_THREAD_H
#define LS_THREAD_H

#include <stdint.h>

typedef struct { void (*run)(void *); void *with; uintptr_t handle; } thread; /* handle 0: it does not run */

void thread_begin(thread *, void (*run)(void *), void *with); /* it stays where it is */
void thread_end(thread *);                                    /* waits until it has ended, if it runs */
void thread_pause(void);                                      /* a few milliseconds */

#endif
