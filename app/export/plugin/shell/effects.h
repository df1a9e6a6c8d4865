/* Body and room as they are heard: see effects.c. */

#ifndef LS_EFFECTS_H
#define LS_EFFECTS_H

#include <stdatomic.h>
#include <stdbool.h>

#include "kernels.h"
#include "thread.h"

typedef struct { double hz, size, t60_s; responses found; } prepared; /* of a body and a room; more memory follows */

typedef struct {
  const kernels *kernels;
  const image *of;
  double rate_hz;
  mixer_memory *mixer;            /* which they are heard in */
  const player_memory *player;    /* whose wheel turns them */
  table_memory *table;            /* which has the curves of the body */
  double values[EFFECT_COUNT];    /* the latest */
  convolver_memory *convolver;
  prepared *heard;                /* what is mixed from; it is kept from rate to rate */
  double *mixes[2], *mixing_to;   /* what is heard, and the next; the one that is mixed */
  int64_t most_frames, most_slots, mixing_at; /* of a response; the next slot that is mixed, -1: none is */
  double mixing[2], weights[4];   /* of the latest mix */
  thread thread;                  /* it computes a response of `size` and `t60_s` whenever another one is asked for */
  _Atomic double size, t60_s;
  atomic_uint asked, answered;
  _Atomic(prepared *) made, spent; /* to the audio thread, and back */
  atomic_bool ends, offline;       /* offline: the sound waits for the thread */
} effects;

/* At a rate and the values that are set, with memory of the instrument that stays until effects_end; allocates. False where there is none. */
bool effects_begin(effects *, const image *, double rate_hz, mixer_memory *, const player_memory *, table_memory *);
double *effects_mixed(const effects *); /* the latest mix; NULL: none, or it is not complete */
void effects_reset(effects *, double *mixed); /* to a mixer at rest: nothing rings; the mix is kept where it is the wanted one */
bool effects_follow(effects *); /* once a quantum; whether keys have other levels now */
bool effects_wait(const effects *); /* whether a response is still to come */
double effects_tail_s(const effects *);
void effects_end(effects *);
void effects_free(effects *); /* and what is kept from rate to rate */

#endif
