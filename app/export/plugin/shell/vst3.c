/* The instrument as a VST3 plug-in: one object that is component and controller, around the CLAP plug-in of clap.c. */

#include "vst3_abi.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "instrument.h"
#include "layout.h"

extern const clap_entry_t clap_entry;
extern const image *const images[];
extern const int32_t image_count;

enum { FACE_COMPONENT, FACE_PROCESSOR, FACE_CONTROLLER, FACE_MIDI_MAPPING, FACE_EXPRESSIONS, FACE_REQUIREMENTS, FACES };
enum { MOST_EVENTS = 1024, MOST_CHANGED = 768, MOST_NOTES_KNOWN = 256 };

/* Controllers that messages of a host reach by hidden parameters, for each channel of MIDI. */
static const int16_t CONTROLLERS[] = {1, 6, 7, 11, 38, 64, 74, 96, 97, 98, 99, 100, 101, 120, 121, 123, VST_PITCH_BEND};
enum { CONTROLLER_COUNT = sizeof CONTROLLERS / sizeof *CONTROLLERS, MIDI_CHANNELS = 16 };
static const uint32_t FIRST_CONTROLLER = 0x7FFF0000;

static double standard_of(int16_t number) {
  return number == VST_PITCH_BEND ? 0.5 : number == 7 ? 100.0 / 127 : number == 11 ? 1 : 0; /* as a channel begins */
}

typedef struct shell shell;
typedef struct { const void *table; shell *own; } face; /* what a host holds of one interface */
typedef union { clap_event header; clap_event_note note; clap_event_expression expression; clap_event_param param; clap_event_midi midi; } any_event;
typedef struct { int32_t note; int16_t channel, key; } known_note;

struct shell {
  face faces[FACES];
  atomic_uint references;
  const image *of;
  clap_host host;
  const clap_plugin *plugin;
  const clap_params *params;
  const clap_state *state;
  double rate_hz;
  int32_t most_frames;
  bool active, moved;
  double shown[MOST_PARAMETERS], controllers[MIDI_CHANNELS][CONTROLLER_COUNT]; /* normalised */
  known_note known[MOST_NOTES_KNOWN];
  uint32_t known_count;
  any_event events[MOST_EVENTS];
  uint32_t order[MOST_EVENTS], event_count;
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
    own->plugin->destroy(own->plugin);
    free(own);
  }
  return left;
}

static int32_t initialize(void *, void *) { return VST_OK; }

static void deactivate(shell *own) {
  if (own->active) own->plugin->deactivate(own->plugin);
  own->active = false;
}

static int32_t terminate(void *interface) {
  deactivate(shell_of(interface));
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
  for (int32_t place = 0; place < own->of->parameter_count; place++) {
    const parameter *each = &parameters_of(own->of)[place];
    double value;
    if (own->params->value(own->plugin, each->id, &value)) own->shown[place] = from_plain(each, value);
  }
}

static double *controller_with_id(shell *own, uint32_t id, int32_t *channel, int32_t *number) {
  uint32_t place = id - FIRST_CONTROLLER;
  if (id < FIRST_CONTROLLER || place >= MIDI_CHANNELS * CONTROLLER_COUNT) return NULL;
  *channel = (int32_t)(place / CONTROLLER_COUNT);
  *number = (int32_t)(place % CONTROLLER_COUNT);
  return &own->controllers[*channel][*number];
}

static any_event *add_event(shell *own, uint32_t frame, uint16_t type, uint32_t size, uint32_t most) {
  if (own->event_count >= most) return NULL;
  uint32_t place = own->event_count++, before = place;
  any_event *event = &own->events[place];
  memset(event, 0, sizeof *event);
  event->header = (clap_event){size, frame, 0, type, 0};
  for (; before && own->events[own->order[before - 1]].header.time > frame; before--) own->order[before] = own->order[before - 1];
  own->order[before] = place;
  return event;
}

static void add_midi(shell *own, uint32_t frame, uint8_t status, int32_t one, int32_t two) {
  any_event *event = add_event(own, frame, CLAP_MIDI, sizeof event->midi, MOST_EVENTS);
  if (!event) return;
  event->midi.data[0] = status;
  event->midi.data[1] = (uint8_t)(one & 127);
  event->midi.data[2] = (uint8_t)(two & 127);
}

static void add_change(shell *own, uint32_t frame, uint32_t id, double value) {
  int32_t channel, number, place = parameter_with_id(own->of, id);
  if (!isfinite(value)) return; /* the last one stays */
  value = fmin(fmax(value, 0), 1);
  if (place >= 0) {
    any_event *event = add_event(own, frame, CLAP_PARAM_VALUE, sizeof event->param, MOST_CHANGED);
    if (!event) return;
    event->param.param = id;
    event->param.note_id = event->param.port = event->param.channel = event->param.key = -1;
    event->param.value = to_plain(&parameters_of(own->of)[place], value);
    own->shown[place] = value;
    return;
  }
  double *kept = controller_with_id(own, id, &channel, &number);
  if (!kept) return;
  *kept = value;
  if (CONTROLLERS[number] == VST_PITCH_BEND) {
    int32_t wheel = (int32_t)(16383 * value + 0.5);
    add_midi(own, frame, (uint8_t)(0xE0 | channel), wheel & 127, wheel >> 7);
  } else {
    add_midi(own, frame, (uint8_t)(0xB0 | channel), CONTROLLERS[number], (int32_t)(127 * value + 0.5));
  }
}

static uint32_t events_size(const clap_in_events *list) { return ((shell *)list->context)->event_count; }

static const clap_event *events_get(const clap_in_events *list, uint32_t place) {
  shell *own = list->context;
  return &own->events[own->order[place]].header;
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
  deactivate(own);
  own->known_count = 0;
  if (state) own->active = own->plugin->activate(own->plugin, own->rate_hz, 1, (uint32_t)own->most_frames);
  return own->active == (state != 0) ? VST_OK : VST_FALSE;
}

static int64_t stream_read(const clap_istream *stream, void *bytes, uint64_t size) {
  vst_stream *host = stream->context;
  int32_t done = 0;
  if (host->table->read(host, bytes, (int32_t)size, &done) != VST_OK) return 0;
  return done;
}

static int64_t stream_write(const clap_ostream *stream, const void *bytes, uint64_t size) {
  vst_stream *host = stream->context;
  int32_t done = 0;
  if (host->table->write(host, (void *)bytes, (int32_t)size, &done) != VST_OK) return -1;
  return done;
}

static int32_t set_state(void *interface, vst_stream *stream) {
  shell *own = shell_of(interface);
  if (!stream) return VST_BAD_ARGUMENT;
  clap_istream from = {stream, stream_read};
  if (!own->state->load(own->plugin, &from)) return VST_FALSE;
  show(own);
  return VST_OK;
}

static int32_t get_state(void *interface, vst_stream *stream) {
  shell *own = shell_of(interface);
  if (!stream) return VST_BAD_ARGUMENT;
  clap_ostream to = {stream, stream_write};
  return own->state->save(own->plugin, &to) ? VST_OK : VST_FALSE;
}

static const vst_component component = {query, add_reference, release, initialize, terminate, controller_class, set_io_mode,
                                        bus_count, bus_info, routing, activate_bus, set_active, set_state, get_state};

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
  own->most_frames = wanted->most_frames;
  const clap_render *render = own->plugin->get_extension(own->plugin, "clap.render");
  render->set(own->plugin, wanted->mode == VST_OFFLINE ? CLAP_RENDER_OFFLINE : CLAP_RENDER_REALTIME);
  return VST_OK;
}

static int32_t set_processing(void *interface, uint8_t state) {
  shell *own = shell_of(interface);
  if (!state && own->active) own->plugin->reset(own->plugin);
  return VST_OK;
}

static uint32_t tail(void *interface) {
  shell *own = shell_of(interface);
  const clap_tail *of = own->plugin->get_extension(own->plugin, "clap.tail");
  return own->active ? of->get(own->plugin) : 0;
}

static const known_note *note_with_id(const shell *own, int32_t note) {
  uint32_t count = own->known_count < MOST_NOTES_KNOWN ? own->known_count : MOST_NOTES_KNOWN;
  for (uint32_t back = 1; back <= count; back++) {
    const known_note *each = &own->known[(own->known_count - back) % MOST_NOTES_KNOWN];
    if (each->note == note) return each;
  }
  return NULL;
}

static void add_expression(shell *own, uint32_t frame, int32_t id, int32_t note, int16_t channel, int16_t key, double value) {
  any_event *event = add_event(own, frame, CLAP_NOTE_EXPRESSION, sizeof event->expression, MOST_EVENTS);
  if (!event) return;
  event->expression.id = id;
  event->expression.note_id = note;
  event->expression.channel = channel;
  event->expression.key = key;
  event->expression.value = value;
}

static void take_event(shell *own, const vst_event *of) {
  uint32_t frame = of->frame < 0 ? 0 : (uint32_t)of->frame;
  if (of->type == VST_NOTE_ON || of->type == VST_NOTE_OFF) {
    bool on = of->type == VST_NOTE_ON && of->on.velocity > 0;
    any_event *event = add_event(own, frame, on ? CLAP_NOTE_ON : CLAP_NOTE_OFF, sizeof event->note, MOST_EVENTS);
    if (!event) return;
    event->note.note_id = of->type == VST_NOTE_ON ? of->on.note : of->off.note;
    event->note.channel = of->on.channel;
    event->note.key = of->on.key;
    double velocity = on ? 127.0 * of->on.velocity : 0; /* in single precision: what is a step of MIDI stays one */
    event->note.velocity = (fabs(velocity - rint(velocity)) < 1e-4 ? rint(velocity) : velocity) / 127;
    if (!on) return;
    own->known[own->known_count++ % MOST_NOTES_KNOWN] = (known_note){of->on.note, of->on.channel, of->on.key};
    if (of->on.cents != 0)
      add_expression(own, frame, CLAP_EXPRESSION_TUNING, of->on.note, of->on.channel, of->on.key, of->on.cents / 100);
  } else if (of->type == VST_NOTE_EXPRESSION) {
    const known_note *note = note_with_id(own, of->expression.note);
    if (!note) return;
    double value = of->expression.value;
    if (of->expression.id == VST_TUNING)
      add_expression(own, frame, CLAP_EXPRESSION_TUNING, note->note, note->channel, note->key, 240 * (value - 0.5));
    else if (of->expression.id == VST_BRIGHTNESS)
      add_expression(own, frame, CLAP_EXPRESSION_BRIGHTNESS, note->note, note->channel, note->key, value);
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
        add_change(own, frame < 0 ? 0 : (uint32_t)frame, queue->table->id(queue), value);
    }
  }
}

/* Parameters that a macro has moved go to the host. */
static void send_moved(shell *own, vst_changes *changes) {
  own->moved = false;
  for (int32_t place = 0; place < own->of->parameter_count; place++) {
    const parameter *each = &parameters_of(own->of)[place];
    double value;
    if (!own->params->value(own->plugin, each->id, &value) || fabs(from_plain(each, value) - own->shown[place]) < 1e-12) continue;
    own->shown[place] = from_plain(each, value);
    int32_t index;
    vst_queue *queue = changes ? changes->table->add(changes, &each->id, &index) : NULL;
    if (queue) queue->table->add(queue, 0, own->shown[place], &index);
  }
}

static int32_t process(void *interface, vst_process *data) {
  shell *own = shell_of(interface);
  if (!own->active) return VST_FALSE;
  own->event_count = 0;
  take_changes(own, data->changes);
  int32_t count = data->events ? data->events->table->count(data->events) : 0;
  for (int32_t each = 0; each < count; each++) {
    vst_event event;
    if (data->events->table->event(data->events, each, &event) == VST_OK) take_event(own, &event);
  }
  clap_in_events in = {own, events_size, events_get};
  bool sounds = data->frames > 0 && data->outputs_count > 0 && data->outputs && data->outputs->channels > 0 && data->outputs->data;
  if (!sounds) {
    own->params->flush(own->plugin, &in, NULL);
  } else {
    vst_buffers *output = data->outputs;
    clap_audio audio = {output->data, NULL, (uint32_t)output->channels, 0, 0};
    clap_process block = {-1, (uint32_t)data->frames, NULL, NULL, &audio, 0, 1, &in, NULL};
    if (own->plugin->process(own->plugin, &block) == CLAP_ERROR) return VST_FALSE;
    output->silence = 0;
  }
  if (own->moved) send_moved(own, data->changes_out);
  return VST_OK;
}

static const vst_processor processor = {query, add_reference, release, set_arrangements, arrangement, can_sample_size,
                                        latency, setup, set_processing, process, tail};

/* Controller */

static int32_t set_component_state(void *interface, vst_stream *stream) { return set_state(interface, stream); }

static int32_t no_state(void *, vst_stream *) { return VST_OK; }

static int32_t parameter_count(void *interface) {
  return (int32_t)shell_of(interface)->of->parameter_count + MIDI_CHANNELS * CONTROLLER_COUNT;
}

static int32_t parameter_info(void *interface, int32_t index, vst_parameter *info) {
  const image *of = shell_of(interface)->of;
  if (index < 0 || index >= parameter_count(interface)) return VST_BAD_ARGUMENT;
  memset(info, 0, sizeof *info);
  if (index >= of->parameter_count) {
    int32_t place = index - (int32_t)of->parameter_count, number = CONTROLLERS[place % CONTROLLER_COUNT];
    char name[] = "MIDI channel 00 controller 000";
    int32_t channel = place / CONTROLLER_COUNT + 1;
    name[13] = (char)('0' + channel / 10);
    name[14] = (char)('0' + channel % 10);
    name[27] = (char)('0' + number / 100);
    name[28] = (char)('0' + number / 10 % 10);
    name[29] = (char)('0' + number % 10);
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
  shell *own = shell_of(interface);
  int32_t place = parameter_with_id(own->of, id);
  char found[128];
  if (place < 0) return VST_FALSE;
  if (!own->params->to_text(own->plugin, id, to_plain(&parameters_of(own->of)[place], value), found, sizeof found)) return VST_FALSE;
  write_text(text, 128, found);
  return VST_OK;
}

static int32_t value_of(void *interface, uint32_t id, uint16_t *text, double *value) {
  shell *own = shell_of(interface);
  int32_t place = parameter_with_id(own->of, id);
  char given[128];
  if (place < 0) return VST_FALSE;
  read_text(given, sizeof given, text);
  if (!own->params->from_text(own->plugin, id, given, value)) return VST_FALSE;
  *value = from_plain(&parameters_of(own->of)[place], *value);
  return VST_OK;
}

static double plain_of(void *interface, uint32_t id, double value) {
  const image *of = shell_of(interface)->of;
  int32_t place = parameter_with_id(of, id);
  return place < 0 ? value : to_plain(&parameters_of(of)[place], value);
}

static double normal_of(void *interface, uint32_t id, double plain) {
  const image *of = shell_of(interface)->of;
  int32_t place = parameter_with_id(of, id);
  return place < 0 ? plain : from_plain(&parameters_of(of)[place], plain);
}

static double shown(void *interface, uint32_t id) {
  shell *own = shell_of(interface);
  int32_t channel, number, place = parameter_with_id(own->of, id);
  if (place >= 0) return own->shown[place];
  const double *kept = controller_with_id(own, id, &channel, &number);
  return kept ? *kept : 0;
}

/* What the host shows. Its processor learns of it by `process`, or here while it is not active. */
static int32_t set_shown(void *interface, uint32_t id, double value) {
  shell *own = shell_of(interface);
  int32_t channel, number, place = parameter_with_id(own->of, id);
  if (!isfinite(value)) return VST_BAD_ARGUMENT;
  value = fmin(fmax(value, 0), 1);
  if (place >= 0) {
    own->shown[place] = value;
    if (own->active) return VST_OK;
    own->event_count = 0;
    add_change(own, 0, id, value);
    clap_in_events in = {own, events_size, events_get};
    own->params->flush(own->plugin, &in, NULL);
    own->event_count = 0;
    return VST_OK;
  }
  double *kept = controller_with_id(own, id, &channel, &number);
  if (!kept) return VST_FALSE;
  *kept = value;
  return VST_OK;
}

static int32_t set_handler(void *, void *) { return VST_OK; }

static void *create_view(void *, const char *) { return NULL; }

static const vst_controller controller = {query, add_reference, release, initialize, terminate, set_component_state, no_state, no_state,
                                          parameter_count, parameter_info, text_of, value_of, plain_of, normal_of, shown, set_shown,
                                          set_handler, create_view};

static int32_t assignment(void *, int32_t bus, int16_t channel, int16_t number, uint32_t *id) {
  if (bus || channel < 0 || channel >= MIDI_CHANNELS) return VST_FALSE;
  for (int32_t place = 0; place < CONTROLLER_COUNT; place++) {
    if (CONTROLLERS[place] != number) continue;
    *id = FIRST_CONTROLLER + (uint32_t)(channel * CONTROLLER_COUNT + place);
    return VST_OK;
  }
  return VST_FALSE;
}

static const vst_midi_mapping midi_mapping = {query, add_reference, release, assignment};

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

static const vst_expressions expressions = {query, add_reference, release, expression_count, expression_info, expression_text, expression_value};

static uint32_t requirements(void *) { return 0; } /* neither tempo nor position */

static const vst_requirements required = {query, add_reference, release, requirements};

static int32_t query(void *interface, const vst_uid id, void **found) {
  shell *own = shell_of(interface);
  static const struct { const vst_uid *id; int32_t face; } all[] = {
      {&UID_UNKNOWN, FACE_COMPONENT},   {&UID_BASE, FACE_COMPONENT},           {&UID_COMPONENT, FACE_COMPONENT},     {&UID_PROCESSOR, FACE_PROCESSOR},
      {&UID_CONTROLLER, FACE_CONTROLLER}, {&UID_MIDI_MAPPING, FACE_MIDI_MAPPING}, {&UID_EXPRESSIONS, FACE_EXPRESSIONS}, {&UID_REQUIREMENTS, FACE_REQUIREMENTS}};
  *found = NULL;
  for (size_t place = 0; place < sizeof all / sizeof *all; place++) {
    if (!same(id, *all[place].id)) continue;
    add_reference(interface);
    *found = &own->faces[all[place].face];
    return VST_OK;
  }
  return VST_NO_INTERFACE;
}

/* The CLAP plug-in's host */

static const void *host_extension(const clap_host *, const char *) { return NULL; }

static void host_ignores(const clap_host *host) { (void)host; }

static void host_callback(const clap_host *host) { ((shell *)host->data)->moved = true; }

/* Factory */

static const char SUBCATEGORIES[] = "Instrument|Synth", CATEGORY[] = "Audio Module Class", SDK[] = "VST 3.7";

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
  memset(info, 0, sizeof *info);
  class_id(of, info->id);
  info->cardinality = VST_MANY_INSTANCES;
  memcpy(info->category, CATEGORY, sizeof CATEGORY);
  memcpy(info->name, of->name, sizeof info->name);
  memcpy(info->subcategories, SUBCATEGORIES, sizeof SUBCATEGORIES);
  memcpy(info->vendor, of->maker, sizeof info->vendor);
  memcpy(info->version, LS_VERSION, sizeof LS_VERSION);
  memcpy(info->sdk, SDK, sizeof SDK);
  return VST_OK;
}

static int32_t class_info(void *interface, int32_t index, vst_class *info) {
  vst_class2 whole;
  int32_t result = class_info2(interface, index, &whole);
  if (result == VST_OK) memcpy(info, &whole, sizeof *info);
  return result;
}

static int32_t class_info3(void *interface, int32_t index, vst_class3 *info) {
  vst_class2 whole;
  int32_t result = class_info2(interface, index, &whole);
  if (result != VST_OK) return result;
  memset(info, 0, sizeof *info);
  memcpy(info->id, whole.id, sizeof whole.id);
  info->cardinality = whole.cardinality;
  memcpy(info->category, whole.category, sizeof whole.category);
  memcpy(info->subcategories, whole.subcategories, sizeof whole.subcategories);
  write_text(info->name, 64, whole.name);
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
    own->of = images[each];
    own->host = (clap_host){CLAP_VERSION_USED, own, "VST3", "", "", LS_VERSION, host_extension, host_ignores, host_ignores, host_callback};
    const clap_factory *factory = clap_entry.get_factory("clap.plugin-factory");
    own->plugin = factory->create(factory, &own->host, images[each]->id);
    if (!own->plugin) {
      free(own);
      return VST_FALSE;
    }
    own->params = own->plugin->get_extension(own->plugin, "clap.params");
    own->state = own->plugin->get_extension(own->plugin, "clap.state");
    own->rate_hz = 48000;
    own->most_frames = 4096;
    own->references = 1;
    const void *tables[FACES] = {&component, &processor, &controller, &midi_mapping, &expressions, &required};
    for (int32_t face_number = 0; face_number < FACES; face_number++) own->faces[face_number] = (face){tables[face_number], own};
    for (int32_t channel = 0; channel < MIDI_CHANNELS; channel++)
      for (int32_t number = 0; number < CONTROLLER_COUNT; number++) own->controllers[channel][number] = standard_of(CONTROLLERS[number]);
    show(own);
    int32_t result = query(own->faces, (const uint8_t *)wanted, found);
    release(own->faces); /* the host's reference keeps it */
    return result;
  }
  return VST_NO_INTERFACE;
}

static int32_t set_context(void *, void *) { return VST_OK; }

static const vst_factory factory_table = {factory_query, one_reference, one_reference, factory_info, class_count,
                                          class_info, create, class_info2, class_info3, set_context};
static const struct { const vst_factory *table; } factory = {&factory_table};

LS_EXPORT const void *GetPluginFactory(void) {
  clap_entry.init("");
  return &factory;
}

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
