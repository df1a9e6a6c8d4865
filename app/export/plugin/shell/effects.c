/* Body and room as the convolver hears them, at their mixes, size and time.

   Mixes are followed by the audio thread, a part a quantum. Another size or time needs another response, which a thread
   computes beside the sound; while a host renders offline, the sound waits for it, so that it is the same each time.
   Only effects_begin and the thread allocate. */

#include "effects.h"

#include <stdlib.h>
#include <string.h>

extern const int32_t *const noise; /* of rooms (frames, 2) */

static double wanted(const effects *e, int32_t which) {
  const double *gains = e->player->source_gains;
  bool mixes = which == EFFECT_BODY_MIX || which == EFFECT_ROOM_MIX;
  if (mixes && gains[0] != 0 && gains[1] != 0) return 0; /* a difference is heard as it is */
  double value = e->values[which];
  double wheel = e->of->wheel_effect == which ? (double)e->player->wheel / 127 : 0;
  return value + wheel * (e->of->wheel_goal - value);
}

/* Responses */

static int64_t body_of(const effects *e) { return address_of((const double *)e->of + e->of->body); }

/* The memory that they need. */
static needs measure(const effects *e, double size, double t60_s) {
  needs found = {0};
  CALL(e, measure, body_of(e), e->rate_hz, size, t60_s, address_of(&found));
  return found;
}

/* NULL where there is no memory. */
static prepared *prepare(const effects *e, double size, double t60_s) {
  needs needed = measure(e, size, t60_s);
  if (needed.part > e->most_slots) return NULL;
  prepared *made = calloc(1, offsetof(prepared, found) + (size_t)needed.found * sizeof(double));
  double *memory = malloc((size_t)needed.memory * sizeof(double));
  if (made && memory) {
    made->hz = e->rate_hz, made->size = size, made->t60_s = t60_s;
    CALL(e, prepare, body_of(e), address_of(noise), e->rate_hz, size, t60_s, address_of(&made->found), address_of(memory));
  } else {
    free(made);
    made = NULL;
  }
  free(memory);
  return made;
}

static void work(void *with) {
  effects *e = with;
  while (!e->ends) {
    free(atomic_exchange(&e->spent, NULL));
    unsigned number = e->asked;
    if (e->made || number == e->answered) {
      thread_pause();
      continue;
    }
    prepared *found = prepare(e, e->size, e->t60_s);
    if (found) e->made = found;
    e->answered = number;
  }
}

/* The mix: one response of four, nothing, the body, the room, and both in series */

static void begin_mix(effects *e) {
  double body = wanted(e, EFFECT_BODY_MIX), room = wanted(e, EFFECT_ROOM_MIX);
  e->mixing[0] = body, e->mixing[1] = room;
  if (body == 0 && room == 0) { /* nothing is changed */
    e->mixer->effects = 0;
    return;
  }
  CALL(e, weigh, address_of(&e->heard->found), body, room, address_of(e->weights));
  e->mixing_to = e->mixes[e->mixer->effects_now == address_of(e->mixes[0])]; /* the one that is not heard */
  e->mixing_at = 0;
}

/* Mixes more of it; what is ready is handed to the convolver, which fades to it. */
static void mix_on(effects *e, int64_t most) {
  CALL(e, mix, address_of(&e->heard->found), address_of(e->weights), address_of(e->mixing_to), e->mixing_at, most);
  e->mixing_at += most;
  if (e->mixing_at < e->heard->found.part) return;
  e->mixing_at = -1;
  e->mixer->effects = address_of(e->mixing_to);
}

enum { MIXED_A_QUANTUM = 16384 }; /* slots: some ten microseconds */
_Static_assert(sizeof(impulse) / sizeof(double) + 4 * EARLY * (QUANTUM + 1) < MIXED_A_QUANTUM, "the first quantum hears no more");

static void take_curves(effects *e) {
  const double *curves = e->heard->found.curves;
  if (e->table->body) memcpy((double *)e->table + e->table->body, curves, BODY_SLOTS * sizeof(double));
}

/* Takes up what the thread has made. */
static bool adopt(effects *e) {
  if (!e->made || e->spent) return false;
  prepared *before = e->heard;
  e->heard = e->made;
  e->made = NULL;
  e->spent = before;
  take_curves(e);
  return true;
}

static void wait_offline(effects *e) {
  while (e->offline && e->thread.handle && !e->made && e->answered != e->asked) thread_pause();
}

bool effects_follow(effects *e) {
  if (!e->convolver) return false;
  double size = wanted(e, EFFECT_BODY_SIZE), t60_s = wanted(e, EFFECT_ROOM_T60_S);
  if (size != e->size || t60_s != e->t60_s) {
    e->size = size, e->t60_s = t60_s;
    e->asked++;
  }
  wait_offline(e);
  if (e->mixing_at >= 0) {
    mix_on(e, MIXED_A_QUANTUM);
    return false;
  }
  const mixer_memory *mixer = e->mixer;
  if (mixer->effects_next || mixer->effects != mixer->effects_now) return false; /* it still fades */
  bool other = adopt(e);
  if (other || wanted(e, EFFECT_BODY_MIX) != e->mixing[0] || wanted(e, EFFECT_ROOM_MIX) != e->mixing[1]) begin_mix(e);
  if (other) wait_offline(e);
  return other;
}

bool effects_wait(const effects *e) {
  return e->thread.handle && (e->made || e->answered != e->asked);
}

/* Begin and end */

double effects_tail_s(const effects *e) {
  const double *values = e->values;
  return (double)measure(e, values[EFFECT_BODY_SIZE], values[EFFECT_ROOM_T60_S]).frames / e->rate_hz;
}

bool effects_begin(effects *e, const image *of, double rate_hz, mixer_memory *mixer, const player_memory *player, table_memory *table) {
  e->kernels = kernels_here(), e->of = of, e->rate_hz = rate_hz;
  e->mixer = mixer, e->player = player, e->table = table;
  double size = wanted(e, EFFECT_BODY_SIZE), t60_s = wanted(e, EFFECT_ROOM_T60_S);
  needs most = measure(e, BODY_SIZE_HIGHEST, ROOM_T60_HIGHEST_S);
  e->mixing_at = -1;
  e->size = size, e->t60_s = t60_s;
  e->most_frames = most.frames, e->most_slots = most.part;
  e->convolver = calloc((size_t)most.convolver, sizeof(double)); /* touched as far as it is used */
  for (int32_t each = 0; each < 2; each++) e->mixes[each] = calloc((size_t)e->most_slots, sizeof(double));
  if (!e->convolver || !e->mixes[0] || !e->mixes[1]) return false;
  if (!e->heard || e->heard->hz != e->rate_hz || e->heard->size != size || e->heard->t60_s != t60_s) {
    effects_free(e);
    if (!(e->heard = prepare(e, size, t60_s))) return false;
  }
  take_curves(e);
  e->ends = false;
  thread_begin(&e->thread, work, e); /* without it, size and time stay as they are */
  return true;
}

double *effects_mixed(const effects *e) {
  return e->mixing_at < 0 ? (double *)(intptr_t)e->mixer->effects : NULL;
}

void effects_reset(effects *e, double *mixed) {
  memset(e->convolver, 0, sizeof *e->convolver);
  CALL(e, begin_convolver, address_of(e->convolver), e->rate_hz, e->most_frames);
  e->mixer->convolver = address_of(e->convolver);
  e->mixer->effects = address_of(mixed);
  e->mixing_at = -1;
  bool same = mixed && wanted(e, EFFECT_BODY_MIX) == e->mixing[0] && wanted(e, EFFECT_ROOM_MIX) == e->mixing[1];
  if (adopt(e) || !same) {
    begin_mix(e);
    if (e->mixing_at < 0) return;
    mix_on(e, MIXED_A_QUANTUM);
    e->mixer->effects = address_of(e->mixing_to); /* what is heard later is mixed before */
  }
}

void effects_end(effects *e) {
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

void effects_free(effects *e) {
  free(e->heard);
  e->heard = NULL;
}
