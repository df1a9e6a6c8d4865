/* See instrument.h. Nothing is allocated but in instrument_begin. */

#include "instrument.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

/* Of Numba's library: other strides for the same contiguous memory, rows last, as all of the kernels' is. */
int numba_attempt_nocopy_reshape(int64_t dimensions, const int64_t *sizes, const int64_t *strides, int64_t new_dimensions,
                                 const int64_t *new_sizes, int64_t *new_strides, int64_t bytes, int columns_last) {
  (void)dimensions, (void)sizes, (void)strides, (void)columns_last;
  for (int64_t place = new_dimensions - 1; place >= 0; place--) {
    new_strides[place] = bytes;
    bytes *= new_sizes[place];
  }
  return 1;
}

/* What the image holds */

int32_t image_with_id(const char *id) {
  int32_t place = image_count - 1;
  while (place >= 0 && strcmp(id, images[place]->id)) place--;
  return place;
}

const parameter *parameters_of(const image *of) { return (const parameter *)((const char *)of + of->parameters); }

static const macro *macros_of(const image *of) { return (const macro *)((const char *)of + of->macros); }

int32_t parameter_with_id(const image *of, uint32_t id) {
  for (int32_t place = 0; place < of->parameter_count; place++)
    if (parameters_of(of)[place].id == id) return place;
  return -1;
}

const parameter *parameter_of(const image *of, uint32_t id) {
  int32_t place = parameter_with_id(of, id);
  return place < 0 ? NULL : &parameters_of(of)[place];
}

/* The word of a step and its length. */
static const char *word_of(const parameter *of, int32_t step, int *length) {
  const char *word = of->words;
  for (; step > 0; step--) word += strcspn(word, " ") + 1;
  *length = (int)strcspn(word, " ");
  return word;
}

void parameter_text(const parameter *of, double value, char *text, uint32_t room) {
  if (of->steps) {
    int length, step = (int)fmin(fmax(value - of->low + 0.5, 0), of->steps - 1);
    const char *word = word_of(of, step, &length);
    snprintf(text, room, "%.*s", length, word);
  } else {
    double least = 1e-5 * (of->high - of->low);  // single precision of a host's own range, which is no value
    snprintf(text, room, "%.4g%s%s", fabs(value) < least ? 0.0 : value, of->unit[0] ? " " : "", of->unit);
  }
}

static double bounded(const parameter *of, double value) { return fmin(fmax(value, of->low), of->high); }

bool parameter_number(const parameter *of, const char *text, double *value) {
  for (int32_t step = 0; step < of->steps; step++) {
    int length;
    const char *word = word_of(of, step, &length);
    if (strlen(text) == (size_t)length && !strncmp(text, word, (size_t)length)) return *value = of->low + step, true;
  }
  char *end;
  double found = strtod(text, &end);
  if (end == text || isnan(found)) return false;
  *value = bounded(of, found);
  return true;
}

void instrument_reset_values(instrument *own) {
  for (int32_t place = 0; place < own->of->parameter_count; place++)
    own->values[place] = parameters_of(own->of)[place].standard;
}

uint32_t instrument_latency(void) { return QUANTUM + AHEAD; }

uint32_t instrument_tail(const instrument *own) {
  return own->effects.kernels ? (uint32_t)((own->of->longest_s + effects_tail_s(&own->effects)) * own->rate_hz) : 0;
}

/* Memory */

static void *copied(const image *of, int64_t first, int64_t count, int64_t more) {
  double *memory = calloc((size_t)(count + more), sizeof(double));
  if (memory) memcpy(memory, (const double *)of + first, (size_t)count * sizeof(double));
  return memory;
}

static void push(instrument *own, event of) {
  player_memory *player = own->player;
  if (player->pushed - player->taken >= EVENTS) own->lost++;
  else player->events[player->pushed++ % EVENTS] = of;
}

/* Events count a quantum late, so that each is known before the quantum that holds its frame. */
static int64_t frame_of(const instrument *own, uint32_t at) { return own->mixer->frames + at + QUANTUM; }

static void follow_amp(instrument *own) {
  const double *gains = own->player->source_gains;
  bool compares = gains[0] != 0 && gains[1] != 0;
  CALL(own, drive, address_of(own->mixer), compares ? 0 : own->amp[AMP_DRIVE_DB], own->amp[AMP_TONE_DB], own->of->level_db);
}

static void apply(instrument *own, int32_t place, double value, int64_t frame) {
  const parameter *of = &parameters_of(own->of)[place];
  int source = (int)(value + 0.5);
  switch (of->kind) {
    case KIND_VALUE:
      push(own, (event){.frame = frame, .kind = PARAMETER, .key = of->index, .value = value});
      if (own->kit && value != own->followed[place]) CALL(own, kit_follow, address_of(own->kit), of->index, value);
      own->followed[place] = value;
      break;
    case KIND_VOLUME: own->mixer->wanted_volume = pow(10, value / 20); break;
    case KIND_SOURCE:
      own->table->sources = source == SOURCE_MODEL ? 1 : 2;
      own->player->source_gains[0] = source != SOURCE_TRUTH;
      own->player->source_gains[1] = source == SOURCE_MODEL ? 0 : source == SOURCE_TRUTH ? 1 : -1;
      follow_amp(own);
      break;
    case KIND_EFFECT:
      own->effects.values[of->index] = value;
      if (of->index == EFFECT_BODY_MIX) /* keys stay as loud */
        push(own, (event){.frame = frame, .kind = PARAMETER, .key = BODY_MIX, .value = value});
      break;
    case KIND_AMP:
      own->amp[of->index] = value;
      follow_amp(own);
      break;
  }
}

/* Mixer and player as new ones. Voices and scratch are written before they are read. */
static void rest(instrument *own) {
  const image *of = own->of;
  double rate_hz = own->rate_hz;
  memset(own->mixer, 0, offsetof(mixer_memory, scratch));
  memset(&own->mixer->amplifier, 0, sizeof own->mixer->amplifier);
  memset(own->player, 0, sizeof *own->player);
  mixer_memory *mixer = own->mixer;
  mixer->rate_hz = rate_hz;
  mixer->channels = 2;
  mixer->limiting = 1;
  mixer->wanted_volume = mixer->reduction = 1;
  for (int frame = 0; frame < AHEAD; frame++) mixer->gains[frame] = 1;
  mixer->release = exp(-1 / (LIMITER_RELEASE_S * rate_hz));
  mixer->smoothing = exp(-1 / (VOLUME_SMOOTHING_S * rate_hz));
  const double *taps = (const double *)of + of->taps;
  for (int tap = 0; tap < 2 * REACH + 1; tap++) mixer->taps[tap] = taps[tap] * rate_hz;
  mixer->player = address_of(own->player);
  own->player->rate_hz = rate_hz;
  own->player->modes = of->modes;
  own->player->most = of->most_notes;
  CALL(own, begin, address_of(own->player));
  for (int32_t place = 0; place < of->parameter_count; place++) {
    const parameter *each = &parameters_of(of)[place];
    if (each->kind == KIND_EFFECT) own->effects.values[each->index] = own->values[place];
    if (each->kind == KIND_AMP) own->amp[each->index] = own->values[place];
  }
}

void instrument_reset(instrument *own) {
  own->loaded = false; /* all values are taken up */
  double *heard = effects_mixed(&own->effects);
  rest(own);
  own->waiting = 0;
  own->read = 0;
  push(own, (event){.kind = TABLE, .table = address_of(own->table)});
  for (int32_t place = 0; place < own->of->parameter_count; place++) {
    const parameter *each = &parameters_of(own->of)[place];
    double value = own->values[place];
    bool always = each->kind == KIND_SOURCE || each->kind == KIND_VOLUME;
    if (always || value != each->standard || value != own->followed[place]) apply(own, place, value, 0);
  }
  own->mixer->volume = own->mixer->wanted_volume;
  effects_reset(&own->effects, heard);
}

bool rate_is_possible(double rate_hz) { return rate_hz >= 1000 && rate_hz <= 1e6; } /* NaN is not */

static bool begin(instrument *own) {
  const image *of = own->of;
  size_t voices = (size_t)(MOST_NOTES * MOST_SOURCES * (VOICE_SLOTS_FIXED + of->modes * VOICE_SLOTS_A_MODE));
  own->mixer = calloc(1, sizeof *own->mixer);
  own->player = calloc(1, sizeof *own->player + voices * sizeof(double));
  own->block = calloc(2 * QUANTUM, sizeof(float));
  own->table = copied(of, of->table, of->table_slots, of->table_room);
  own->model = copied(of, of->model, of->model_slots, 0);
  own->truth = copied(of, of->truth, of->truth_slots, 0);
  own->kit = of->kit ? copied(of, of->kit, of->kit_slots, of->kit_room) : NULL;
  if (!own->mixer || !own->player || !own->block || !own->table || !own->model || !own->truth || (of->kit && !own->kit)) return false;
  own->model->rate_hz = own->truth->rate_hz = own->rate_hz;
  own->table->programs[0] = address_of(own->model);
  own->table->programs[1] = address_of(own->truth);
  if (own->kit) CALL(own, kit_begin, address_of(own->kit), address_of(own->table));
  for (int32_t place = 0; place < of->parameter_count; place++) own->followed[place] = parameters_of(of)[place].standard;
  rest(own);
  return effects_begin(&own->effects, of, own->rate_hz, own->mixer, own->player, own->table);
}

bool instrument_begin(instrument *own, double rate_hz) {
  instrument_end(own);
  if (!rate_is_possible(rate_hz)) return false;
  own->rate_hz = rate_hz;
  own->kernels = kernels_here();
  bool begun = begin(own);
  if (begun) instrument_reset(own);
  else instrument_end(own);
  return begun;
}

void instrument_end(instrument *own) {
  effects_end(&own->effects);
  void *all[] = {own->mixer, own->player, own->table, own->model, own->truth, own->kit, own->block};
  for (size_t place = 0; place < sizeof all / sizeof *all; place++) free(all[place]);
  own->mixer = NULL, own->player = NULL, own->table = NULL, own->model = NULL, own->truth = NULL, own->kit = NULL, own->block = NULL;
}

void instrument_free(instrument *own) {
  instrument_end(own);
  effects_free(&own->effects);
}

/* Events */

void instrument_set(instrument *own, int32_t place, double value) {
  if (!isfinite(value)) return; /* the last one stays */
  const parameter *of = &parameters_of(own->of)[place];
  own->values[place] = bounded(of, value);
  if (of->kind != KIND_MACRO) return;
  const macro *chosen = &macros_of(own->of)[of->index];
  for (int32_t each = 0; each < chosen->count; each++) {
    int32_t target = chosen->targets[each].parameter;
    double low = chosen->targets[each].low, high = chosen->targets[each].high;
    own->values[target] = bounded(&parameters_of(own->of)[target], low + own->values[place] * (high - low));
  }
  own->moved = true;
}

static void wait_for(instrument *own, int64_t frame, int32_t place) {
  if (own->waiting == MOST_CHANGES) { /* the latest value counts, a little early */
    int32_t last = MOST_CHANGES - 1;
    while (last >= 0 && own->changes[last].parameter != place) last--;
    if (last >= 0) own->changes[last].value = own->values[place];
    else own->lost++;
    return;
  }
  own->changes[own->waiting++] = (change){frame, place, own->values[place]};
}

static void take_change(instrument *own, int64_t frame, int32_t place, double value) {
  const parameter *of = &parameters_of(own->of)[place];
  instrument_set(own, place, value);
  wait_for(own, frame, place);
  if (of->kind != KIND_MACRO) return;
  const macro *chosen = &macros_of(own->of)[of->index];
  for (int32_t each = 0; each < chosen->count; each++) wait_for(own, frame, chosen->targets[each].parameter);
}

void instrument_take(instrument *own, uint32_t at, event of) {
  if (!isfinite(of.value)) return;
  if (!own->mixer) {
    if (of.kind == PARAMETER) instrument_set(own, (int32_t)of.key, of.value);
    return;
  }
  of.frame = frame_of(own, at);
  if (of.kind == PARAMETER) {
    take_change(own, of.frame, (int32_t)of.key, of.value);
    return;
  }
  if (of.kind == TUNE || of.kind == CHOKE) {
    if (of.channel < 0) of.channel = ANY;
    if (of.key < 0) of.key = ANY;
    of.value = fmin(fmax(of.value, -120), 120); /* of CLAP */
  } else if (of.channel < 0 || of.channel >= CHANNELS || of.key < 0 || of.key >= KEYS) {
    return;
  }
  if (of.kind == NOTE_ON) of.value = fmin(fmax(of.value, 1), 127);
  if (of.kind == CONTROLLER && of.key == 121) of.value = 0; /* other values are of the app alone */
  push(own, of);
}

int64_t event_id(int32_t note) { return note < 0 ? 0 : (int64_t)note + 1; }

bool event_of_midi(const uint8_t *bytes, event *to) {
  int64_t channel = bytes[0] & 15, one = bytes[1] & 127, two = bytes[2] & 127, wheel = one + 128 * two - 8192;
  switch (bytes[0] >> 4) {
    case 8: *to = (event){.kind = NOTE_OFF, .channel = channel, .key = one}; return true;
    case 9: *to = (event){.kind = two ? NOTE_ON : NOTE_OFF, .channel = channel, .key = one, .value = (double)two}; return true;
    case 11: *to = (event){.kind = CONTROLLER, .channel = channel, .key = one, .value = (double)two}; return true;
    case 14: *to = (event){.kind = BEND, .channel = channel, .value = (double)wheel / (wheel < 0 ? 8192 : 8191)}; return true;
    default: return false;
  }
}

event event_of_brightness(int64_t channel, double value) {
  double steps = isfinite(value) ? floor(0.5 + 127 * fmin(fmax(value, 0), 1)) : NAN;
  return (event){.kind = CONTROLLER, .channel = channel, .key = 74, .value = steps};
}

/* Sound */

static void apply_due(instrument *own) {
  int64_t end = own->mixer->frames + QUANTUM;
  int32_t done = 0;
  while (done < own->waiting && own->changes[done].frame < end) {
    apply(own, own->changes[done].parameter, own->changes[done].value, own->changes[done].frame);
    done++;
  }
  if (!done) return;
  own->waiting -= done;
  memmove(own->changes, own->changes + done, (size_t)own->waiting * sizeof(change));
}

/* The mode of this thread's arithmetic; with FLUSHING, denormal numbers are zero. */
#if defined(__x86_64__)
enum { FLUSHING = 0x8040 };
static uint64_t mode(void) { return _mm_getcsr(); }
static void set_mode(uint64_t mode) { _mm_setcsr((unsigned int)mode); }
#else
enum { FLUSHING = 1 << 24 };
static uint64_t mode(void) { return __builtin_arm_rsr64("fpcr"); }
static void set_mode(uint64_t mode) { __builtin_arm_wsr64("fpcr", mode); }
#endif

static void render(instrument *own, uint32_t frames, float *left, float *right) {
  uint64_t before = mode();
  set_mode(before | FLUSHING);
  own->mixer->peak = 0; /* of what is rendered now */
  for (uint32_t done = 0; done < frames;) {
    int64_t rendered = own->mixer->left, left_over = frames - done;
    if (!rendered) {
      apply_due(own);
      if (own->kit) CALL(own, kit_prepare, address_of(own->kit), address_of(own->table), address_of(own->player));
      if (effects_follow(&own->effects)) push(own, (event){.kind = PARAMETER, .key = BODY_MIX, .value = own->effects.values[EFFECT_BODY_MIX]});
      rendered = QUANTUM;
    }
    int64_t count = rendered < left_over ? rendered : left_over;
    const float *block = own->block;
    if (CALL(own, render, address_of(own->mixer), count, address_of(block))) memset(own->block, 0, 2 * QUANTUM * sizeof(float));
    for (int64_t frame = 0; frame < count; frame++) {
      left[done + frame] = right ? block[2 * frame] : 0.5f * (block[2 * frame] + block[2 * frame + 1]);
      if (right) right[done + frame] = block[2 * frame + 1];
    }
    done += (uint32_t)count;
  }
  set_mode(before);
}

void instrument_play(instrument *own, uint32_t frames, float **channels, uint32_t count, event_source next, void *context) {
  if (own->mixer && atomic_exchange(&own->loaded, false))
    for (int32_t place = 0; place < own->of->parameter_count; place++) wait_for(own, frame_of(own, 0), place);
  event each;
  bool more = next(context, &each);
  for (uint32_t done = 0; done < frames;) {
    uint32_t end = done + QUANTUM < frames ? done + QUANTUM : frames;
    for (; more && each.frame < end; more = next(context, &each)) instrument_take(own, each.frame < done ? 0 : (uint32_t)each.frame - done, each);
    render(own, end - done, channels[0] + done, count > 1 ? channels[1] + done : NULL);
    done = end;
  }
  for (; more; more = next(context, &each)) instrument_take(own, 0, each);
  for (uint32_t channel = 2; frames && channel < count; channel++) memset(channels[channel], 0, frames * sizeof(float));
}

bool instrument_ended(instrument *own, report *found) {
  int64_t total = own->player->reported;
  if (total - own->read > REPORTS) own->read = total - REPORTS;
  while (own->read < total) {
    *found = own->player->reports[own->read++ % REPORTS];
    if (found->kind != BEGAN && found->id) return true;
  }
  return false;
}

bool instrument_silent(const instrument *own) {
  const player_memory *player = own->player;
  bool events = player->pushed != player->taken || player->queued;
  const convolver_memory *convolver = own->effects.convolver;
  bool echo = (convolver && convolver->active) || effects_wait(&own->effects);
  return !events && !echo && !own->waiting && !own->mixer->active && own->mixer->peak < 1e-9;
}

/* State */

static const uint32_t STATE_VERSION = 1;
typedef struct __attribute__((packed)) { uint32_t id; double value; } saved;

int32_t state_write(const image *of, const double *values, uint8_t *bytes) {
  memcpy(bytes, (uint32_t[]){STATE_VERSION, (uint32_t)of->parameter_count}, 8);
  for (int32_t place = 0; place < of->parameter_count; place++)
    memcpy(bytes + 8 + 12 * place, &(saved){parameters_of(of)[place].id, values[place]}, sizeof(saved));
  return 8 + 12 * (int32_t)of->parameter_count;
}

bool state_read(const image *of, const uint8_t *bytes, int64_t size, double *values) {
  uint32_t head[2];
  if (size < 8 || size > MOST_STATE_BYTES) return false;
  memcpy(head, bytes, sizeof head);
  if (head[0] != STATE_VERSION || head[1] > 4096 || size < 8 + 12 * (int64_t)head[1]) return false;
  for (int32_t place = 0; place < of->parameter_count; place++) values[place] = parameters_of(of)[place].standard;
  for (uint32_t number = 0; number < head[1]; number++) {
    saved each;
    memcpy(&each, bytes + 8 + 12 * number, sizeof each);
    if (!isfinite(each.value)) return false;
    int32_t place = parameter_with_id(of, each.id);
    if (place >= 0) values[place] = bounded(&parameters_of(of)[place], each.value);
  }
  return true;
}

bool instrument_load(instrument *own, const uint8_t *bytes, int64_t size) {
  double values[MOST_PARAMETERS];
  if (!state_read(own->of, bytes, size, values)) return false;
  memcpy(own->values, values, (size_t)own->of->parameter_count * sizeof(double));
  own->loaded = true;
  return true;
}
