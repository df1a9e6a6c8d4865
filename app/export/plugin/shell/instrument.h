/* An instrument as the plug-in holds it: its image, its memory, its parameters, and events that come to it.

   What a format's shell adds is its interface alone. layout.h is written by layout.py: records of the image and of the
   kernels' memory, whose fields Python names and explains, and the kernels' entries. */

#ifndef LS_INSTRUMENT_H
#define LS_INSTRUMENT_H

#include <stdatomic.h>

#include "abi.h"
#include "layout.h"
#include "thread.h"

enum { MOST_CHANGES = 512, STATE_BYTES = 8 + 12 * MOST_PARAMETERS, MOST_STATE_BYTES = 8 + 12 * 4096 };

extern const image *const images[];
extern const int32_t image_count;

/* The kernels for the processor that the plug-in runs on. Each returns 0, or that it failed. */
#define POINTER(_, name, ...) int32_t (*name)(void *result, void **error, __VA_ARGS__);
typedef struct { ENTRIES(POINTER, ) } kernels;
const kernels *kernels_here(void);
#define CALL(own, entry, ...) ((own)->kernels->entry(&(void *){NULL}, &(void *){NULL}, __VA_ARGS__))

static inline int64_t address_of(const void *pointer) { return (int64_t)(intptr_t)pointer; }

typedef struct { int64_t frame; int32_t parameter; double value; } change;

typedef struct { double hz, size, t60_s; responses found; } prepared; /* of a body and a room; more memory follows */

typedef struct {
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

typedef struct {
  const image *of;
  const kernels *kernels;
  double rate_hz;
  mixer_memory *mixer; /* NULL: it is not active, as the rest but `effects.heard` */
  player_memory *player;
  table_memory *table;
  tension_program *model;
  truth_program *truth;
  double *kit; /* of drums, else NULL */
  float *block;
  effects effects;
  double amp[2];      /* drive and tone in dB; no drive: there is no amplifier */
  double values[MOST_PARAMETERS], followed[MOST_PARAMETERS]; /* followed: by the kit */
  change changes[MOST_CHANGES];
  int32_t waiting;
  int64_t read;       /* reports */
  int64_t lost;       /* events for which there was no room */
  bool moved;         /* a macro has moved other parameters since the host read them */
  atomic_bool loaded; /* a state or preset that the next block takes up */
} instrument;

/* See effects.c */

bool effects_begin(instrument *); /* at its rate and its values; allocates; false where there is no memory */
double *effects_mixed(const instrument *); /* the latest mix; NULL: none, or it is not complete */
void effects_reset(instrument *, double *mixed); /* to a mixer at rest: nothing rings; the mix is kept where it is the wanted one */
bool effects_follow(instrument *); /* once a quantum; whether keys have other levels now */
bool effects_wait(const instrument *); /* whether a response is still to come */
double effects_tail_s(const instrument *);
void effects_end(instrument *);
void effects_free(instrument *); /* and what is kept from rate to rate */

/* See instrument.c */

int32_t image_with_id(const char *id); /* its number; -1: there is none */
const parameter *parameters_of(const image *);
int32_t parameter_with_id(const image *, uint32_t id); /* its place; -1: there is none */
const parameter *parameter_of(const image *, uint32_t id); /* NULL: there is none */
void parameter_text(const parameter *, double value, char *text, uint32_t room);
bool parameter_number(const parameter *, const char *text, double *value); /* false: the text has none */

void instrument_reset_values(instrument *);            /* to those of its image */
bool instrument_begin(instrument *, double rate_hz);   /* allocates; false where there is no memory, or no such rate */
bool rate_is_possible(double rate_hz);
void instrument_end(instrument *);
void instrument_free(instrument *); /* and what is kept from rate to rate */
uint32_t instrument_latency(void);
uint32_t instrument_tail(const instrument *);
void instrument_reset(instrument *); /* as instrument_begin leaves it, with the values of now; it allocates nothing */

/* Events are the kernels' own, with a frame of the block and, of a PARAMETER, its place as key.
   Of TUNE and CHOKE, id, channel and key choose the notes that are meant, as far as they are given: not 0, not below 0. */
void instrument_take(instrument *, uint32_t at, event); /* at: frame of what is rendered next */
void instrument_set(instrument *, int32_t parameter, double value); /* while nothing is rendered */
int64_t event_id(int32_t note);                         /* of a host's number of a note, below 0 where it has none */
bool event_of_midi(const uint8_t *bytes, event *);      /* false: the message means nothing here */
event event_of_brightness(int64_t channel, double value);

typedef bool (*event_source)(void *context, event *); /* the next one of a block; false: there are no more */
/* Render a block. Events beyond it, or all where it has no frames, count from what is rendered next. */
void instrument_play(instrument *, uint32_t frames, float **channels, uint32_t count, event_source, void *context);
bool instrument_ended(instrument *, report *); /* the next note with an id that has ended; false: there is none */
bool instrument_silent(const instrument *);

/* State: a version, a count, then ids and a value for each. Unknown ids are ignored, what is left out has its default. */
int32_t state_write(const image *, const double *values, uint8_t *bytes); /* STATE_BYTES at most; its size */
bool state_read(const image *, const uint8_t *bytes, int64_t size, double *values); /* false: it is damaged, or a value not finite */
bool instrument_load(instrument *, const uint8_t *bytes, int64_t size); /* false: nothing has changed */

#endif
