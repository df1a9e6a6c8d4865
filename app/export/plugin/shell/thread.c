/* See thread.h. */

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#else
#define _POSIX_C_SOURCE 200809L /* nanosleep, which the C standard has not */
#include <pthread.h>
#include <time.h>
#endif

#include "thread.h"

enum { PAUSE_MS = 10 };

#ifdef _WIN32
static DWORD WINAPI runs(void *with) {
  ((thread *)with)->run(((thread *)with)->with);
  return 0;
}

static uintptr_t started(thread *own) { return (uintptr_t)CreateThread(NULL, 0, runs, own, 0, NULL); }

static void wait_for(uintptr_t handle) {
  WaitForSingleObject((HANDLE)handle, INFINITE);
  CloseHandle((HANDLE)handle);
}

void thread_pause(void) { Sleep(PAUSE_MS); }
#else
static void *runs(void *with) {
  ((thread *)with)->run(((thread *)with)->with);
  return NULL;
}

static uintptr_t started(thread *own) {
  pthread_t handle;
  return pthread_create(&handle, NULL, runs, own) ? 0 : (uintptr_t)handle;
}

static void wait_for(uintptr_t handle) { pthread_join((pthread_t)handle, NULL); }

void thread_pause(void) { nanosleep(&(struct timespec){0, PAUSE_MS * 1000000}, NULL); }
#endif

void thread_begin(thread *own, void (*run)(void *), void *with) {
  own->run = run, own->with = with;
  own->handle = started(own);
}

void thread_end(thread *own) {
  if (own->handle) wait_for(own->handle);
  own->handle = 0;
}
