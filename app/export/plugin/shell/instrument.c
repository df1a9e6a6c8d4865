/* See instrument.h. Nothing is allocated but in instrument_begin. */

#include "instrument.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "layout.h"
#include "responses.h"

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

_Static_assert(sizeof(image) == IMAGE_BYTES && sizeof(parameter) == PARAMETER_BYTES && sizeof(macro) == MACRO_BYTES, "as image.py writes");

int32_t ls_render(void *result, void **error, int64_t mixer, int64_t frames, int64_t out);
int32_t ls_begin(void *result, void **error, int64_t player);
int32_t ls_partition(void *result, void **error, int64_t response, int64_t frames, int64_t channels, int64_t memory,
                     int64_t convolver);

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

uint32_t instrument_tail(const instrument *own) { return (uint32_t)(own->of->longest_s * own->rate_hz); }

static slot *copied(const image *of, int64_t first, int64_t count) {
  slot *memory = calloc((size_t)count, sizeof(slot));
  if (memory) memcpy(memory, (const slot *)of + first, (size_t)count * sizeof(slot));
  return memory;
}

/* Body and room: one response for the convolver, mixed of four: nothing, the body, the room, and both in series. */

static double mix_wanted(const instrument *own, int32_t which) {
  const slot *gains = own->player + PLAYER_SOURCE_GAINS;
  if (gains[0].real != 0 && gains[1].real != 0) return 0; /* a difference is heard as it is */
  double mix = own->mix[which];
  double wheel = own->of->wheel_mix == which ? (double)own->player[PLAYER_WHEEL].whole / 127 : 0;
  return mix + wheel * (own->of->wheel_goal - mix);
}

static bool begin_mix(instrument *own) {
  double body = mix_wanted(own, MIX_BODY), room = mix_wanted(own, MIX_ROOM), power = 0;
  own->mixing[MIX_BODY] = body, own->mixing[MIX_ROOM] = room;
  if (body == 0 && room == 0) { /* nothing is changed */
    own->mixer[M_EFFECTS].whole = 0;
    return false;
  }
  double weights[] = {(1 - body) * (1 - room), body * (1 - room), (1 - body) * room, body * room};
  const double *powers = own->powers[(body > 0 ? POWER_BODY : 0) + (room > 0 ? POWER_ROOM : 0)];
  for (int32_t each = 0; each < 16; each++) power += weights[each / 4] * weights[each % 4] * powers[each];
  for (int32_t each = 0; each < 1 + MIX_PARTS; each++) own->weights[each] = weights[each] / fmax(sqrt(power), 1e-30);
  own->mixing_at = I_HEADER;
  return true;
}

/* Goes on mixing; what is ready is handed to the convolver, which fades to it. */
static void mix_on(instrument *own, int64_t most) {
  slot *mixer = own->mixer, *to = own->mixes[mixer[M_EFFECTS_NOW].whole == number_of(own->mixes[0])];
  int64_t first = own->mixing_at, end = first + most < own->mix_slots ? first + most : own->mix_slots;
  for (int64_t place = first; place < end; place++) to[place].real = 0;
  for (int32_t which = 0; which < MIX_PARTS; which++)
    for (int64_t place = first; own->parts[which] && place < end; place++)
      to[place].real += own->weights[1 + which] * own->parts[which][place].real;
  for (int32_t channel = 0; channel < 2; channel++) { /* a single sample at the beginning: the same at all frequencies */
    int64_t begin = I_HEADER + channel * 2 * (QUANTUM + 1), until = begin + QUANTUM + 1;
    for (int64_t place = begin > first ? begin : first; place < until && place < end; place++)
      to[place].real += own->weights[0] / (2 * QUANTUM);
  }
  own->mixing_at = end < own->mix_slots ? end : -1;
  if (own->mixing_at < 0) mixer[M_EFFECTS].whole = number_of(to);
}

enum { MIXED_A_QUANTUM = 16384 }; /* slots: some ten microseconds */

static void follow_mix(instrument *own) {
  if (!own->convolver) return;
  const slot *mixer = own->mixer;
  if (own->mixing_at >= 0) {
    mix_on(own, MIXED_A_QUANTUM);
    return;
  }
  bool settled = !mixer[M_EFFECTS_NEXT].whole && mixer[M_EFFECTS].whole == mixer[M_EFFECTS_NOW].whole;
  if (settled && (mix_wanted(own, MIX_BODY) != own->mixing[MIX_BODY] || mix_wanted(own, MIX_ROOM) != own->mixing[MIX_ROOM]))
    begin_mix(own);
}

/* The parts of the response at a rate, in the convolver's form. */
static bool begin_parts(instrument *own) {
  responses found;
  bool made = responses_begin(&found, own->of, own->rate_hz);
  int64_t frames = 1;
  for (int32_t which = 0; which < MIX_PARTS; which++)
    if (found.of[which].frames > frames) frames = found.of[which].frames;
  own->frames_of_parts = frames;
  int64_t early_frames = frames < EARLY * QUANTUM ? frames : EARLY * QUANTUM;
  int64_t early = (early_frames + QUANTUM - 1) / QUANTUM, late = (frames - early_frames + WINDOW - 1) / WINDOW;
  own->mix_slots = I_HEADER + 2 * 2 * (early * (QUANTUM + 1) + late * (WINDOW + 1));
  memcpy(own->powers, found.powers, sizeof own->powers);
  for (int32_t which = 0; made && which < MIX_PARTS; which++) {
    const sound *each = &found.of[which];
    if (!each->frames) continue;
    double *padded = calloc((size_t)(2 * frames), sizeof(double)); /* all of one length, so that all are laid out alike */
    own->parts[which] = calloc((size_t)own->mix_slots, sizeof(slot));
    made = padded && own->parts[which];
    void *error = NULL, *result = NULL;
    if (made) {
      memcpy(padded, each->samples, (size_t)each->frames * sizeof(pair));
      ls_partition(&result, &error, number_of(padded), frames, 2, number_of(own->parts[which]), number_of(own->convolver));
    }
    free(padded);
  }
  responses_end(&found);
  own->parts_hz = made ? own->rate_hz : 0;
  return made;
}

static void end_parts(instrument *own) {
  for (int32_t which = 0; which < MIX_PARTS; which++) {
    free(own->parts[which]);
    own->parts[which] = NULL;
  }
  own->parts_hz = 0;
}

static bool begin_responses(instrument *own) {
  const image *of = own->of;
  own->mixing_at = -1;
  if (!of->body_modes && !of->impulse_frames && of->room_t60_s == 0) return true;
  slot *workshop = calloc(C_LATE, sizeof(slot));
  if (!workshop) return false;
  for (int64_t k = 0; k < 2 * WINDOW; k++) {
    double turn = 2 * 3.14159265358979323846 * (double)k / (2 * WINDOW);
    workshop[C_COSINES + k].real = cos(turn);
    workshop[C_SINES + k].real = sin(turn);
  }
  own->convolver = workshop;
  if (own->parts_hz != own->rate_hz) {
    end_parts(own);
    if (!begin_parts(own)) return false;
  }
  int64_t late = (own->frames_of_parts + WINDOW - 1) / WINDOW; /* at least as many as there are */
  own->convolver = realloc(workshop, (size_t)(C_LATE + (late + 1) * 4 * (WINDOW + 1)) * sizeof(slot));
  if (!own->convolver) {
    free(workshop);
    return false;
  }
  slot *c = own->convolver;
  memset(c + C_LATE, 0, (size_t)((late + 1) * 4 * (WINDOW + 1)) * sizeof(slot));
  memset(c + C_WORK, 0, 8 * WINDOW * sizeof(slot));
  c[C_CAPACITY].whole = late + 1;
  c[C_FADE_WINDOWS].whole = (int64_t)ceil(CONVOLVER_FADE_S * own->rate_hz / WINDOW);
  c[C_STEP].whole = -1;
  for (int32_t each = 0; each < 2; each++) {
    own->mixes[each] = calloc((size_t)own->mix_slots, sizeof(slot));
    if (!own->mixes[each]) return false;
    for (int32_t which = 0; which < MIX_PARTS; which++)
      if (own->parts[which]) memcpy(own->mixes[each], own->parts[which], I_HEADER * sizeof(slot));
  }
  own->mixer[M_CONVOLVER].whole = number_of(c);
  return true;
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
  event[EVENT_POSITION].real = event[EVENT_PITCH_HZ].real = NAN;
  player[PLAYER_PUSHED].whole++;
  return event;
}

/* Events count a quantum late, so that each is known before the quantum that holds its frame. */
static int64_t frame_of(const instrument *own, uint32_t at) { return own->mixer[M_FRAMES].whole + at + QUANTUM; }

/* Drums that are struck from now on decay as a knob says. */
static void follow_losses(instrument *own, int64_t knob, double value) {
  const image *of = own->of;
  double by = value - ((const slot *)of)[of->table + TABLE_VALUES + knob].real; /* of the instrument's own */
  own->added[knob == BRIGHTNESS_DECAY] = by;
  const slot *before = (const slot *)of + of->table, *slots = (const slot *)of + of->losses;
  const slot *drums = own->table + own->table[TABLE_DRUMS].whole;
  for (int32_t key = 0; key < KEYS; key++) {
    int64_t drum = drums[key].whole, modes = drum ? own->table[drum + DRUM_MODES].whole : 0;
    const double *rows = (const double *)of + slots[key].whole;
    for (int64_t mode = 0, first = drum + DRUM_HEADER + modes; mode < modes; mode++)
      own->table[first + mode].real = before[first + mode].real + own->added[0] * rows[mode] + own->added[1] * rows[modes + mode];
  }
}

/* As `engine.effects.Amp.factors`. */
static void follow_amp(instrument *own) {
  slot *amp = own->mixer + M_AMPLIFIER;
  const slot *gains = own->player + PLAYER_SOURCE_GAINS;
  bool compares = gains[0].real != 0 && gains[1].real != 0;
  double drive = pow(10, own->amp[AMP_DRIVE_DB] / 20);
  bool on = own->amp[AMP_DRIVE_DB] > 0 && !compares;
  amp[A_WANTED_GAIN].real = on ? own->of->level * sqrt(1 + pow(drive * AMP_NOMINAL, 2)) / drive : 0;
  amp[A_WANTED_TONE].real = on ? pow(10, own->amp[AMP_TONE_DB] / 20) : 0;
  amp[A_WANTED_DRIVE].real = on ? drive / own->of->level : 0;
}

static void apply(instrument *own, int32_t place, double value, int64_t frame) {
  const parameter *of = &parameters_of(own->of)[place];
  if (of->kind == KIND_VALUE) {
    pushed(own, frame, PARAMETER, 0, of->index, value);
    if (own->of->losses && (of->index == DECAY || of->index == BRIGHTNESS_DECAY)) follow_losses(own, of->index, value);
  } else if (of->kind == KIND_VOLUME) {
    own->mixer[M_WANTED_VOLUME].real = pow(10, value / 20);
  } else if (of->kind == KIND_SOURCE) {
    int source = (int)(value + 0.5);
    own->table[TABLE_SOURCES].whole = source == SOURCE_MODEL ? 1 : 2;
    own->player[PLAYER_SOURCE_GAINS].real = source != SOURCE_TRUTH;
    own->player[PLAYER_SOURCE_GAINS + 1].real = source == SOURCE_MODEL ? 0 : source == SOURCE_TRUTH ? 1 : -1;
    follow_amp(own);
  } else if (of->kind == KIND_MIX) {
    own->mix[of->index] = value;
    if (of->index == MIX_BODY) pushed(own, frame, PARAMETER, 0, BODY_MIX, value); /* keys stay as loud */
  } else if (of->kind == KIND_AMP) {
    own->amp[of->index] = value;
    follow_amp(own);
  }
}

bool instrument_begin(instrument *own, double rate_hz) {
  const image *of = own->of;
  instrument_end(own);
  own->rate_hz = rate_hz;
  own->mixer = calloc(MIXER_SLOTS, sizeof(slot));
  own->player = calloc((size_t)(PLAYER_VOICES + MOST_NOTES * MOST_SOURCES * (VOICE_SLOTS_FIXED + of->modes * VOICE_SLOTS_A_MODE)),
                       sizeof(slot));
  own->scratch = calloc(QUANTUM, sizeof(slot));
  own->table = copied(of, of->table, of->table_slots);
  own->model = copied(of, of->model, of->model_slots);
  own->truth = copied(of, of->truth, of->truth_slots);
  if (!own->mixer || !own->player || !own->scratch || !own->table || !own->model || !own->truth) {
    instrument_end(own);
    return false;
  }
  slot *mixer = own->mixer, *player = own->player;
  mixer[M_RATE].real = rate_hz;
  mixer[M_CHANNELS].whole = 2;
  mixer[M_LIMITING].whole = 1;
  mixer[M_WANTED_VOLUME].real = mixer[M_VOLUME].real = mixer[M_REDUCTION].real = 1;
  for (int frame = 0; frame < AHEAD; frame++) mixer[M_GAINS + frame].real = 1;
  mixer[M_RELEASE].real = exp(-1 / (LIMITER_RELEASE_S * rate_hz));
  mixer[M_SMOOTHING].real = exp(-1 / (VOLUME_SMOOTHING_S * rate_hz));
  const double *taps = (const double *)of + of->taps;
  for (int tap = 0; tap < 2 * REACH + 1; tap++) mixer[M_TAPS + tap].real = taps[tap] * rate_hz;
  mixer[M_ADDRESS].whole = number_of(mixer);
  mixer[M_PLAYER].whole = number_of(player);
  own->model[S_RATE].real = own->truth[T_RATE].real = rate_hz;
  own->table[TABLE_PROGRAMS].whole = number_of(own->model);
  own->table[TABLE_PROGRAMS + 1].whole = number_of(own->truth);
  player[PLAYER_RATE].real = rate_hz;
  player[PLAYER_MODES].whole = of->modes;
  player[PLAYER_MOST].whole = of->most_notes;
  void *error = NULL, *result = NULL;
  ls_begin(&result, &error, number_of(player));
  for (int32_t place = 0; place < of->parameter_count; place++) {
    const parameter *each = &parameters_of(of)[place];
    if (each->kind == KIND_MIX) own->mix[each->index] = own->values[place];
    if (each->kind == KIND_AMP) own->amp[each->index] = own->values[place];
  }
  if (!begin_responses(own)) {
    instrument_end(own);
    return false;
  }
  if (own->convolver && begin_mix(own)) mix_on(own, own->mix_slots);
  own->waiting = 0;
  own->read = 0;
  own->added[0] = own->added[1] = 0;
  slot *event = pushed(own, 0, TABLE, 0, 0, 0);
  event[EVENT_TABLE].whole = number_of(own->table);
  for (int32_t place = 0; place < of->parameter_count; place++) {
    const parameter *each = &parameters_of(of)[place];
    bool always = each->kind == KIND_SOURCE || each->kind == KIND_VOLUME;
    if (always || own->values[place] != each->standard) apply(own, place, own->values[place], 0);
  }
  mixer[M_VOLUME].real = mixer[M_WANTED_VOLUME].real;
  return true;
}

void instrument_end(instrument *own) {
  slot **all[] = {&own->mixer, &own->player, &own->table, &own->model, &own->truth, &own->convolver, &own->scratch,
                  &own->mixes[0], &own->mixes[1]};
  for (size_t place = 0; place < sizeof(all) / sizeof(*all); place++) {
    free(address(*all[place]));
    *all[place] = NULL;
  }
}

void instrument_free(instrument *own) {
  instrument_end(own);
  end_parts(own);
}

/* Events */

static bool plausible(int32_t channel, int32_t key) { return channel >= 0 && channel < CHANNELS && key >= 0 && key < KEYS; }

void instrument_note_on(instrument *own, uint32_t at, int64_t id, int32_t channel, int32_t key, double velocity) {
  if (!plausible(channel, key)) return;
  slot *event = pushed(own, frame_of(own, at), NOTE_ON, channel, key, velocity);
  if (event) event[EVENT_ID].whole = id;
}

void instrument_note_off(instrument *own, uint32_t at, int32_t channel, int32_t key) {
  if (plausible(channel, key)) pushed(own, frame_of(own, at), NOTE_OFF, channel, key, 0);
}

void instrument_bend(instrument *own, uint32_t at, int32_t channel, double value) {
  if (plausible(channel, 0)) pushed(own, frame_of(own, at), BEND, channel, 0, value);
}

void instrument_controller(instrument *own, uint32_t at, int32_t channel, int32_t number, int32_t value) {
  if (plausible(channel, number)) pushed(own, frame_of(own, at), CONTROLLER, channel, number, value);
}

/* `id`, `channel` and `key` choose the notes that are meant, as far as they are given: 0, ANY and ANY are not. */
static void pushed_for(instrument *own, uint32_t at, int64_t kind, int64_t id, int32_t channel, int32_t key, double value) {
  slot *event = pushed(own, frame_of(own, at), kind, channel < 0 ? ANY : channel, key < 0 ? ANY : key, value);
  if (event) event[EVENT_ID].whole = id;
}

void instrument_tune(instrument *own, uint32_t at, int64_t id, int32_t channel, int32_t key, double semitones) {
  if (isfinite(semitones)) pushed_for(own, at, TUNE, id, channel, key, semitones);
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

void instrument_reset(instrument *own) {
  own->waiting = 0;
  pushed(own, 0, CANCEL, 0, 0, 0);
  for (int32_t channel = 0; channel < CHANNELS; channel++) instrument_controller(own, 0, channel, 121, 0);
  instrument_controller(own, 0, 0, 120, 0);
}

static double bounded(const parameter *of, double value) {
  if (!(value >= of->low)) return of->low;
  return value > of->high ? of->high : value;
}

void instrument_set(instrument *own, int32_t place, double value) {
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
  if (own->waiting == MOST_CHANGES) {
    own->lost++;
    return;
  }
  own->changes[own->waiting++] = (change){frame, place, own->values[place]};
}

void instrument_follow(instrument *own, int32_t place) { wait_for(own, frame_of(own, 0), place); }

void instrument_change(instrument *own, uint32_t at, int32_t place, double value) {
  const image *of = own->of;
  int64_t frame = frame_of(own, at);
  instrument_set(own, place, value);
  wait_for(own, frame, place);
  if (parameters_of(of)[place].kind != KIND_MACRO) return;
  const macro *chosen = &macros_of(of)[parameters_of(of)[place].index];
  for (int32_t each = 0; each < chosen->count; each++) wait_for(own, frame, chosen->targets[each].parameter);
}

/* Sound */

static void apply_due(instrument *own) {
  int64_t end = own->mixer[M_FRAMES].whole + QUANTUM;
  int32_t done = 0;
  while (done < own->waiting && own->changes[done].frame < end) {
    apply(own, own->changes[done].parameter, own->changes[done].value, own->changes[done].frame);
    done++;
  }
  if (!done) return;
  own->waiting -= done;
  memmove(own->changes, own->changes + done, (size_t)own->waiting * sizeof(change));
}

void instrument_render(instrument *own, uint32_t frames, float *left, float *right) {
#if defined(__x86_64__)
  unsigned int before = _mm_getcsr();
  _mm_setcsr(before | 0x8040); /* denormal numbers are zero */
#endif
  own->mixer[M_PEAK].real = 0; /* of what is rendered now */
  float *block = (float *)own->scratch;
  for (uint32_t done = 0; done < frames;) {
    int64_t rendered = own->mixer[M_LEFT].whole, left_over = frames - done;
    if (!rendered) {
      apply_due(own);
      follow_mix(own);
      rendered = QUANTUM;
    }
    int64_t count = rendered < left_over ? rendered : left_over;
    void *error = NULL, *result = NULL;
    if (ls_render(&result, &error, number_of(own->mixer), count, number_of(block))) memset(block, 0, 2 * QUANTUM * sizeof(float));
    for (int64_t frame = 0; frame < count; frame++) {
      left[done + frame] = right ? block[2 * frame] : 0.5f * (block[2 * frame] + block[2 * frame + 1]);
      if (right) right[done + frame] = block[2 * frame + 1];
    }
    done += (uint32_t)count;
  }
#if defined(__x86_64__)
  _mm_setcsr(before);
#endif
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
  bool echo = own->convolver && own->convolver[C_ACTIVE].whole;
  return !events && !echo && !own->waiting && !own->mixer[M_ACTIVE].whole && own->mixer[M_PEAK].real < 1e-9;
}

/* State */

static const uint32_t STATE_VERSION = 1;

int32_t instrument_save(const instrument *own, uint8_t *bytes, int32_t room) {
  int32_t count = (int32_t)own->of->parameter_count, size = 8 + 12 * count;
  if (size > room) return -1;
  memcpy(bytes, &STATE_VERSION, 4);
  memcpy(bytes + 4, &count, 4);
  for (int32_t place = 0; place < count; place++) {
    memcpy(bytes + 8 + 12 * place, &parameters_of(own->of)[place].id, 4);
    memcpy(bytes + 12 + 12 * place, &own->values[place], 8);
  }
  return size;
}

bool instrument_load(instrument *own, const uint8_t *bytes, int32_t size) {
  uint32_t version;
  int32_t count;
  if (size < 8) return false;
  memcpy(&version, bytes, 4);
  memcpy(&count, bytes + 4, 4);
  if (version != STATE_VERSION || count < 0 || count > 4096 || size < 8 + 12 * count) return false;
  instrument_reset_values(own);
  for (int32_t each = 0; each < count; each++) {
    uint32_t id;
    double value;
    memcpy(&id, bytes + 8 + 12 * each, 4);
    memcpy(&value, bytes + 12 + 12 * each, 8);
    int32_t place = parameter_with_id(own->of, id);
    if (place >= 0) own->values[place] = bounded(&parameters_of(own->of)[place], value);
  }
  return true;
}
