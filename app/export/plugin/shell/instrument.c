/* See instrument.h. Nothing is allocated but in instrument_begin. */

#include "instrument.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "effects.h"
#include "layout.h"

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

_Static_assert(sizeof(image) == IMAGE_BYTES && sizeof(parameter) == PARAMETER_BYTES && sizeof(macro) == MACRO_BYTES, "as image.py writes");

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

static void *address(slot *memory) { return memory; }
static int64_t number_of(const void *pointer) { return (int64_t)(intptr_t)pointer; }

const parameter *parameters_of(const image *of) { return (const parameter *)((const char *)of + of->parameters); }

static const macro *macros_of(const image *of) { return (const macro *)((const char *)of + of->macros); }

int32_t parameter_with_id(const image *of, uint32_t id) {
  for (int32_t place = 0; place < of->parameter_count; place++)
    if (parameters_of(of)[place].id == id) return place;
  return -1;
}

void instrument_reset_values(instrument *own) {
  for (int32_t place = 0; place < own->of->parameter_count; place++)
    own->values[place] = parameters_of(own->of)[place].standard;
}

uint32_t instrument_latency(void) { return QUANTUM + AHEAD; }

uint32_t instrument_tail(const instrument *own) {
  return own->kernels ? (uint32_t)((own->of->longest_s + effects_tail_s(own)) * own->rate_hz) : 0;
}

static slot *copied(const image *of, int64_t first, int64_t count, int64_t more) {
  slot *memory = calloc((size_t)(count + more), sizeof(slot));
  if (memory) memcpy(memory, (const slot *)of + first, (size_t)count * sizeof(slot));
  return memory;
}

static slot *pushed(instrument *own, int64_t frame, int64_t kind, int32_t channel, int32_t key, double value) {
  slot *player = own->player;
  if (player[PLAYER_PUSHED].whole - player[PLAYER_TAKEN].whole >= EVENTS) {
    own->lost++;
    return NULL;
  }
  slot *event = player + PLAYER_EVENTS + player[PLAYER_PUSHED].whole % EVENTS * EVENT_SLOTS;
  memset(event, 0, EVENT_SLOTS * sizeof(slot));
  event[EVENT_FRAME].whole = frame;
  event[EVENT_KIND].whole = kind;
  event[EVENT_CHANNEL].whole = channel;
  event[EVENT_KEY].whole = key;
  event[EVENT_VALUE].real = value;
  player[PLAYER_PUSHED].whole++;
  return event;
}

/* Events count a quantum late, so that each is known before the quantum that holds its frame. */
static int64_t frame_of(const instrument *own, uint32_t at) { return own->mixer[MIXER_FRAMES].whole + at + QUANTUM; }

static void follow_amp(instrument *own) {
  const slot *gains = own->player + PLAYER_SOURCE_GAINS;
  bool compares = gains[0].real != 0 && gains[1].real != 0;
  void *error = NULL, *result = NULL;
  own->kernels->drive(&result, &error, number_of(own->mixer), compares ? 0 : own->amp[AMP_DRIVE_DB], own->amp[AMP_TONE_DB], own->of->level_db);
}

static void apply(instrument *own, int32_t place, double value, int64_t frame) {
  const parameter *of = &parameters_of(own->of)[place];
  if (of->kind == KIND_VALUE) {
    pushed(own, frame, PARAMETER, 0, of->index, value);
    void *error = NULL, *result = NULL;
    if (own->kit && value != own->followed[place])
      own->kernels->kit_follow(&result, &error, number_of(own->kit), of->index, value);
    own->followed[place] = value;
  } else if (of->kind == KIND_VOLUME) {
    own->mixer[MIXER_WANTED_VOLUME].real = pow(10, value / 20);
  } else if (of->kind == KIND_SOURCE) {
    int source = (int)(value + 0.5);
    own->table[TABLE_SOURCES].whole = source == SOURCE_MODEL ? 1 : 2;
    own->player[PLAYER_SOURCE_GAINS].real = source != SOURCE_TRUTH;
    own->player[PLAYER_SOURCE_GAINS + 1].real = source == SOURCE_MODEL ? 0 : source == SOURCE_TRUTH ? 1 : -1;
    follow_amp(own);
  } else if (of->kind == KIND_EFFECT) {
    own->effects.values[of->index] = value;
    if (of->index == EFFECT_BODY_MIX) pushed(own, frame, PARAMETER, 0, BODY_MIX, value); /* keys stay as loud */
  } else if (of->kind == KIND_AMP) {
    own->amp[of->index] = value;
    follow_amp(own);
  }
}

/* Mixer and player as new ones. Voices and scratch are written before they are read. */
static void rest(instrument *own) {
  const image *of = own->of;
  double rate_hz = own->rate_hz;
  slot *mixer = own->mixer, *player = own->player;
  memset(mixer, 0, MIXER_SCRATCH * sizeof(slot));
  memset(mixer + MIXER_AMPLIFIER, 0, (MIXER_SLOTS - MIXER_AMPLIFIER) * sizeof(slot));
  memset(player, 0, PLAYER_SLOTS * sizeof(slot));
  mixer[MIXER_RATE_HZ].real = rate_hz;
  mixer[MIXER_CHANNELS].whole = 2;
  mixer[MIXER_LIMITING].whole = 1;
  mixer[MIXER_WANTED_VOLUME].real = mixer[MIXER_REDUCTION].real = 1;
  for (int frame = 0; frame < AHEAD; frame++) mixer[MIXER_GAINS + frame].real = 1;
  mixer[MIXER_RELEASE].real = exp(-1 / (LIMITER_RELEASE_S * rate_hz));
  mixer[MIXER_SMOOTHING].real = exp(-1 / (VOLUME_SMOOTHING_S * rate_hz));
  const double *taps = (const double *)of + of->taps;
  for (int tap = 0; tap < 2 * REACH + 1; tap++) mixer[MIXER_TAPS + tap].real = taps[tap] * rate_hz;
  mixer[MIXER_PLAYER].whole = number_of(player);
  player[PLAYER_RATE_HZ].real = rate_hz;
  player[PLAYER_MODES].whole = of->modes;
  player[PLAYER_MOST].whole = of->most_notes;
  void *error = NULL, *result = NULL;
  own->kernels->begin(&result, &error, number_of(player));
  for (int32_t place = 0; place < of->parameter_count; place++) {
    const parameter *each = &parameters_of(of)[place];
    if (each->kind == KIND_EFFECT) own->effects.values[each->index] = own->values[place];
    if (each->kind == KIND_AMP) own->amp[each->index] = own->values[place];
  }
}

void instrument_reset(instrument *own) {
  slot *heard = effects_mixed(own);
  rest(own);
  own->waiting = 0;
  own->read = 0;
  slot *event = pushed(own, 0, TABLE, 0, 0, 0);
  event[EVENT_TABLE].whole = number_of(own->table);
  for (int32_t place = 0; place < own->of->parameter_count; place++) {
    const parameter *each = &parameters_of(own->of)[place];
    double value = own->values[place];
    bool always = each->kind == KIND_SOURCE || each->kind == KIND_VOLUME;
    if (always || value != each->standard || value != own->followed[place]) apply(own, place, value, 0);
  }
  own->mixer[MIXER_VOLUME].real = own->mixer[MIXER_WANTED_VOLUME].real;
  effects_reset(own, heard);
}

bool rate_is_possible(double rate_hz) { return rate_hz >= 1000 && rate_hz <= 1e6; } /* NaN is not */

bool instrument_begin(instrument *own, double rate_hz) {
  const image *of = own->of;
  instrument_end(own);
  if (!rate_is_possible(rate_hz)) return false;
  own->rate_hz = rate_hz;
  own->kernels = kernels_here();
  own->mixer = calloc(MIXER_SLOTS, sizeof(slot));
  own->player = calloc((size_t)(PLAYER_SLOTS + MOST_NOTES * MOST_SOURCES * (VOICE_SLOTS_FIXED + of->modes * VOICE_SLOTS_A_MODE)),
                       sizeof(slot));
  own->scratch = calloc(QUANTUM, sizeof(slot));
  own->table = copied(of, of->table, of->table_slots, of->table_room);
  own->model = copied(of, of->model, of->model_slots, 0);
  own->truth = copied(of, of->truth, of->truth_slots, 0);
  own->kit = of->kit ? copied(of, of->kit, of->kit_slots, of->kit_room) : NULL;
  if (!own->mixer || !own->player || !own->scratch || !own->table || !own->model || !own->truth || (of->kit && !own->kit)) {
    instrument_end(own);
    return false;
  }
  own->model[TENSION_PROGRAM_RATE_HZ].real = own->truth[TRUTH_PROGRAM_RATE_HZ].real = rate_hz;
  own->table[TABLE_PROGRAMS].whole = number_of(own->model);
  own->table[TABLE_PROGRAMS + 1].whole = number_of(own->truth);
  void *error = NULL, *result = NULL;
  if (own->kit) own->kernels->kit_begin(&result, &error, number_of(own->kit), number_of(own->table));
  for (int32_t place = 0; place < of->parameter_count; place++) own->followed[place] = parameters_of(of)[place].standard;
  rest(own);
  if (!effects_begin(own)) {
    instrument_end(own);
    return false;
  }
  instrument_reset(own);
  return true;
}

void instrument_end(instrument *own) {
  effects_end(own);
  slot **all[] = {&own->mixer, &own->player, &own->table, &own->model, &own->truth, &own->scratch, &own->kit};
  for (size_t place = 0; place < sizeof(all) / sizeof(*all); place++) {
    free(address(*all[place]));
    *all[place] = NULL;
  }
}

void instrument_free(instrument *own) {
  instrument_end(own);
  effects_free(own);
}

/* Events */

static bool plausible(int32_t channel, int32_t key) { return channel >= 0 && channel < CHANNELS && key >= 0 && key < KEYS; }

void instrument_note_on(instrument *own, uint32_t at, int64_t id, int32_t channel, int32_t key, double velocity) {
  if (!plausible(channel, key) || !isfinite(velocity)) return;
  slot *event = pushed(own, frame_of(own, at), NOTE_ON, channel, key, fmin(fmax(velocity, 1), 127));
  if (event) event[EVENT_ID].whole = id;
}

void instrument_note_off(instrument *own, uint32_t at, int32_t channel, int32_t key) {
  if (plausible(channel, key)) pushed(own, frame_of(own, at), NOTE_OFF, channel, key, 0);
}

void instrument_bend(instrument *own, uint32_t at, int32_t channel, double value) {
  if (plausible(channel, 0)) pushed(own, frame_of(own, at), BEND, channel, 0, value);
}

void instrument_controller(instrument *own, uint32_t at, int32_t channel, int32_t number, int32_t value) {
  if (number == 121) value = 0; /* other values are of the app alone */
  if (plausible(channel, number)) pushed(own, frame_of(own, at), CONTROLLER, channel, number, value);
}

/* `id`, `channel` and `key` choose the notes that are meant, as far as they are given: 0, ANY and ANY are not. */
static void pushed_for(instrument *own, uint32_t at, int64_t kind, int64_t id, int32_t channel, int32_t key, double value) {
  slot *event = pushed(own, frame_of(own, at), kind, channel < 0 ? ANY : channel, key < 0 ? ANY : key, value);
  if (event) event[EVENT_ID].whole = id;
}

void instrument_tune(instrument *own, uint32_t at, int64_t id, int32_t channel, int32_t key, double semitones) {
  if (isfinite(semitones)) pushed_for(own, at, TUNE, id, channel, key, fmin(fmax(semitones, -120), 120)); /* of CLAP */
}

void instrument_choke(instrument *own, uint32_t at, int64_t id, int32_t channel, int32_t key) {
  pushed_for(own, at, CHOKE, id, channel, key, 0);
}

void instrument_midi(instrument *own, uint32_t at, const uint8_t *bytes) {
  int32_t channel = bytes[0] & 15, one = bytes[1] & 127, two = bytes[2] & 127;
  switch (bytes[0] >> 4) {
    case 8: instrument_note_off(own, at, channel, one); break;
    case 9:
      if (two) instrument_note_on(own, at, 0, channel, one, two);
      else instrument_note_off(own, at, channel, one);
      break;
    case 11: instrument_controller(own, at, channel, one, two); break;
    case 14: {
      int32_t wheel = one + 128 * two - 8192;
      instrument_bend(own, at, channel, wheel < 0 ? wheel / 8192.0 : wheel / 8191.0);
      break;
    }
    default: break;
  }
}

static double bounded(const parameter *of, double value) { return fmin(fmax(value, of->low), of->high); }

void instrument_set(instrument *own, int32_t place, double value) {
  if (!isfinite(value)) return; /* the last one stays */
  own->values[place] = bounded(&parameters_of(own->of)[place], value);
  const parameter *of = &parameters_of(own->of)[place];
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

void instrument_follow(instrument *own, int32_t place) { wait_for(own, frame_of(own, 0), place); }

void instrument_change(instrument *own, uint32_t at, int32_t place, double value) {
  const image *of = own->of;
  int64_t frame = frame_of(own, at);
  if (!isfinite(value)) return;
  instrument_set(own, place, value);
  wait_for(own, frame, place);
  if (parameters_of(of)[place].kind != KIND_MACRO) return;
  const macro *chosen = &macros_of(of)[parameters_of(of)[place].index];
  for (int32_t each = 0; each < chosen->count; each++) wait_for(own, frame, chosen->targets[each].parameter);
}

/* Sound */

static void apply_due(instrument *own) {
  int64_t end = own->mixer[MIXER_FRAMES].whole + QUANTUM;
  int32_t done = 0;
  while (done < own->waiting && own->changes[done].frame < end) {
    apply(own, own->changes[done].parameter, own->changes[done].value, own->changes[done].frame);
    done++;
  }
  if (!done) return;
  own->waiting -= done;
  memmove(own->changes, own->changes + done, (size_t)own->waiting * sizeof(change));
}

/* Makes denormal numbers zero in this thread; returns the mode before. */
static uint64_t begin_flushing(void) {
#if defined(__x86_64__)
  unsigned int before = _mm_getcsr();
  _mm_setcsr(before | 0x8040);
  return before;
#elif defined(__aarch64__)
  uint64_t before;
  __asm__ volatile("mrs %0, fpcr" : "=r"(before));
  __asm__ volatile("msr fpcr, %0" ::"r"(before | (1 << 24)));
  return before;
#else
  return 0;
#endif
}

static void end_flushing(uint64_t before) {
#if defined(__x86_64__)
  _mm_setcsr((unsigned int)before);
#elif defined(__aarch64__)
  __asm__ volatile("msr fpcr, %0" ::"r"(before));
#else
  (void)before;
#endif
}

void instrument_render(instrument *own, uint32_t frames, float *left, float *right) {
  uint64_t before = begin_flushing();
  own->mixer[MIXER_PEAK].real = 0; /* of what is rendered now */
  float *block = (float *)own->scratch;
  for (uint32_t done = 0; done < frames;) {
    int64_t rendered = own->mixer[MIXER_LEFT].whole, left_over = frames - done;
    void *error = NULL, *result = NULL;
    if (!rendered) {
      apply_due(own);
      if (own->kit) own->kernels->kit_prepare(&result, &error, number_of(own->kit), number_of(own->table), number_of(own->player));
      if (effects_follow(own)) pushed(own, 0, PARAMETER, 0, BODY_MIX, own->effects.values[EFFECT_BODY_MIX]);
      rendered = QUANTUM;
    }
    int64_t count = rendered < left_over ? rendered : left_over;
    if (own->kernels->render(&result, &error, number_of(own->mixer), count, number_of(block))) memset(block, 0, 2 * QUANTUM * sizeof(float));
    for (int64_t frame = 0; frame < count; frame++) {
      left[done + frame] = right ? block[2 * frame] : 0.5f * (block[2 * frame] + block[2 * frame + 1]);
      if (right) right[done + frame] = block[2 * frame + 1];
    }
    done += (uint32_t)count;
  }
  end_flushing(before);
}

void instrument_report_ends(instrument *own, note_ended ended, void *context) {
  const slot *player = own->player;
  int64_t total = player[PLAYER_REPORTED].whole;
  if (total - own->read > REPORTS) own->read = total - REPORTS;
  for (; own->read < total; own->read++) {
    const slot *report = player + PLAYER_REPORTS + own->read % REPORTS * REPORT_SLOTS;
    if (report[REPORT_KIND].whole != BEGAN && report[REPORT_ID].whole)
      ended(context, report[REPORT_ID].whole, (int32_t)report[REPORT_CHANNEL].whole, (int32_t)report[REPORT_KEY].whole, 0);
  }
}

bool instrument_silent(const instrument *own) {
  const slot *player = own->player;
  bool events = player[PLAYER_PUSHED].whole != player[PLAYER_TAKEN].whole || player[PLAYER_QUEUED].whole;
  const slot *convolver = own->effects.convolver;
  bool echo = (convolver && convolver[CONVOLVER_ACTIVE].whole) || effects_wait(own);
  return !events && !echo && !own->waiting && !own->mixer[MIXER_ACTIVE].whole && own->mixer[MIXER_PEAK].real < 1e-9;
}

/* State */

static const uint32_t STATE_VERSION = 1;

int32_t state_write(const image *of, const double *values, uint8_t *bytes, int32_t room) {
  int32_t count = (int32_t)of->parameter_count, size = 8 + 12 * count;
  if (size > room) return -1;
  memcpy(bytes, &STATE_VERSION, 4);
  memcpy(bytes + 4, &count, 4);
  for (int32_t place = 0; place < count; place++) {
    memcpy(bytes + 8 + 12 * place, &parameters_of(of)[place].id, 4);
    memcpy(bytes + 12 + 12 * place, &values[place], 8);
  }
  return size;
}

bool state_read(const image *of, const uint8_t *bytes, int64_t size, double *values) {
  uint32_t version;
  int32_t count;
  double found[MOST_PARAMETERS];
  if (size < 8 || size > MOST_STATE_BYTES) return false;
  memcpy(&version, bytes, 4);
  memcpy(&count, bytes + 4, 4);
  if (version != STATE_VERSION || count < 0 || count > 4096 || size < 8 + 12 * count) return false;
  memcpy(found, values, (size_t)of->parameter_count * sizeof(double));
  for (int32_t each = 0; each < count; each++) {
    uint32_t id;
    double value;
    memcpy(&id, bytes + 8 + 12 * each, 4);
    memcpy(&value, bytes + 12 + 12 * each, 8);
    if (!isfinite(value)) return false;
    int32_t place = parameter_with_id(of, id);
    if (place >= 0) found[place] = bounded(&parameters_of(of)[place], value);
  }
  memcpy(values, found, (size_t)of->parameter_count * sizeof(double));
  return true;
}

bool instrument_load(instrument *own, const uint8_t *bytes, int64_t size) {
  double values[MOST_PARAMETERS];
  for (int32_t place = 0; place < own->of->parameter_count; place++) values[place] = parameters_of(own->of)[place].standard;
  if (!state_read(own->of, bytes, size, values)) return false;
  memcpy(own->values, values, (size_t)own->of->parameter_count * sizeof(double));
  return true;
}
