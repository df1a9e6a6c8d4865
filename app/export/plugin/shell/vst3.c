/* The instrument as a VST3 plug-in: one object that is component and controller. */

#include "vst3_abi.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "instrument.h"

enum { FACES = 6, MOST_EVENTS = 1024, MOST_CHANGED = 768, MOST_NOTES_KNOWN = 256 };

/* Controllers that messages of a host reach by hidden parameters, for each channel of MIDI. */
static const int16_t CONTROLLERS[] = {1, 6, 7, 11, 38, 64, 74, 96, 97, 98, 99, 100, 101, 120, 121, 123, VST_PITCH_BEND};
enum { A_CHANNEL = sizeof CONTROLLERS / sizeof *CONTROLLERS, MIDI_CHANNELS = 16, CONTROLLER_COUNT = A_CHANNEL * MIDI_CHANNELS };
static const uint32_t FIRST_CONTROLLER = 0x7FFF0000;

static double standard_of(int16_t number) {
  return number == VST_PITCH_BEND ? 0.5 : number == 7 ? 100.0 / 127 : number == 11 ? 1 : 0; /* as a channel begins */
}

typedef struct shell shell;
typedef struct { const void *table; shell *own; } face; /* what a host holds of one interface */
typedef struct { int32_t note; int16_t channel, key; } known_note;

struct shell {
  face faces[FACES];
  atomic_uint references;
  instrument own;
  double rate_hz;
  double shown[MOST_PARAMETERS + CONTROLLER_COUNT]; /* normalised, controllers behind the parameters */
  known_note known[MOST_NOTES_KNOWN];
  uint32_t known_count;
  event events[MOST_EVENTS];
  uint32_t order[MOST_EVENTS], event_count, event_next;
};

static shell *shell_of(void *interface) { return ((face *)interface)->own; }
static bool same(const void *id, const vst_uid other) { return !memcmp(id, other, sizeof(vst_uid)); }

static void write_text(uint16_t *text, int32_t room, const char *utf8) {
  int32_t count = 0;
  for (const uint8_t *at = (const uint8_t *)utf8; *at && count < room - 1;) {
    uint32_t code = *at++;
    int more = code >= 0xF0 ? 3 : code >= 0xE0 ? 2 : code >= 0xC0 ? 1 : 0;
    if (more) code &= 0x3Fu >> more;
    for (; more && (*at & 0xC0) == 0x80; more--) code = code << 6 | (*at++ & 0x3F);
    text[count++] = code < 0x10000 ? (uint16_t)code : '?';
  }
  text[count] = 0;
}

static void read_text(char *text, int32_t room, const uint16_t *utf16) {
  int32_t count = 0;
  for (; utf16[count] && count < room - 1; count++) text[count] = utf16[count] < 128 ? (char)utf16[count] : '?';
  text[count] = 0;
}

/* References */

static int32_t query(void *interface, const vst_uid id, void **found);

static uint32_t add_reference(void *interface) { return atomic_fetch_add(&shell_of(interface)->references, 1) + 1; }

static uint32_t release(void *interface) {
  shell *own = shell_of(interface);
  uint32_t left = atomic_fetch_sub(&own->references, 1) - 1;
  if (!left) {
    instrument_free(&own->own);
    free(own);
  }
  return left;
}

static int32_t initialize(void *, void *) { return VST_OK; }

static int32_t terminate(void *interface) {
  instrument_end(&shell_of(interface)->own);
  return VST_OK;
}

/* Parameters: hosts have them between 0 and 1. */

/* As `Parameter.value` and `Parameter.share` of app/shared/parameters.py. */
static double to_plain(const parameter *of, double value) {
  double part = of->curve == 1 ? value : (pow(of->curve, value) - 1) / (of->curve - 1);
  return fmin(fmax(of->low + part * (of->high - of->low), of->low), of->high);
}

static double from_plain(const parameter *of, double plain) {
  if (!(of->high > of->low)) return 0;
  double part = (plain - of->low) / (of->high - of->low);
  return of->curve == 1 ? part : log1p(part * (of->curve - 1)) / log(of->curve);
}

static void show(shell *own) {
  for (int32_t place = 0; place < own->own.of->parameter_count; place++)
    own->shown[place] = from_plain(&parameters_of(own->own.of)[place], own->own.values[place]);
}

/* The place in `shown`; -1: there is none. */
static int32_t shown_place(const shell *own, uint32_t id) {
  int32_t place = parameter_with_id(own->own.of, id);
  return place < 0 && id - FIRST_CONTROLLER < CONTROLLER_COUNT ? (int32_t)(MOST_PARAMETERS + id - FIRST_CONTROLLER) : place;
}

/* Hosts give changes and notes apart, each in the order of frames. */
static void add_event(shell *own, int32_t frame, event of, uint32_t most) {
  if (own->event_count >= most) return;
  uint32_t place = own->event_count++, before = place;
  of.frame = frame < 0 ? 0 : frame;
  own->events[place] = of;
  for (; before && own->events[own->order[before - 1]].frame > of.frame; before--) own->order[before] = own->order[before - 1];
  own->order[before] = place;
}

static bool next_event(void *context, event *to) {
  shell *own = context;
  if (own->event_next == own->event_count) return false;
  *to = own->events[own->order[own->event_next++]];
  return true;
}

static void add_change(shell *own, int32_t frame, uint32_t id, double value) {
  int32_t place = shown_place(own, id), number = place - MOST_PARAMETERS;
  if (place < 0 || !isfinite(value)) return; /* the last one stays */
  value = own->shown[place] = fmin(fmax(value, 0), 1);
  if (number < 0) {
    double plain = to_plain(&parameters_of(own->own.of)[place], value);
    add_event(own, frame, (event){.kind = PARAMETER, .key = place, .value = plain}, MOST_CHANGED);
    return;
  }
  int32_t channel = number / A_CHANNEL, controller = CONTROLLERS[number % A_CHANNEL];
  int32_t wheel = (int32_t)(16383 * value + 0.5), steps = (int32_t)(127 * value + 0.5);
  uint8_t bent[] = {(uint8_t)(0xE0 | channel), (uint8_t)(wheel & 127), (uint8_t)(wheel >> 7)};
  uint8_t moved[] = {(uint8_t)(0xB0 | channel), (uint8_t)controller, (uint8_t)steps};
  event of;
  if (event_of_midi(controller == VST_PITCH_BEND ? bent : moved, &of)) add_event(own, frame, of, MOST_EVENTS);
}

/* Component */

static int32_t controller_class(void *, vst_uid) { return VST_MISSING; } /* it is its own controller */

static int32_t set_io_mode(void *, int32_t) { return VST_OK; }

static bool is_bus(int32_t media, int32_t direction) {
  return (media == VST_AUDIO && direction == VST_OUTPUT) || (media == VST_EVENTS && direction == VST_INPUT);
}

static int32_t bus_count(void *, int32_t media, int32_t direction) { return is_bus(media, direction); }

static int32_t bus_info(void *, int32_t media, int32_t direction, int32_t index, vst_bus *bus) {
  if (!is_bus(media, direction) || index) return VST_BAD_ARGUMENT;
  *bus = (vst_bus){media, direction, media == VST_AUDIO ? 2 : MIDI_CHANNELS, {0}, VST_MAIN, VST_DEFAULT_ACTIVE};
  write_text(bus->name, 128, media == VST_AUDIO ? "Output" : "Notes");
  return VST_OK;
}

static int32_t routing(void *, void *, void *) { return VST_MISSING; }

static int32_t activate_bus(void *, int32_t media, int32_t direction, int32_t index, uint8_t) {
  return is_bus(media, direction) && !index ? VST_OK : VST_BAD_ARGUMENT;
}

static int32_t set_active(void *interface, uint8_t state) {
  shell *own = shell_of(interface);
  instrument_end(&own->own);
  own->known_count = 0;
  return !state || instrument_begin(&own->own, own->rate_hz) ? VST_OK : VST_FALSE;
}

static int32_t set_state(void *interface, vst_stream *stream) {
  shell *own = shell_of(interface);
  uint8_t bytes[MOST_STATE_BYTES];
  int32_t size = 0;
  if (!stream) return VST_BAD_ARGUMENT;
  for (int32_t count = 0; size < MOST_STATE_BYTES; size += count)
    if (stream->table->read(stream, bytes + size, MOST_STATE_BYTES - size, &count) != VST_OK || count <= 0) break;
  if (!instrument_load(&own->own, bytes, size)) return VST_FALSE;
  show(own);
  return VST_OK;
}

static int32_t get_state(void *interface, vst_stream *stream) {
  const instrument *own = &shell_of(interface)->own;
  uint8_t bytes[STATE_BYTES];
  if (!stream) return VST_BAD_ARGUMENT;
  int32_t size = state_write(own->of, own->values, bytes), count = 0;
  for (int32_t done = 0; done < size; done += count)
    if (stream->table->write(stream, bytes + done, size - done, &count) != VST_OK || count <= 0) return VST_FALSE;
  return VST_OK;
}

static const void *const component[] = {query, add_reference, release, initialize, terminate, controller_class, set_io_mode, bus_count, bus_info,
                                        routing, activate_bus, set_active, set_state, get_state};

/* Processor */

enum { STEREO = 3 };

static int32_t set_arrangements(void *, uint64_t *, int32_t input_count, uint64_t *outputs, int32_t output_count) {
  return !input_count && output_count == 1 && outputs[0] == STEREO ? VST_OK : VST_FALSE;
}

static int32_t arrangement(void *, int32_t direction, int32_t index, uint64_t *found) {
  if (direction != VST_OUTPUT || index) return VST_BAD_ARGUMENT;
  *found = STEREO;
  return VST_OK;
}

static int32_t can_sample_size(void *, int32_t size) { return size ? VST_FALSE : VST_OK; } /* 32 bits */

static uint32_t latency(void *) { return instrument_latency(); }

static int32_t setup(void *interface, vst_setup *wanted) {
  shell *own = shell_of(interface);
  if (wanted->sample_size || wanted->most_frames < 1 || !rate_is_possible(wanted->rate_hz)) return VST_FALSE;
  own->rate_hz = wanted->rate_hz;
  own->own.effects.offline = wanted->mode == VST_OFFLINE;
  return VST_OK;
}

static int32_t set_processing(void *interface, uint8_t state) {
  shell *own = shell_of(interface);
  if (!state && own->own.mixer) instrument_reset(&own->own);
  return VST_OK;
}

static uint32_t tail(void *interface) {
  const instrument *own = &shell_of(interface)->own;
  return own->mixer ? instrument_tail(own) : 0;
}

static const known_note *note_with_id(const shell *own, int32_t note) {
  uint32_t count = own->known_count < MOST_NOTES_KNOWN ? own->known_count : MOST_NOTES_KNOWN;
  for (uint32_t back = 1; back <= count; back++) {
    const known_note *each = &own->known[(own->known_count - back) % MOST_NOTES_KNOWN];
    if (each->note == note) return each;
  }
  return NULL;
}

static event event_of_tuning(const known_note *note, double semitones) {
  return (event){.kind = TUNE, .id = event_id(note->note), .channel = note->channel, .key = note->key, .value = semitones};
}

static void take_event(shell *own, const vst_event *of) {
  if (of->type == VST_NOTE_ON || of->type == VST_NOTE_OFF) {
    bool on = of->type == VST_NOTE_ON && of->on.velocity > 0;
    known_note note = {of->on.note, of->on.channel < 0 ? 0 : of->on.channel, of->on.key};
    if (!on) {
      event off = {.kind = note.key < 0 ? CONTROLLER : NOTE_OFF, .channel = note.channel, .key = note.key < 0 ? 123 : note.key};
      add_event(own, of->frame, off, MOST_EVENTS);
      return;
    }
    double velocity = 127.0 * of->on.velocity; /* in single precision: what is a step of MIDI stays one */
    if (fabs(velocity - rint(velocity)) < 1e-4) velocity = rint(velocity);
    event struck = {.kind = NOTE_ON, .id = event_id(note.note), .channel = note.channel, .key = note.key, .value = velocity};
    add_event(own, of->frame, struck, MOST_EVENTS);
    own->known[own->known_count++ % MOST_NOTES_KNOWN] = note;
    if (of->on.cents != 0) add_event(own, of->frame, event_of_tuning(&note, of->on.cents / 100), MOST_EVENTS);
  } else if (of->type == VST_NOTE_EXPRESSION) {
    const known_note *note = note_with_id(own, of->expression.note);
    if (!note) return;
    double value = of->expression.value;
    if (of->expression.id == VST_TUNING) add_event(own, of->frame, event_of_tuning(note, 240 * (value - 0.5)), MOST_EVENTS);
    else if (of->expression.id == VST_BRIGHTNESS) add_event(own, of->frame, event_of_brightness(note->channel, value), MOST_EVENTS);
  }
}

static void take_changes(shell *own, vst_changes *changes) {
  int32_t queues = changes ? changes->table->count(changes) : 0;
  for (int32_t each = 0; each < queues; each++) {
    vst_queue *queue = changes->table->queue(changes, each);
    int32_t points = queue ? queue->table->count(queue) : 0;
    for (int32_t point = 0; point < points; point++) {
      int32_t frame;
      double value;
      if (queue->table->point(queue, point, &frame, &value) == VST_OK)
        add_change(own, frame, queue->table->id(queue), value);
    }
  }
}

/* Parameters that a macro has moved go to the host. */
static void send_moved(shell *own, vst_changes *changes) {
  own->own.moved = false;
  for (int32_t place = 0; place < own->own.of->parameter_count; place++) {
    const parameter *each = &parameters_of(own->own.of)[place];
    double value = from_plain(each, own->own.values[place]);
    if (fabs(value - own->shown[place]) < 1e-12) continue;
    own->shown[place] = value;
    int32_t index;
    vst_queue *queue = changes ? changes->table->add(changes, &each->id, &index) : NULL;
    if (queue) queue->table->add(queue, 0, value, &index);
  }
}

static int32_t process(void *interface, vst_process *data) {
  shell *own = shell_of(interface);
  if (!own->own.mixer) return VST_FALSE;
  own->event_count = own->event_next = 0;
  take_changes(own, data->changes);
  int32_t count = data->events ? data->events->table->count(data->events) : 0;
  for (int32_t each = 0; each < count; each++) {
    vst_event event;
    if (data->events->table->event(data->events, each, &event) == VST_OK) take_event(own, &event);
  }
  vst_buffers *output = data->frames > 0 && data->outputs_count > 0 ? data->outputs : NULL;
  bool sounds = output && output->channels > 0 && output->data;
  if (sounds) instrument_play(&own->own, (uint32_t)data->frames, output->data, (uint32_t)output->channels, next_event, own);
  else instrument_play(&own->own, 0, NULL, 0, next_event, own);
  if (sounds) output->silence = 0;
  if (own->own.moved) send_moved(own, data->changes_out);
  return VST_OK;
}

static const void *const processor[] = {query, add_reference, release, set_arrangements, arrangement, can_sample_size, latency, setup,
                                        set_processing, process, tail};

/* Controller */

static int32_t no_state(void *, vst_stream *) { return VST_OK; }

static int32_t parameter_count(void *interface) {
  return (int32_t)shell_of(interface)->own.of->parameter_count + CONTROLLER_COUNT;
}

static int32_t parameter_info(void *interface, int32_t index, vst_parameter *info) {
  const image *of = shell_of(interface)->own.of;
  if (index < 0 || index >= parameter_count(interface)) return VST_BAD_ARGUMENT;
  memset(info, 0, sizeof *info);
  if (index >= of->parameter_count) {
    int32_t place = index - (int32_t)of->parameter_count, number = CONTROLLERS[place % A_CHANNEL];
    char name[64];
    snprintf(name, sizeof name, "MIDI channel %02d controller %03d", place / A_CHANNEL + 1, number);
    info->id = FIRST_CONTROLLER + (uint32_t)place;
    info->standard = standard_of((int16_t)number);
    info->flags = VST_CAN_AUTOMATE | VST_HIDDEN;
    write_text(info->title, 128, name);
    return VST_OK;
  }
  const parameter *own = &parameters_of(of)[index];
  info->id = own->id;
  info->steps = own->steps ? own->steps - 1 : 0;
  info->standard = from_plain(own, own->standard);
  info->flags = VST_CAN_AUTOMATE | (own->steps ? VST_LIST : 0);
  write_text(info->title, 128, own->name);
  write_text(info->short_title, 128, own->name);
  write_text(info->units, 128, own->unit);
  return VST_OK;
}

static int32_t text_of(void *interface, uint32_t id, double value, vst_text text) {
  const parameter *of = parameter_of(shell_of(interface)->own.of, id);
  char found[128];
  if (!of) return VST_FALSE;
  parameter_text(of, to_plain(of, value), found, sizeof found);
  write_text(text, 128, found);
  return VST_OK;
}

static int32_t value_of(void *interface, uint32_t id, uint16_t *text, double *value) {
  const parameter *of = parameter_of(shell_of(interface)->own.of, id);
  char given[128];
  if (!of) return VST_FALSE;
  read_text(given, sizeof given, text);
  if (!parameter_number(of, given, value)) return VST_FALSE;
  *value = from_plain(of, *value);
  return VST_OK;
}

static double plain_of(void *interface, uint32_t id, double value) {
  const parameter *of = parameter_of(shell_of(interface)->own.of, id);
  return of ? to_plain(of, value) : value;
}

static double normal_of(void *interface, uint32_t id, double plain) {
  const parameter *of = parameter_of(shell_of(interface)->own.of, id);
  return of ? from_plain(of, plain) : plain;
}

static double shown(void *interface, uint32_t id) {
  const shell *own = shell_of(interface);
  int32_t place = shown_place(own, id);
  return place < 0 ? 0 : own->shown[place];
}

/* What the host shows. Its processor learns of it by `process`, or here while it is not active. */
static int32_t set_shown(void *interface, uint32_t id, double value) {
  shell *own = shell_of(interface);
  int32_t place = shown_place(own, id);
  if (!isfinite(value)) return VST_BAD_ARGUMENT;
  if (place < 0) return VST_FALSE;
  value = own->shown[place] = fmin(fmax(value, 0), 1);
  if (place < MOST_PARAMETERS && !own->own.mixer) instrument_set(&own->own, place, to_plain(&parameters_of(own->own.of)[place], value));
  return VST_OK;
}

static int32_t set_handler(void *, void *) { return VST_OK; }

static void *create_view(void *, const char *) { return NULL; }

static const void *const controller[] = {query, add_reference, release, initialize, terminate, set_state, no_state, no_state,
                                         parameter_count, parameter_info, text_of, value_of, plain_of, normal_of, shown, set_shown, set_handler,
                                         create_view};

static int32_t assignment(void *, int32_t bus, int16_t channel, int16_t number, uint32_t *id) {
  if (bus || channel < 0 || channel >= MIDI_CHANNELS) return VST_FALSE;
  for (int32_t place = 0; place < A_CHANNEL; place++) {
    if (CONTROLLERS[place] != number) continue;
    *id = FIRST_CONTROLLER + (uint32_t)(channel * A_CHANNEL + place);
    return VST_OK;
  }
  return VST_FALSE;
}

static const void *const midi_mapping[] = {query, add_reference, release, assignment};

static const struct { uint32_t id; const char *title, *units; double standard; int32_t flags; } EXPRESSED[] = {
    {VST_TUNING, "Tuning", "semitones", 0.5, VST_BIPOLAR}, {VST_BRIGHTNESS, "Brightness", "", 0, VST_ABSOLUTE}};

static int32_t expression_count(void *, int32_t bus, int16_t) { return bus ? 0 : 2; }

static int32_t expression_info(void *, int32_t bus, int16_t, int32_t index, vst_expression *info) {
  if (bus || index < 0 || index > 1) return VST_BAD_ARGUMENT;
  memset(info, 0, sizeof *info);
  info->id = EXPRESSED[index].id;
  write_text(info->title, 128, EXPRESSED[index].title);
  write_text(info->short_title, 128, EXPRESSED[index].title);
  write_text(info->units, 128, EXPRESSED[index].units);
  info->range = (vst_range){EXPRESSED[index].standard, 0, 1, 0};
  info->parameter = UINT32_MAX;
  info->flags = EXPRESSED[index].flags;
  return VST_OK;
}

static int32_t expression_text(void *, int32_t, int16_t, uint32_t, double, vst_text) { return VST_MISSING; }

static int32_t expression_value(void *, int32_t, int16_t, uint32_t, const uint16_t *, double *) {
  return VST_MISSING;
}

static const void *const expressions[] = {query, add_reference, release, expression_count, expression_info, expression_text, expression_value};

static uint32_t requirements(void *) { return 0; } /* neither tempo nor position */

static const void *const required[] = {query, add_reference, release, requirements};

static const struct { const vst_uid *id; const void *table; } INTERFACES[FACES] = {
    {&UID_COMPONENT, component},       {&UID_PROCESSOR, processor},     {&UID_CONTROLLER, controller},
    {&UID_MIDI_MAPPING, midi_mapping}, {&UID_EXPRESSIONS, expressions}, {&UID_REQUIREMENTS, required}};

static int32_t query(void *interface, const vst_uid id, void **found) {
  bool any = same(id, UID_UNKNOWN) || same(id, UID_BASE);
  int32_t place = 0;
  while (!any && place < FACES && !same(id, *INTERFACES[place].id)) place++;
  *found = place < FACES ? &shell_of(interface)->faces[place] : NULL;
  if (*found) add_reference(interface);
  return *found ? VST_OK : VST_NO_INTERFACE;
}

/* Factory */

/* The same identifier is written the same on all systems, and lies in memory as each has it. */
static void class_id(const image *of, vst_uid id) {
  memcpy(id, of->uid, sizeof(vst_uid));
#ifdef _WIN32
  static const uint8_t from[] = {3, 2, 1, 0, 5, 4, 7, 6};
  for (int32_t place = 0; place < 8; place++) id[place] = of->uid[from[place]];
#endif
}

static int32_t factory_query(void *interface, const vst_uid id, void **found) {
  bool known = same(id, UID_UNKNOWN) || same(id, UID_FACTORY) || same(id, UID_FACTORY2) || same(id, UID_FACTORY3);
  *found = known ? interface : NULL;
  return known ? VST_OK : VST_NO_INTERFACE;
}

static uint32_t one_reference(void *) { return 1; }

static int32_t factory_info(void *, vst_factory_info *info) {
  memset(info, 0, sizeof *info);
  strncpy(info->vendor, images[0]->maker, sizeof info->vendor - 1);
  info->flags = VST_FACTORY_UNICODE;
  return VST_OK;
}

static int32_t class_count(void *) { return image_count; }

static int32_t class_info2(void *, int32_t index, vst_class2 *info) {
  if (index < 0 || index >= image_count) return VST_BAD_ARGUMENT;
  const image *of = images[index];
  *info = (vst_class2){.first.cardinality = VST_MANY_INSTANCES, .first.category = "Audio Module Class", .subcategories = "Instrument|Synth",
                       .version = LS_VERSION, .sdk = "VST 3.7"};
  class_id(of, info->first.id);
  memcpy(info->first.name, of->name, sizeof info->first.name);
  memcpy(info->vendor, of->maker, sizeof info->vendor);
  return VST_OK;
}

static int32_t class_info(void *interface, int32_t index, vst_class *info) {
  vst_class2 whole;
  int32_t result = class_info2(interface, index, &whole);
  if (result == VST_OK) *info = whole.first;
  return result;
}

static int32_t class_info3(void *interface, int32_t index, vst_class3 *info) {
  vst_class2 whole;
  int32_t result = class_info2(interface, index, &whole);
  if (result != VST_OK) return result;
  memset(info, 0, sizeof *info);
  memcpy(info, &whole, offsetof(vst_class, name));
  memcpy(info->subcategories, whole.subcategories, sizeof whole.subcategories);
  write_text(info->name, 64, whole.first.name);
  write_text(info->vendor, 64, whole.vendor);
  write_text(info->version, 64, whole.version);
  write_text(info->sdk, 64, whole.sdk);
  return VST_OK;
}

static int32_t create(void *, const char *id, const char *wanted, void **found) {
  *found = NULL;
  for (int32_t each = 0; each < image_count; each++) {
    vst_uid own_id;
    class_id(images[each], own_id);
    if (!same(id, own_id)) continue;
    shell *own = calloc(1, sizeof *own);
    if (!own) return VST_FALSE;
    own->own.of = images[each];
    instrument_reset_values(&own->own);
    own->rate_hz = 48000;
    own->references = 1;
    for (int32_t place = 0; place < FACES; place++) own->faces[place] = (face){INTERFACES[place].table, own};
    for (int32_t place = 0; place < CONTROLLER_COUNT; place++) own->shown[MOST_PARAMETERS + place] = standard_of(CONTROLLERS[place % A_CHANNEL]);
    show(own);
    int32_t result = query(own->faces, (const uint8_t *)wanted, found);
    release(own->faces); /* the host's reference keeps it */
    return result;
  }
  return VST_NO_INTERFACE;
}

static int32_t set_context(void *, void *) { return VST_OK; }

static const void *const factory_table[] = {factory_query, one_reference, one_reference, factory_info, class_count, class_info, create, class_info2,
                                            class_info3, set_context};
static const void *const *const factory = factory_table;

LS_EXPORT const void *GetPluginFactory(void) { return &factory; }

#if defined(_WIN32)
LS_EXPORT bool InitDll(void) { return true; }
LS_EXPORT bool ExitDll(void) { return true; }
#elif defined(__APPLE__)
LS_EXPORT bool bundleEntry(void *bundle) { return bundle != NULL; }
LS_EXPORT bool bundleExit(void) { return true; }
#else
LS_EXPORT bool ModuleEntry(void *library) { return library != NULL; }
LS_EXPORT bool ModuleExit(void) { return true; }
#endif
