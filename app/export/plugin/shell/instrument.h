/* An instrument as the plug-in holds it: its image, its memory, its parameters, and events that come to it.

   The image is written by image.py, which also writes layout.h: where things lie in the kernels' memory. */

#ifndef LS_INSTRUMENT_H
#define LS_INSTRUMENT_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "kernels.h"
#include "layout.h"

typedef union { double real; int64_t whole; } slot;

enum { KIND_SOURCE, KIND_VOLUME, KIND_VALUE, KIND_MACRO, KIND_EFFECT, KIND_AMP };
enum { EFFECT_BODY_MIX, EFFECT_ROOM_MIX, EFFECT_BODY_SIZE, EFFECT_ROOM_T60_S, EFFECTS };
enum { AMP_DRIVE_DB, AMP_TONE_DB };
enum { SOURCE_MODEL, SOURCE_TRUTH, SOURCE_DIFFERENCE };
enum { MOST_PARAMETERS = 64, MOST_MACRO_TARGETS = 8, MOST_CHANGES = 512, MOST_STATE_BYTES = 8 + 12 * 4096 };

typedef struct {
  uint32_t id;
  int32_t kind, index, steps; /* steps: of whole numbers, each with its word, with spaces between; 0: it is real */
  double low, high, standard;
  double curve; /* how many times as fast a knob moves it at the end as at the start; 1: evenly */
  char name[64], module[64], unit[16], words[64];
} parameter;

typedef struct { int32_t count, spare; struct { int32_t parameter, spare; double low, high; } targets[MOST_MACRO_TARGETS]; } macro;
typedef struct {
  char magic[8];
  int64_t version, bytes;
  int64_t table, table_slots, model, model_slots, truth, truth_slots; /* in slots from the beginning */
  int64_t parameters, parameter_count, macros, macro_count;           /* in bytes */
  int64_t taps;
  int64_t body;
  int64_t kit, kit_slots, kit_room, table_room; /* drums, and slots behind kit and table in which they are computed; 0: strings */
  int64_t wheel_effect;        /* which of EFFECTS the modulation wheel moves, -1: none */
  int64_t modes, most_notes;
  double longest_s, wheel_goal, level_db;
  char id[128], name[64], description[512], maker[64], features[128], category[16];
  uint8_t uid[16]; /* of VST3 */
} image;

typedef struct { int64_t frame; int32_t parameter; double value; } change;

typedef struct { double hz, size, t60_s; slot found[]; } prepared; /* RESPONSES of a body and a room */

typedef struct {
  double values[EFFECTS];         /* the latest */
  slot *convolver;
  prepared *heard;                /* what is mixed from; it is kept from rate to rate */
  slot *mixes[2], *mixing_to;     /* what is heard, and the next; the one that is mixed */
  int64_t most_frames, most_slots, mixing_at; /* of a response; the next slot that is mixed, -1: none is */
  double mixing[2], weights[4]; /* of the latest mix */
  void *thread;                   /* it computes a response of `size` and `t60_s` whenever another one is asked for */
  _Atomic double size, t60_s;
  atomic_uint asked, answered;
  _Atomic(prepared *) made, spent; /* to the audio thread, and back */
  atomic_bool ends, offline;       /* offline: the sound waits for the thread */
} effects;

typedef struct {
  const image *of;
  const kernels *kernels;
  double rate_hz;
  slot *mixer, *player, *table, *model, *truth, *scratch, *kit; /* kit: of drums, else NULL */
  effects effects;
  double amp[2];      /* drive and tone in dB; no drive: there is no amplifier */
  double values[MOST_PARAMETERS], followed[MOST_PARAMETERS]; /* followed: by the kit */
  change changes[MOST_CHANGES];
  int32_t waiting;
  int64_t read;       /* reports */
  int64_t lost;       /* events for which there was no room */
  bool moved;         /* a macro has moved other parameters since the host read them */
} instrument;

typedef void (*note_ended)(void *context, int64_t id, int32_t channel, int32_t key, uint32_t offset);

const parameter *parameters_of(const image *);
int32_t parameter_with_id(const image *, uint32_t id);
void instrument_reset_values(instrument *);
bool instrument_begin(instrument *, double rate_hz);   /* allocates; false where there is no memory, or no such rate */
bool rate_is_possible(double rate_hz);
void instrument_end(instrument *);
void instrument_free(instrument *); /* and what is kept from rate to rate */
uint32_t instrument_latency(void);
uint32_t instrument_tail(const instrument *);

/* Frames are those of the block that is rendered next: 0 its first. */
void instrument_note_on(instrument *, uint32_t at, int64_t id, int32_t channel, int32_t key, double velocity);
void instrument_note_off(instrument *, uint32_t at, int32_t channel, int32_t key);
void instrument_bend(instrument *, uint32_t at, int32_t channel, double value);
void instrument_controller(instrument *, uint32_t at, int32_t channel, int32_t number, int32_t value);
void instrument_midi(instrument *, uint32_t at, const uint8_t *bytes);
void instrument_tune(instrument *, uint32_t at, int64_t id, int32_t channel, int32_t key, double semitones);
void instrument_choke(instrument *, uint32_t at, int64_t id, int32_t channel, int32_t key);
void instrument_change(instrument *, uint32_t at, int32_t parameter, double value);
void instrument_follow(instrument *, int32_t parameter);            /* its value counts from the next frame on */
void instrument_set(instrument *, int32_t parameter, double value); /* while nothing is rendered */
void instrument_reset(instrument *); /* as instrument_begin leaves it, with the values of now; it allocates nothing */
void instrument_render(instrument *, uint32_t frames, float *left, float *right);
void instrument_report_ends(instrument *, note_ended, void *context);
bool instrument_silent(const instrument *);

/* State: a version, a count, then ids and a value for each. What is damaged or holds no finite numbers changes nothing.
   Parameters that a state leaves out keep their value in `values`; unknown ones are ignored. */
int32_t state_write(const image *, const double *values, uint8_t *bytes, int32_t room); /* its size; -1: no room */
bool state_read(const image *, const uint8_t *bytes, int64_t size, double *values);
bool instrument_load(instrument *, const uint8_t *bytes, int64_t size); /* what is left out has its default */

#endif
