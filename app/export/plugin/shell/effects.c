/* See effects.h. Only effects_begin and the thread allocate. */

#include "effects.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "layout.h"
#include "responses.h"
#include "thread.h"

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

static int64_t late_of(int64_t frames) { return frames > EARLY * QUANTUM ? (frames - EARLY * QUANTUM + WINDOW - 1) / WINDOW : 0; }

/* Of a response in the convolver's form. */
static int64_t slots_of(int64_t frames) {
  int64_t early = frames < EARLY * QUANTUM ? (frames + QUANTUM - 1) / QUANTUM : EARLY;
  return IMPULSE_SLOTS + 2 * 2 * (early * (QUANTUM + 1) + late_of(frames) * (WINDOW + 1));
}

static void release(prepared *own) {
  if (!own) return;
  for (int32_t which = 0; which < MIX_PARTS; which++) free(own->parts[which]);
  free(own);
}

/* NULL where there is no memory. */
static prepared *prepare(const instrument *own, double size, double t60_s) {
  const image *of = own->of;
  const effects *e = &own->effects;
  responses found;
  prepared *made = calloc(1, sizeof *made);
  bool done = responses_begin(&found, of, own->rate_hz, size, t60_s) && made;
  int64_t frames = 1;
  for (int32_t which = 0; which < MIX_PARTS; which++)
    if (found.of[which].frames > frames) frames = found.of[which].frames;
  done = done && frames <= e->most_frames;
  if (done) {
    made->hz = own->rate_hz, made->size = size, made->t60_s = t60_s, made->slots = slots_of(frames);
    memcpy(made->powers, found.powers, sizeof made->powers);
  }
  double *padded = done ? calloc((size_t)(2 * frames), sizeof(double)) : NULL; /* all of one length: all are laid out alike */
  done = done && padded;
  for (int32_t which = 0; done && which < MIX_PARTS; which++) {
    const sound *each = &found.of[which];
    if (!each->frames) continue;
    made->parts[which] = calloc((size_t)made->slots, sizeof(slot));
    done = made->parts[which];
    if (!done) break;
    memcpy(padded, each->samples, (size_t)each->frames * sizeof(pair));
    memset(padded + 2 * each->frames, 0, (size_t)(2 * (frames - each->frames)) * sizeof(double));
    void *error = NULL, *result = NULL;
    own->kernels->partition(&result, &error, number_of(padded), frames, 2, number_of(made->parts[which]), number_of(e->workshop));
  }
  free(padded);
  responses_end(&found);
  const slot *table = (const slot *)of + of->table;
  int64_t body = table[TABLE_BODY].whole;
  if (done && body) {
    if (size == of->body_size) memcpy(made->curves, table + body, sizeof made->curves);
    else done = responses_curves(of, size, made->curves);
  }
  if (done) return made;
  release(made);
  return NULL;
}

static void work(void *with) {
  instrument *own = with;
  effects *e = &own->effects;
  while (!e->ends) {
    release(atomic_exchange(&e->spent, NULL));
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
  double body = wanted(own, EFFECT_BODY_MIX), room = wanted(own, EFFECT_ROOM_MIX), power = 0;
  e->mixing[0] = body, e->mixing[1] = room;
  if (body == 0 && room == 0) { /* nothing is changed */
    own->mixer[MIXER_EFFECTS].whole = 0;
    return;
  }
  double weights[] = {(1 - body) * (1 - room), body * (1 - room), (1 - body) * room, body * room};
  const double *powers = e->heard->powers[(body > 0 ? POWER_BODY : 0) + (room > 0 ? POWER_ROOM : 0)];
  for (int32_t each = 0; each < 16; each++) power += weights[each / 4] * weights[each % 4] * powers[each];
  for (int32_t each = 0; each < 1 + MIX_PARTS; each++) e->weights[each] = weights[each] / fmax(sqrt(power), 1e-30);
  e->mixing_to = idle(own);
  for (int32_t which = 0; which < MIX_PARTS; which++)
    if (e->heard->parts[which]) memcpy(e->mixing_to, e->heard->parts[which], IMPULSE_SLOTS * sizeof(slot));
  e->mixing_at = IMPULSE_SLOTS;
}

/* Mixes more of it; what is ready is handed to the convolver, which fades to it. */
static void mix_on(instrument *own, int64_t most) {
  effects *e = &own->effects;
  slot *to = e->mixing_to;
  int64_t first = e->mixing_at, end = first + most < e->heard->slots ? first + most : e->heard->slots;
  for (int64_t place = first; place < end; place++) to[place].real = 0;
  for (int32_t which = 0; which < MIX_PARTS; which++)
    for (int64_t place = first; e->heard->parts[which] && place < end; place++)
      to[place].real += e->weights[1 + which] * e->heard->parts[which][place].real;
  for (int32_t channel = 0; channel < 2; channel++) { /* a single sample at the beginning: the same at all frequencies */
    int64_t begin = IMPULSE_SLOTS + channel * 2 * (QUANTUM + 1), until = begin + QUANTUM + 1;
    for (int64_t place = begin > first ? begin : first; place < until && place < end; place++)
      to[place].real += e->weights[0] / (2 * QUANTUM);
  }
  e->mixing_at = end < e->heard->slots ? end : -1;
  if (e->mixing_at < 0) own->mixer[MIXER_EFFECTS].whole = number_of(to);
}

enum { MIXED_A_QUANTUM = 16384 }; /* slots: some ten microseconds */
_Static_assert(IMPULSE_SLOTS + 4 * EARLY * (QUANTUM + 1) < MIXED_A_QUANTUM, "the first quantum hears no more");

/* Takes up what the thread has made. */
static bool adopt(instrument *own) {
  effects *e = &own->effects;
  if (!e->made || e->spent) return false;
  prepared *before = e->heard;
  e->heard = e->made;
  e->made = NULL;
  e->spent = before;
  int64_t body = own->table[TABLE_BODY].whole;
  if (body) memcpy(own->table + body, e->heard->curves, sizeof e->heard->curves);
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

static double body_s(const image *of, double size) {
  double heard_s = of->impulse_frames ? fmin((double)of->impulse_frames / of->impulse_hz * size, LONGEST_IMPULSE_S) : 0;
  return of->body_s * size + heard_s;
}

double effects_tail_s(const instrument *own) {
  return body_s(own->of, own->effects.values[EFFECT_BODY_SIZE]) + own->effects.values[EFFECT_ROOM_T60_S];
}

bool effects_begin(instrument *own) {
  effects *e = &own->effects;
  double size = wanted(own, EFFECT_BODY_SIZE), t60_s = wanted(own, EFFECT_ROOM_T60_S);
  double longest_s = body_s(own->of, BODY_SIZE_HIGHEST) + ROOM_T60_HIGHEST_S;
  e->mixing_at = -1;
  e->size = size, e->t60_s = t60_s;
  e->most_frames = (int64_t)(longest_s * own->rate_hz) + WINDOW;
  e->workshop = calloc(CONVOLVER_SLOTS, sizeof(slot));
  int64_t late = late_of(e->most_frames) + 1;
  e->convolver = calloc((size_t)(CONVOLVER_SLOTS + late * 4 * (WINDOW + 1)), sizeof(slot)); /* touched as far as it is used */
  if (!e->workshop || !e->convolver) return false;
  for (int64_t k = 0; k < 2 * WINDOW; k++) {
    double turn = 2 * 3.14159265358979323846 * (double)k / (2 * WINDOW);
    e->convolver[CONVOLVER_COSINES + k].real = e->workshop[CONVOLVER_COSINES + k].real = cos(turn);
    e->convolver[CONVOLVER_SINES + k].real = e->workshop[CONVOLVER_SINES + k].real = sin(turn);
  }
  e->convolver[CONVOLVER_CAPACITY].whole = late;
  if (!e->heard || e->heard->hz != own->rate_hz || e->heard->size != size || e->heard->t60_s != t60_s) {
    effects_free(own);
    if (!(e->heard = prepare(own, size, t60_s))) return false;
  }
  for (int32_t each = 0; each < 2; each++)
    if (!(e->mixes[each] = calloc((size_t)slots_of(e->most_frames), sizeof(slot)))) return false;
  int64_t body = own->table[TABLE_BODY].whole;
  if (body) memcpy(own->table + body, e->heard->curves, sizeof e->heard->curves);
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
  slot *convolver = e->convolver, capacity = convolver[CONVOLVER_CAPACITY];
  memset(convolver, 0, CONVOLVER_COSINES * sizeof(slot));
  memset(convolver + CONVOLVER_SINES + 2 * WINDOW, 0, (CONVOLVER_SLOTS - CONVOLVER_SINES - 2 * WINDOW) * sizeof(slot));
  convolver[CONVOLVER_CAPACITY] = capacity;
  convolver[CONVOLVER_FADE_WINDOWS].whole = (int64_t)ceil(CONVOLVER_FADE_S * own->rate_hz / WINDOW);
  convolver[CONVOLVER_STEP].whole = -1;
  own->mixer[MIXER_CONVOLVER].whole = number_of(convolver);
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
  release(atomic_exchange(&e->made, NULL));
  release(atomic_exchange(&e->spent, NULL));
  slot **all[] = {&e->workshop, &e->convolver, &e->mixes[0], &e->mixes[1]};
  for (size_t place = 0; place < sizeof all / sizeof *all; place++) {
    free(*all[place]);
    *all[place] = NULL;
  }
}

void effects_free(instrument *own) {
  release(own->effects.heard);
  own->effects.heard = NULL;
}
