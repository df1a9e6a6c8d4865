/* A thread of the system's own kind. */

#ifndef LS_THREAD_H
#define LS_THREAD_H

void *thread_begin(void (*run)(void *), void *with); /* NULL: the system gives none */
void thread_end(void *);                             /* waits until it has ended; NULL: nothing */
void thread_pause(void);                             /* a few milliseconds */

#endif
