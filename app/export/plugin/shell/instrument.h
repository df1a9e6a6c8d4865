/* An instrument as the plug-in holds it: its image, its memory, its parameters, and events that come to it.

   What a format's shell adds is its interface alone. */

#ifndef LS_INSTRUMENT_H
#define LS_INSTRUMENT_H

#include <stdatomic.h>

#include "abi.h"
#include "effects.h"

enum { MOST_CHANGES = 512, STATE_BYTES = 8 + 12 * MOST_PARAMETERS, MOST_STATE_BYTES = 8 + 12 * 4096 };

extern const image *const images[];
extern const int32_t image_count;

typedef struct { int64_t frame; int32_t parameter; double value; } change;

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
