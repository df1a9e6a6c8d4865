/* The instrument as a CLAP plug-in. */

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "clap_abi.h"
#include "instrument.h"
#include "layout.h"

extern const image *const images[];
extern const int32_t image_count;

typedef struct {
  clap_plugin plugin;
  const clap_host *host;
  instrument own;
  bool active;
  atomic_bool loaded; /* a state or preset that the next block takes up */
} shell;

static shell *shell_of(const clap_plugin *plugin) { return plugin->data; }

static const void *host_extension(const clap_host *host, const char *id) {
  return host && host->get_extension ? host->get_extension(host, id) : NULL;
}

/* Ports */

static uint32_t audio_count(const clap_plugin *, bool is_input) { return is_input ? 0 : 1; }

static bool audio_get(const clap_plugin *, uint32_t index, bool is_input, clap_audio_port *port) {
  if (is_input || index) return false;
  memset(port, 0, sizeof *port);
  snprintf(port->name, sizeof port->name, "Output");
  port->flags = CLAP_PORT_IS_MAIN;
  port->channels = 2;
  port->type = "stereo";
  port->in_place = UINT32_MAX;
  return true;
}

static uint32_t note_count(const clap_plugin *, bool is_input) { return is_input ? 1 : 0; }

static bool note_get(const clap_plugin *, uint32_t index, bool is_input, clap_note_port *port) {
  if (!is_input || index) return false;
  memset(port, 0, sizeof *port);
  snprintf(port->name, sizeof port->name, "Notes");
  port->dialects = CLAP_DIALECT_CLAP | CLAP_DIALECT_MIDI | CLAP_DIALECT_MPE;
  port->preferred = CLAP_DIALECT_CLAP;
  return true;
}

static const clap_audio_ports audio_ports = {audio_count, audio_get};
static const clap_note_ports note_ports = {note_count, note_get};

/* Parameters */

static uint32_t param_count(const clap_plugin *plugin) { return (uint32_t)shell_of(plugin)->own.of->parameter_count; }

static bool param_info(const clap_plugin *plugin, uint32_t index, clap_param *info) {
  const image *of = shell_of(plugin)->own.of;
  if (index >= (uint32_t)of->parameter_count) return false;
  const parameter *own = &parameters_of(of)[index];
  memset(info, 0, sizeof *info);
  info->id = own->id;
  info->flags = CLAP_PARAM_AUTOMATABLE | (own->steps ? CLAP_PARAM_STEPPED | CLAP_PARAM_ENUM : 0);
  snprintf(info->name, sizeof info->name, "%s", own->name);
  snprintf(info->module, sizeof info->module, "%s", own->module);
  info->low = own->low;
  info->high = own->high;
  info->standard = own->standard;
  return true;
}

static bool param_value(const clap_plugin *plugin, uint32_t id, double *value) {
  const instrument *own = &shell_of(plugin)->own;
  int32_t place = parameter_with_id(own->of, id);
  if (place < 0) return false;
  *value = own->values[place];
  return true;
}

/* The word of a step and its length. */
static const char *word_of(const parameter *own, int32_t step, int *length) {
  const char *word = own->words;
  for (; step > 0; step--) word += strcspn(word, " ") + 1;
  *length = (int)strcspn(word, " ");
  return word;
}

static bool param_to_text(const clap_plugin *plugin, uint32_t id, double value, char *text, uint32_t room) {
  const image *of = shell_of(plugin)->own.of;
  int32_t place = parameter_with_id(of, id);
  if (place < 0) return false;
  const parameter *own = &parameters_of(of)[place];
  if (own->steps) {
    int length, step = (int)fmin(fmax(value - own->low + 0.5, 0), own->steps - 1);
    const char *word = word_of(own, step, &length);
    snprintf(text, room, "%.*s", length, word);
  } else {
    double least = 1e-5 * (own->high - own->low);  // single precision of a host's own range, which is no value
    snprintf(text, room, "%.4g%s%s", fabs(value) < least ? 0.0 : value, own->unit[0] ? " " : "", own->unit);
  }
  return true;
}

static bool param_from_text(const clap_plugin *plugin, uint32_t id, const char *text, double *value) {
  const image *of = shell_of(plugin)->own.of;
  int32_t place = parameter_with_id(of, id);
  if (place < 0) return false;
  const parameter *own = &parameters_of(of)[place];
  for (int32_t step = 0; step < own->steps; step++) {
    int length;
    const char *word = word_of(own, step, &length);
    if (strlen(text) == (size_t)length && !strncmp(text, word, (size_t)length)) return *value = own->low + step, true;
  }
  char *end;
  double found = strtod(text, &end);
  if (end == text || isnan(found)) return false;
  *value = fmin(fmax(found, own->low), own->high);
  return true;
}

/* `at`: the frame of what is rendered next, at which the event counts. */
static void take_event(shell *own, const clap_event *event, uint32_t at) {
  instrument *to = &own->own;
  if (event->space) return;
  if (event->type == CLAP_PARAM_VALUE) {
    const clap_event_param *each = (const clap_event_param *)event;
    int32_t place = parameter_with_id(to->of, each->param);
    if (place < 0) return;
    if (own->active) instrument_change(to, at, place, each->value);
    else instrument_set(to, place, each->value);
    return;
  }
  if (!own->active) return;
  if (event->type == CLAP_NOTE_ON) {
    const clap_event_note *note = (const clap_event_note *)event;
    instrument_note_on(to, at, note->note_id >= 0 ? note->note_id + 1 : 0, note->channel < 0 ? 0 : note->channel, note->key,
                       127 * note->velocity);
  } else if (event->type == CLAP_NOTE_OFF) {
    const clap_event_note *note = (const clap_event_note *)event;
    int32_t channel = note->channel < 0 ? 0 : note->channel;
    if (note->key >= 0) instrument_note_off(to, at, channel, note->key);
    else instrument_controller(to, at, channel, 123, 0);
  } else if (event->type == CLAP_NOTE_CHOKE) {
    const clap_event_note *note = (const clap_event_note *)event;
    instrument_choke(to, at, note->note_id >= 0 ? note->note_id + 1 : 0, note->channel, note->key);
  } else if (event->type == CLAP_NOTE_EXPRESSION) {
    const clap_event_expression *each = (const clap_event_expression *)event;
    if (!isfinite(each->value)) return;
    if (each->id == CLAP_EXPRESSION_TUNING)
      instrument_tune(to, at, each->note_id >= 0 ? each->note_id + 1 : 0, each->channel, each->key, each->value);
    else if (each->id == CLAP_EXPRESSION_BRIGHTNESS)
      instrument_controller(to, at, each->channel < 0 ? 0 : each->channel, 74, (int32_t)(0.5 + 127 * (each->value > 0 ? each->value < 1 ? each->value : 1 : 0)));
  } else if (event->type == CLAP_MIDI) {
    instrument_midi(to, at, ((const clap_event_midi *)event)->data);
  }
}

static void param_flush(const clap_plugin *plugin, const clap_in_events *in, const clap_out_events *) {
  for (uint32_t place = 0; in && place < in->size(in); place++) take_event(shell_of(plugin), in->get(in, place), 0);
}

static const clap_params params = {param_count, param_info, param_value, param_to_text, param_from_text, param_flush};

/* State, preset, latency, tail */

static bool state_save(const clap_plugin *plugin, const clap_ostream *stream) {
  uint8_t bytes[8 + 12 * MOST_PARAMETERS];
  const instrument *own = &shell_of(plugin)->own;
  int64_t size = state_write(own->of, own->values, bytes, sizeof bytes), done = 0;
  while (done < size) {
    int64_t count = stream->write(stream, bytes + done, (uint64_t)(size - done));
    if (count <= 0) return false;
    done += count;
  }
  return size > 0;
}

static bool state_load(const clap_plugin *plugin, const clap_istream *stream) {
  uint8_t bytes[MOST_STATE_BYTES];
  int64_t size = 0, count;
  while (size < (int64_t)sizeof bytes && (count = stream->read(stream, bytes + size, sizeof bytes - (uint64_t)size)) > 0) size += count;
  shell *own = shell_of(plugin);
  if (!instrument_load(&own->own, bytes, size)) return false;
  own->loaded = true;
  return true;
}

static uint32_t latency_get(const clap_plugin *) { return instrument_latency(); }

static uint32_t tail_get(const clap_plugin *plugin) { return instrument_tail(&shell_of(plugin)->own); }

static bool no_requirement(const clap_plugin *) { return false; }

static bool set_mode(const clap_plugin *plugin, int32_t mode) {
  shell_of(plugin)->own.effects.offline = mode == CLAP_RENDER_OFFLINE;
  return true;
}

static void on_main_thread(const clap_plugin *plugin) {
  const clap_host *host = shell_of(plugin)->host;
  const clap_host_params *found = host_extension(host, "clap.params");
  if (found && found->rescan) found->rescan(host, CLAP_RESCAN_VALUES);
}

/* The one preset of a plug-in is its instrument as it was saved; its key is the plug-in's identifier. */
static bool preset_load(const clap_plugin *plugin, uint32_t kind, const char *location, const char *key) {
  shell *own = shell_of(plugin);
  const clap_host_preset_load *found = host_extension(own->host, "clap.preset-load/2");
  if (kind != CLAP_PRESET_IN_PLUGIN || !key || strcmp(key, own->own.of->id)) {
    if (found && found->on_error) found->on_error(own->host, kind, location, key, 0, "the preset belongs to another instrument");
    return false;
  }
  instrument_reset_values(&own->own);
  own->loaded = true;
  on_main_thread(plugin);
  if (found && found->loaded) found->loaded(own->host, kind, location, key);
  return true;
}

static const clap_state state = {state_save, state_load};
static const clap_preset_load presets = {preset_load};
static const clap_latency latency = {latency_get};
static const clap_tail tail = {tail_get};
static const clap_render render = {no_requirement, set_mode};

/* The plug-in */

static bool shell_init(const clap_plugin *) { return true; }

static void shell_deactivate(const clap_plugin *plugin) {
  shell *own = shell_of(plugin);
  instrument_end(&own->own);
  own->active = false;
}

static bool shell_activate(const clap_plugin *plugin, double rate_hz, uint32_t, uint32_t most) {
  shell *own = shell_of(plugin);
  shell_deactivate(plugin);
  own->active = most >= 1 && most <= INT32_MAX && instrument_begin(&own->own, rate_hz);
  own->loaded = false;
  return own->active;
}

static void shell_destroy(const clap_plugin *plugin) {
  shell_deactivate(plugin);
  instrument_free(&shell_of(plugin)->own);
  free(shell_of(plugin));
}

static bool start_processing(const clap_plugin *plugin) { return shell_of(plugin)->active; }

static void stop_processing(const clap_plugin *plugin) { (void)plugin; }

static void shell_reset(const clap_plugin *plugin) {
  shell *own = shell_of(plugin);
  if (!own->active) return;
  own->loaded = false; /* all values are taken up */
  instrument_reset(&own->own);
}

typedef struct { const clap_out_events *out; uint32_t last; } ends;

static void push_end(void *context, int64_t id, int32_t channel, int32_t key, uint32_t) {
  const ends *to = context;
  clap_event_note note = {{sizeof note, to->last, 0, CLAP_NOTE_END, 0}, (int32_t)(id - 1), 0, (int16_t)channel, (int16_t)key, 0};
  if (to->out) to->out->try_push(to->out, &note.header);
}

static int32_t shell_process(const clap_plugin *plugin, const clap_process *process) {
  shell *own = shell_of(plugin);
  if (!own->active || !process->outputs_count || !process->outputs[0].data32) return CLAP_ERROR;
  if (own->loaded) {
    own->loaded = false;
    for (int32_t place = 0; place < own->own.of->parameter_count; place++)
      instrument_follow(&own->own, place);
  }
  clap_audio *output = &process->outputs[0];
  float *left = output->data32[0], *right = output->channels > 1 ? output->data32[1] : NULL;
  const clap_in_events *in = process->in_events;
  uint32_t count = in ? in->size(in) : 0, next = 0;
  for (uint32_t done = 0; done < process->frames;) {
    uint32_t end = done + QUANTUM < process->frames ? done + QUANTUM : process->frames;
    for (; next < count; next++) {
      const clap_event *event = in->get(in, next);
      if (event->time >= end) break;
      take_event(own, event, event->time < done ? 0 : event->time - done);
    }
    instrument_render(&own->own, end - done, left + done, right ? right + done : NULL);
    done = end;
  }
  for (uint32_t channel = 2; channel < output->channels; channel++)
    memset(output->data32[channel], 0, process->frames * sizeof(float));
  output->constant_mask = 0;
  ends to = {process->out_events, process->frames ? process->frames - 1 : 0};
  instrument_report_ends(&own->own, push_end, &to);
  if (own->own.moved && own->host && own->host->request_callback) {
    own->own.moved = false;
    own->host->request_callback(own->host);
  }
  return instrument_silent(&own->own) ? CLAP_SLEEP : CLAP_CONTINUE;
}

static const void *shell_extension(const clap_plugin *, const char *id) {
  static const struct { const char *id; const void *extension; } all[] = {
      {"clap.audio-ports", &audio_ports}, {"clap.note-ports", &note_ports}, {"clap.params", &params}, {"clap.state", &state},
      {"clap.latency", &latency},         {"clap.tail", &tail},             {"clap.render", &render},
      {"clap.preset-load/2", &presets},
  };
  for (size_t place = 0; place < sizeof all / sizeof *all; place++)
    if (!strcmp(id, all[place].id)) return all[place].extension;
  return NULL;
}

/* The factory */

enum { MOST_IMAGES = 128, MOST_FEATURES = 8 };
static clap_descriptor descriptors[MOST_IMAGES];
static char feature_words[MOST_IMAGES][128];
static const char *features[MOST_IMAGES][MOST_FEATURES + 1];
static char provider_id[160];
static const clap_preset_descriptor provider_descriptor = {CLAP_VERSION_USED, provider_id, "Instruments", "Learned Strings"};

static bool entry_init(const char *) {
  if (image_count == 1) snprintf(provider_id, sizeof provider_id, "%s.presets", images[0]->id);
  else strcpy(provider_id, "org.learned-strings.bank.presets"); /* whole, so that it is not read as an instrument's */
  for (int32_t each = 0; each < image_count; each++) {
    const image *of = images[each];
    memcpy(feature_words[each], of->features, sizeof of->features);
    int32_t count = 0;
    for (char *word = strtok(feature_words[each], " "); word && count < MOST_FEATURES; word = strtok(NULL, " "))
      features[each][count++] = word;
    features[each][count] = NULL;
    descriptors[each] = (clap_descriptor){CLAP_VERSION_USED, of->id, of->name, of->maker, "", "", "", LS_VERSION, of->description, features[each]};
  }
  return true;
}

static void entry_deinit(void) {}

static uint32_t factory_count(const clap_factory *) { return (uint32_t)image_count; }

static const clap_descriptor *factory_descriptor(const clap_factory *, uint32_t index) {
  return index < (uint32_t)image_count ? &descriptors[index] : NULL;
}

static const clap_plugin *factory_create(const clap_factory *, const clap_host *host, const char *id) {
  for (int32_t each = 0; each < image_count; each++) {
    if (strcmp(id, images[each]->id)) continue;
    shell *own = calloc(1, sizeof *own);
    if (!own) return NULL;
    own->host = host;
    own->own.of = images[each];
    instrument_reset_values(&own->own);
    own->plugin = (clap_plugin){&descriptors[each], own, shell_init, shell_destroy, shell_activate, shell_deactivate,
                                start_processing, stop_processing, shell_reset, shell_process, shell_extension, on_main_thread};
    return &own->plugin;
  }
  return NULL;
}

static const clap_factory factory = {factory_count, factory_descriptor, factory_create};

/* Discovery of presets: one of each instrument, for the host's browser */

static bool provider_init(const clap_preset_provider *provider) {
  const clap_preset_indexer *to = provider->data;
  const clap_preset_location inside = {CLAP_PRESET_IS_FACTORY, provider_descriptor.name, CLAP_PRESET_IN_PLUGIN, NULL};
  return to->declare_location && to->declare_location(to, &inside);
}

static void provider_destroy(const clap_preset_provider *provider) { free((void *)provider); }

static bool provider_metadata(const clap_preset_provider *, uint32_t kind, const char *, const clap_preset_receiver *to) {
  if (!to || !to->begin_preset || kind != CLAP_PRESET_IN_PLUGIN) return false;
  for (int32_t each = 0; each < image_count; each++) {
    const image *of = images[each];
    if (!to->begin_preset(to, of->name, of->id)) return true; /* the host has enough */
    if (to->add_plugin_id) to->add_plugin_id(to, &(clap_universal_id){"clap", of->id});
    if (to->set_flags) to->set_flags(to, CLAP_PRESET_IS_FACTORY);
    if (to->add_creator) to->add_creator(to, of->maker);
    if (to->set_description) to->set_description(to, of->description);
    for (const char **feature = features[each]; to->add_feature && *feature; feature++) to->add_feature(to, *feature);
    if (to->add_feature) to->add_feature(to, of->category);
  }
  return true;
}

static const void *provider_extension(const clap_preset_provider *, const char *) { return NULL; }

static uint32_t provider_count(const clap_preset_factory *) { return 1; }

static const clap_preset_descriptor *provider_at(const clap_preset_factory *, uint32_t index) {
  return index ? NULL : &provider_descriptor;
}

static const clap_preset_provider *provider_create(const clap_preset_factory *, const clap_preset_indexer *indexer, const char *id) {
  clap_preset_provider *own = indexer && id && !strcmp(id, provider_id) ? malloc(sizeof *own) : NULL;
  if (own)
    *own = (clap_preset_provider){&provider_descriptor, (void *)indexer, provider_init, provider_destroy, provider_metadata, provider_extension};
  return own;
}

static const clap_preset_factory preset_factory = {provider_count, provider_at, provider_create};

static const void *get_factory(const char *id) {
  if (!strcmp(id, "clap.plugin-factory")) return &factory;
  return strcmp(id, "clap.preset-discovery-factory/2") ? NULL : &preset_factory;
}

LS_EXPORT const clap_entry_t clap_entry = {CLAP_VERSION_USED, entry_init, entry_deinit, get_factory};
