/* See effects.h. Only effects_begin and the thread allocate. */

#include "effects.h"

#include <stdlib.h>
#include <string.h>

#include "layout.h"
#include "thread.h"

extern const int32_t *const noise; /* of rooms (frames, 2) */

static int64_t number_of(const void *pointer) { return (int64_t)(intptr_t)pointer; }

static double wanted(const instrument *own, int32_t which) {
  const slot *gains = own->player + PLAYER_SOURCE_GAINS;
  bool mixes = which == EFFECT_BODY_MIX || which == EFFECT_ROOM_MIX;
  if (mixes && gains[0].real != 0 && gains[1].real != 0) return 0; /* a difference is heard as it is */
  double value = own->effects.values[which];
  double wheel = own->of->wheel_effect == which ? (double)own->player[PLAYER_WHEEL].whole / 127 : 0;
  return value + wheel * (own->of->wheel_goal - value);
}

/* Responses */

static int64_t body_of(const instrument *own) { return number_of((const slot *)own->of + own->of->body); }

/* The memory that they need. */
static void measure(const instrument *own, double size, double t60_s, slot *needs) {
  void *error = NULL, *result = NULL;
  own->kernels->measure(&result, &error, body_of(own), own->rate_hz, size, t60_s, number_of(needs));
}

/* NULL where there is no memory. */
static prepared *prepare(const instrument *own, double size, double t60_s) {
  slot needs[NEEDS_SLOTS];
  measure(own, size, t60_s, needs);
  if (needs[NEEDS_PART].whole > own->effects.most_slots) return NULL;
  prepared *made = calloc(1, sizeof *made + (size_t)needs[NEEDS_FOUND].whole * sizeof(slot));
  slot *memory = malloc((size_t)needs[NEEDS_MEMORY].whole * sizeof(slot));
  if (made && memory) {
    void *error = NULL, *result = NULL;
    made->hz = own->rate_hz, made->size = size, made->t60_s = t60_s;
    own->kernels->prepare(&result, &error, body_of(own), number_of(noise), own->rate_hz, size, t60_s, number_of(made->found), number_of(memory));
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

static slot *idle(instrument *own) {
  return own->effects.mixes[own->mixer[MIXER_EFFECTS_NOW].whole == number_of(own->effects.mixes[0])];
}

static void begin_mix(instrument *own) {
  effects *e = &own->effects;
  double body = wanted(own, EFFECT_BODY_MIX), room = wanted(own, EFFECT_ROOM_MIX);
  e->mixing[0] = body, e->mixing[1] = room;
  if (body == 0 && room == 0) { /* nothing is changed */
    own->mixer[MIXER_EFFECTS].whole = 0;
    return;
  }
  void *error = NULL, *result = NULL;
  own->kernels->weigh(&result, &error, number_of(e->heard->found), body, room, number_of(e->weights));
  e->mixing_to = idle(own);
  e->mixing_at = 0;
}

/* Mixes more of it; what is ready is handed to the convolver, which fades to it. */
static void mix_on(instrument *own, int64_t most) {
  effects *e = &own->effects;
  void *error = NULL, *result = NULL;
  own->kernels->mix(&result, &error, number_of(e->heard->found), number_of(e->weights), number_of(e->mixing_to), e->mixing_at, most);
  e->mixing_at += most;
  if (e->mixing_at < e->heard->found[RESPONSES_PART].whole) return;
  e->mixing_at = -1;
  own->mixer[MIXER_EFFECTS].whole = number_of(e->mixing_to);
}

enum { MIXED_A_QUANTUM = 16384 }; /* slots: some ten microseconds */
_Static_assert(IMPULSE_SLOTS + 4 * EARLY * (QUANTUM + 1) < MIXED_A_QUANTUM, "the first quantum hears no more");

static void take_curves(instrument *own) {
  int64_t body = own->table[TABLE_BODY].whole;
  if (body) memcpy(own->table + body, own->effects.heard->found + RESPONSES_CURVES, BODY_SLOTS * sizeof(slot));
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
  while (e->offline && e->thread && !e->made && e->answered != e->asked) thread_pause();
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
  const slot *mixer = own->mixer;
  if (mixer[MIXER_EFFECTS_NEXT].whole || mixer[MIXER_EFFECTS].whole != mixer[MIXER_EFFECTS_NOW].whole) return false; /* it still fades */
  bool other = adopt(own);
  if (other || wanted(own, EFFECT_BODY_MIX) != e->mixing[0] || wanted(own, EFFECT_ROOM_MIX) != e->mixing[1]) begin_mix(own);
  if (other) wait_offline(e);
  return other;
}

bool effects_wait(const instrument *own) {
  const effects *e = &own->effects;
  return e->thread && (e->made || e->answered != e->asked);
}

/* Begin and end */

double effects_tail_s(const instrument *own) {
  slot needs[NEEDS_SLOTS];
  measure(own, own->effects.values[EFFECT_BODY_SIZE], own->effects.values[EFFECT_ROOM_T60_S], needs);
  return (double)needs[NEEDS_FRAMES].whole / own->rate_hz;
}

bool effects_begin(instrument *own) {
  effects *e = &own->effects;
  double size = wanted(own, EFFECT_BODY_SIZE), t60_s = wanted(own, EFFECT_ROOM_T60_S);
  slot most[NEEDS_SLOTS];
  measure(own, BODY_SIZE_HIGHEST, ROOM_T60_HIGHEST_S, most);
  e->mixing_at = -1;
  e->size = size, e->t60_s = t60_s;
  e->most_frames = most[NEEDS_FRAMES].whole, e->most_slots = most[NEEDS_PART].whole;
  e->convolver = calloc((size_t)most[NEEDS_CONVOLVER].whole, sizeof(slot)); /* touched as far as it is used */
  for (int32_t each = 0; each < 2; each++) e->mixes[each] = calloc((size_t)e->most_slots, sizeof(slot));
  if (!e->convolver || !e->mixes[0] || !e->mixes[1]) return false;
  if (!e->heard || e->heard->hz != own->rate_hz || e->heard->size != size || e->heard->t60_s != t60_s) {
    effects_free(own);
    if (!(e->heard = prepare(own, size, t60_s))) return false;
  }
  take_curves(own);
  e->ends = false;
  e->thread = thread_begin(work, own); /* without it, size and time stay as they are */
  return true;
}

slot *effects_mixed(const instrument *own) {
  bool done = own->effects.mixing_at < 0;
  return done ? (slot *)(intptr_t)own->mixer[MIXER_EFFECTS].whole : NULL;
}

void effects_reset(instrument *own, slot *mixed) {
  effects *e = &own->effects;
  void *error = NULL, *result = NULL;
  memset(e->convolver, 0, CONVOLVER_SLOTS * sizeof(slot));
  own->kernels->begin_convolver(&result, &error, number_of(e->convolver), own->rate_hz, e->most_frames);
  own->mixer[MIXER_CONVOLVER].whole = number_of(e->convolver);
  own->mixer[MIXER_EFFECTS].whole = number_of(mixed);
  e->mixing_at = -1;
  bool same = mixed && wanted(own, EFFECT_BODY_MIX) == e->mixing[0] && wanted(own, EFFECT_ROOM_MIX) == e->mixing[1];
  if (adopt(own) || !same) {
    begin_mix(own);
    if (e->mixing_at < 0) return;
    mix_on(own, MIXED_A_QUANTUM);
    own->mixer[MIXER_EFFECTS].whole = number_of(e->mixing_to); /* what is heard later is mixed before */
  }
}

void effects_end(instrument *own) {
  effects *e = &own->effects;
  e->ends = true;
  thread_end(e->thread);
  e->thread = NULL;
  e->asked = e->answered = 0;
  free(atomic_exchange(&e->made, NULL));
  free(atomic_exchange(&e->spent, NULL));
  slot **all[] = {&e->convolver, &e->mixes[0], &e->mixes[1]};
  for (size_t place = 0; place < sizeof all / sizeof *all; place++) {
    free(*all[place]);
    *all[place] = NULL;
  }
}

void effects_free(instrument *own) {
  free(own->effects.heard);
  own->effects.heard = NULL;
}
