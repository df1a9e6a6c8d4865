/* Body and room as the convolver hears them, at their mixes, size and time.

   Mixes are followed by the audio thread, a part a quantum. Another size or time needs another response, which a thread
   computes beside the sound; while a host renders offline, the sound waits for it, so that it is the same each time.
   Only effects_begin and the thread allocate. */

#include "instrument.h"

#include <stdlib.h>
#include <string.h>

extern const int32_t *const noise; /* of rooms (frames, 2) */

static double wanted(const instrument *own, int32_t which) {
  const double *gains = own->player->source_gains;
  bool mixes = which == EFFECT_BODY_MIX || which == EFFECT_ROOM_MIX;
  if (mixes && gains[0] != 0 && gains[1] != 0) return 0; /* a difference is heard as it is */
  double value = own->effects.values[which];
  double wheel = own->of->wheel_effect == which ? (double)own->player->wheel / 127 : 0;
  return value + wheel * (own->of->wheel_goal - value);
}

/* Responses */

static int64_t body_of(const instrument *own) { return address_of((const double *)own->of + own->of->body); }

/* The memory that they need. */
static needs measure(const instrument *own, double size, double t60_s) {
  needs found = {0};
  CALL(own, measure, body_of(own), own->rate_hz, size, t60_s, address_of(&found));
  return found;
}

/* NULL where there is no memory. */
static prepared *prepare(const instrument *own, double size, double t60_s) {
  needs needed = measure(own, size, t60_s);
  if (needed.part > own->effects.most_slots) return NULL;
  prepared *made = calloc(1, offsetof(prepared, found) + (size_t)needed.found * sizeof(double));
  double *memory = malloc((size_t)needed.memory * sizeof(double));
  if (made && memory) {
    made->hz = own->rate_hz, made->size = size, made->t60_s = t60_s;
    CALL(own, prepare, body_of(own), address_of(noise), own->rate_hz, size, t60_s, address_of(&made->found), address_of(memory));
  } else {
    free(made);
    made = NULL;
  }
  free(memory);
  return made;
}

static void work(void *with) {
  instrument *own = with;
  effects *e = &own->effects;
  while (!e->ends) {
    free(atomic_exchange(&e->spent, NULL));
    unsigned number = e->asked;
    if (e->made || number == e->answered) {
      thread_pause();
      continue;
    }
    prepared *found = prepare(own, e->size, e->t60_s);
    if (found) e->made = found;
    e->answered = number;
  }
}

/* The mix: one response of four, nothing, the body, the room, and both in series */

static void begin_mix(instrument *own) {
  effects *e = &own->effects;
  double body = wanted(own, EFFECT_BODY_MIX), room = wanted(own, EFFECT_ROOM_MIX);
  e->mixing[0] = body, e->mixing[1] = room;
  if (body == 0 && room == 0) { /* nothing is changed */
    own->mixer->effects = 0;
    return;
  }
  CALL(own, weigh, address_of(&e->heard->found), body, room, address_of(e->weights));
  e->mixing_to = e->mixes[own->mixer->effects_now == address_of(e->mixes[0])]; /* the one that is not heard */
  e->mixing_at = 0;
}

/* Mixes more of it; what is ready is handed to the convolver, which fades to it. */
static void mix_on(instrument *own, int64_t most) {
  effects *e = &own->effects;
  CALL(own, mix, address_of(&e->heard->found), address_of(e->weights), address_of(e->mixing_to), e->mixing_at, most);
  e->mixing_at += most;
  if (e->mixing_at < e->heard->found.part) return;
  e->mixing_at = -1;
  own->mixer->effects = address_of(e->mixing_to);
}

enum { MIXED_A_QUANTUM = 16384 }; /* slots: some ten microseconds */
_Static_assert(sizeof(impulse) / sizeof(double) + 4 * EARLY * (QUANTUM + 1) < MIXED_A_QUANTUM, "the first quantum hears no more");

static void take_curves(instrument *own) {
  const double *curves = own->effects.heard->found.curves;
  if (own->table->body) memcpy((double *)own->table + own->table->body, curves, BODY_SLOTS * sizeof(double));
}

/* Takes up what the thread has made. */
static bool adopt(instrument *own) {
  effects *e = &own->effects;
  if (!e->made || e->spent) return false;
  prepared *before = e->heard;
  e->heard = e->made;
  e->made = NULL;
  e->spent = before;
  take_curves(own);
  return true;
}

static void wait_offline(effects *e) {
  while (e->offline && e->thread.handle && !e->made && e->answered != e->asked) thread_pause();
}

bool effects_follow(instrument *own) {
  effects *e = &own->effects;
  if (!e->convolver) return false;
  double size = wanted(own, EFFECT_BODY_SIZE), t60_s = wanted(own, EFFECT_ROOM_T60_S);
  if (size != e->size || t60_s != e->t60_s) {
    e->size = size, e->t60_s = t60_s;
    e->asked++;
  }
  wait_offline(e);
  if (e->mixing_at >= 0) {
    mix_on(own, MIXED_A_QUANTUM);
    return false;
  }
  const mixer_memory *mixer = own->mixer;
  if (mixer->effects_next || mixer->effects != mixer->effects_now) return false; /* it still fades */
  bool other = adopt(own);
  if (other || wanted(own, EFFECT_BODY_MIX) != e->mixing[0] || wanted(own, EFFECT_ROOM_MIX) != e->mixing[1]) begin_mix(own);
  if (other) wait_offline(e);
  return other;
}

bool effects_wait(const instrument *own) {
  const effects *e = &own->effects;
  return e->thread.handle && (e->made || e->answered != e->asked);
}

/* Begin and end */

double effects_tail_s(const instrument *own) {
  const double *values = own->effects.values;
  return (double)measure(own, values[EFFECT_BODY_SIZE], values[EFFECT_ROOM_T60_S]).frames / own->rate_hz;
}

bool effects_begin(instrument *own) {
  effects *e = &own->effects;
  double size = wanted(own, EFFECT_BODY_SIZE), t60_s = wanted(own, EFFECT_ROOM_T60_S);
  needs most = measure(own, BODY_SIZE_HIGHEST, ROOM_T60_HIGHEST_S);
  e->mixing_at = -1;
  e->size = size, e->t60_s = t60_s;
  e->most_frames = most.frames, e->most_slots = most.part;
  e->convolver = calloc((size_t)most.convolver, sizeof(double)); /* touched as far as it is used */
  for (int32_t each = 0; each < 2; each++) e->mixes[each] = calloc((size_t)e->most_slots, sizeof(double));
  if (!e->convolver || !e->mixes[0] || !e->mixes[1]) return false;
  if (!e->heard || e->heard->hz != own->rate_hz || e->heard->size != size || e->heard->t60_s != t60_s) {
    effects_free(own);
    if (!(e->heard = prepare(own, size, t60_s))) return false;
  }
  take_curves(own);
  e->ends = false;
  thread_begin(&e->thread, work, own); /* without it, size and time stay as they are */
  return true;
}

double *effects_mixed(const instrument *own) {
  return own->effects.mixing_at < 0 ? (double *)(intptr_t)own->mixer->effects : NULL;
}

void effects_reset(instrument *own, double *mixed) {
  effects *e = &own->effects;
  memset(e->convolver, 0, sizeof *e->convolver);
  CALL(own, begin_convolver, address_of(e->convolver), own->rate_hz, e->most_frames);
  own->mixer->convolver = address_of(e->convolver);
  own->mixer->effects = address_of(mixed);
  e->mixing_at = -1;
  bool same = mixed && wanted(own, EFFECT_BODY_MIX) == e->mixing[0] && wanted(own, EFFECT_ROOM_MIX) == e->mixing[1];
  if (adopt(own) || !same) {
    begin_mix(own);
    if (e->mixing_at < 0) return;
    mix_on(own, MIXED_A_QUANTUM);
    own->mixer->effects = address_of(e->mixing_to); /* what is heard later is mixed before */
  }
}

void effects_end(instrument *own) {
  effects *e = &own->effects;
  e->ends = true;
  thread_end(&e->thread);
  e->asked = e->answered = 0;
  free(atomic_exchange(&e->made, NULL));
  free(atomic_exchange(&e->spent, NULL));
  free(e->convolver);
  free(e->mixes[0]);
  free(e->mixes[1]);
  e->convolver = NULL, e->mixes[0] = e->mixes[1] = NULL;
}

void effects_free(instrument *own) {
  free(own->effects.heard);
  own->effects.heard = NULL;
}
