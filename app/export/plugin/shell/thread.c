/* See thread.h. */

#ifndef _WIN32
#define _POSIX_C_SOURCE 200809L /* nanosleep, which the C standard has not */
#endif

#include "thread.h"

#include <stdlib.h>

enum { PAUSE_MS = 10 };

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>

typedef HANDLE handle;
#define RUNS DWORD WINAPI
#else
#include <pthread.h>
#include <time.h>

typedef pthread_t handle;
#define RUNS void *
#endif

typedef struct { void (*run)(void *); void *with; handle of; } thread;

static RUNS runs(void *with) {
  thread *own = with;
  own->run(own->with);
  return 0;
}

#ifdef _WIN32
static bool started(thread *own) { return (own->of = CreateThread(NULL, 0, runs, own, 0, NULL)); }

static void wait_for(thread *own) {
  WaitForSingleObject(own->of, INFINITE);
  CloseHandle(own->of);
}

void thread_pause(void) { Sleep(PAUSE_MS); }
#else
static bool started(thread *own) { return !pthread_create(&own->of, NULL, runs, own); }

static void wait_for(thread *own) { pthread_join(own->of, NULL); }

void thread_pause(void) { nanosleep(&(struct timespec){0, PAUSE_MS * 1000000}, NULL); }
#endif

void *thread_begin(void (*run)(void *), void *with) {
  thread *own = calloc(1, sizeof *own);
  if (!own) return NULL;
  own->run = run, own->with = with;
  if (started(own)) return own;
  free(own);
  return NULL;
}

void thread_end(void *which) {
  if (which) wait_for(which);
  free(which);
}
