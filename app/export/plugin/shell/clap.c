/* The instrument as a CLAP plug-in. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "clap_abi.h"
#include "instrument.h"

typedef struct {
  clap_plugin plugin;
  const clap_host *host;
  instrument own;
} shell;

static shell *shell_of(const clap_plugin *plugin) { return plugin->data; }

static instrument *instrument_of(const clap_plugin *plugin) { return &shell_of(plugin)->own; }

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

static const void *const audio_ports[] = {audio_count, audio_get};
static const void *const note_ports[] = {note_count, note_get};

/* Parameters */

static uint32_t param_count(const clap_plugin *plugin) { return (uint32_t)instrument_of(plugin)->of->parameter_count; }

static bool param_info(const clap_plugin *plugin, uint32_t index, clap_param *info) {
  if (index >= param_count(plugin)) return false;
  const parameter *own = &parameters_of(instrument_of(plugin)->of)[index];
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
  const instrument *own = instrument_of(plugin);
  const parameter *of = parameter_of(own->of, id);
  if (of) *value = own->values[of - parameters_of(own->of)];
  return of;
}

static bool param_to_text(const clap_plugin *plugin, uint32_t id, double value, char *text, uint32_t room) {
  const parameter *of = parameter_of(instrument_of(plugin)->of, id);
  if (of) parameter_text(of, value, text, room);
  return of;
}

static bool param_from_text(const clap_plugin *plugin, uint32_t id, const char *text, double *value) {
  const parameter *of = parameter_of(instrument_of(plugin)->of, id);
  return of && parameter_number(of, text, value);
}

/* False: it is none that the instrument knows. */
static bool read_event(const image *of, const clap_event *from, event *to) {
  if (from->space) return false;
  if (from->type == CLAP_PARAM_VALUE) {
    const clap_event_param *each = (const clap_event_param *)from;
    *to = (event){.kind = PARAMETER, .key = parameter_with_id(of, each->param), .value = each->value};
    if (to->key < 0) return false;
  } else if (from->type <= CLAP_NOTE_CHOKE) {
    const clap_event_note *note = (const clap_event_note *)from;
    int64_t id = event_id(note->note_id), channel = note->channel < 0 ? 0 : note->channel;
    if (from->type == CLAP_NOTE_ON) *to = (event){.kind = NOTE_ON, .id = id, .channel = channel, .key = note->key, .value = 127 * note->velocity};
    else if (from->type == CLAP_NOTE_CHOKE) *to = (event){.kind = CHOKE, .id = id, .channel = note->channel, .key = note->key};
    else if (note->key >= 0) *to = (event){.kind = NOTE_OFF, .channel = channel, .key = note->key};
    else *to = (event){.kind = CONTROLLER, .channel = channel, .key = 123};
  } else if (from->type == CLAP_NOTE_EXPRESSION) {
    const clap_event_expression *each = (const clap_event_expression *)from;
    if (each->id == CLAP_EXPRESSION_TUNING)
      *to = (event){.kind = TUNE, .id = event_id(each->note_id), .channel = each->channel, .key = each->key, .value = each->value};
    else if (each->id == CLAP_EXPRESSION_BRIGHTNESS) *to = event_of_brightness(each->channel < 0 ? 0 : each->channel, each->value);
    else return false;
  } else if (from->type != CLAP_MIDI || !event_of_midi(((const clap_event_midi *)from)->data, to)) {
    return false;
  }
  to->frame = from->time;
  return true;
}

typedef struct { const image *of; const clap_in_events *in; uint32_t next; } given;

static bool next_event(void *context, event *to) {
  given *from = context;
  while (from->in && from->next < from->in->size(from->in))
    if (read_event(from->of, from->in->get(from->in, from->next++), to)) return true;
  return false;
}

static void param_flush(const clap_plugin *plugin, const clap_in_events *in, const clap_out_events *) {
  instrument *own = instrument_of(plugin);
  instrument_play(own, 0, NULL, 0, next_event, &(given){own->of, in, 0});
}

static const clap_params params = {param_count, param_info, param_value, param_to_text, param_from_text, param_flush};

/* State, preset, latency, tail */

static bool state_save(const clap_plugin *plugin, const clap_ostream *stream) {
  uint8_t bytes[STATE_BYTES];
  const instrument *own = instrument_of(plugin);
  int64_t size = state_write(own->of, own->values, bytes), done = 0, count;
  for (; done < size; done += count)
    if ((count = stream->write(stream, bytes + done, (uint64_t)(size - done))) <= 0) return false;
  return true;
}

static bool state_load(const clap_plugin *plugin, const clap_istream *stream) {
  uint8_t bytes[MOST_STATE_BYTES];
  int64_t size = 0, count;
  while (size < (int64_t)sizeof bytes && (count = stream->read(stream, bytes + size, sizeof bytes - (uint64_t)size)) > 0) size += count;
  return instrument_load(instrument_of(plugin), bytes, size);
}

static uint32_t latency_get(const clap_plugin *) { return instrument_latency(); }

static uint32_t tail_get(const clap_plugin *plugin) { return instrument_tail(instrument_of(plugin)); }

static bool no_requirement(const clap_plugin *) { return false; }

static bool set_mode(const clap_plugin *plugin, int32_t mode) {
  instrument_of(plugin)->effects.offline = mode == CLAP_RENDER_OFFLINE;
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
  own->own.loaded = true;
  on_main_thread(plugin);
  if (found && found->loaded) found->loaded(own->host, kind, location, key);
  return true;
}

static const clap_state state = {state_save, state_load};
static const void *const presets[] = {preset_load};
static const void *const latency[] = {latency_get};
static const void *const tail[] = {tail_get};
static const void *const render[] = {no_requirement, set_mode};

/* The plug-in */

static bool shell_init(const clap_plugin *) { return true; }

static void shell_deactivate(const clap_plugin *plugin) { instrument_end(instrument_of(plugin)); }

static bool shell_activate(const clap_plugin *plugin, double rate_hz, uint32_t, uint32_t most) {
  shell_deactivate(plugin);
  return most >= 1 && most <= INT32_MAX && instrument_begin(instrument_of(plugin), rate_hz);
}

static void shell_destroy(const clap_plugin *plugin) {
  instrument_free(instrument_of(plugin));
  free(shell_of(plugin));
}

static bool start_processing(const clap_plugin *plugin) { return instrument_of(plugin)->mixer; }

static void stop_processing(const clap_plugin *) {}

static void shell_reset(const clap_plugin *plugin) {
  if (instrument_of(plugin)->mixer) instrument_reset(instrument_of(plugin));
}

static int32_t shell_process(const clap_plugin *plugin, const clap_process *process) {
  shell *own = shell_of(plugin);
  if (!own->own.mixer || !process->outputs_count || !process->outputs[0].data32) return CLAP_ERROR;
  clap_audio *output = &process->outputs[0];
  instrument_play(&own->own, process->frames, output->data32, output->channels, next_event, &(given){own->own.of, process->in_events, 0});
  output->constant_mask = 0;
  uint32_t last = process->frames ? process->frames - 1 : 0;
  for (report each; instrument_ended(&own->own, &each);) {
    clap_event_note note = {{sizeof note, last, 0, CLAP_NOTE_END, 0}, (int32_t)(each.id - 1), 0, (int16_t)each.channel, (int16_t)each.key, 0};
    if (process->out_events) process->out_events->try_push(process->out_events, &note.header);
  }
  if (own->own.moved && own->host && own->host->request_callback) {
    own->own.moved = false;
    own->host->request_callback(own->host);
  }
  return instrument_silent(&own->own) ? CLAP_SLEEP : CLAP_CONTINUE;
}

static const void *shell_extension(const clap_plugin *, const char *id) {
  static const struct { const char *id; const void *extension; } all[] = {
      {"clap.audio-ports", audio_ports}, {"clap.note-ports", note_ports}, {"clap.params", &params}, {"clap.state", &state},
      {"clap.latency", latency},         {"clap.tail", tail},             {"clap.render", render},
      {"clap.preset-load/2", presets},
  };
  for (size_t place = 0; place < sizeof all / sizeof *all; place++)
    if (!strcmp(id, all[place].id)) return all[place].extension;
  return NULL;
}

/* The factory */

static clap_descriptor descriptors[MOST_IMAGES];
static char provider_id[160];
static const clap_preset_descriptor provider_descriptor = {CLAP_VERSION_USED, provider_id, "Instruments", "Learned Strings"};

static const char *const *features_of(const image *of) {
  static const char *const strings[] = {"instrument", "synthesizer", "stereo", NULL}, *const drums[] = {"instrument", "drum", "stereo", NULL};
  return of->kit ? drums : strings;
}

static bool entry_init(const char *) {
  if (image_count == 1) snprintf(provider_id, sizeof provider_id, "%s.presets", images[0]->id);
  else strcpy(provider_id, "org.learned-strings.bank.presets"); /* whole, so that it is not read as an instrument's */
  for (int32_t each = 0; each < image_count; each++) {
    const image *of = images[each];
    descriptors[each] = (clap_descriptor){CLAP_VERSION_USED, of->id, of->name, of->maker, "", "", "", LS_VERSION, of->description, features_of(of)};
  }
  return true;
}

static void entry_deinit(void) {}

static uint32_t factory_count(const clap_factory *) { return (uint32_t)image_count; }

static const clap_descriptor *factory_descriptor(const clap_factory *, uint32_t index) {
  return index < (uint32_t)image_count ? &descriptors[index] : NULL;
}

static const clap_plugin *factory_create(const clap_factory *, const clap_host *host, const char *id) {
  int32_t place = image_with_id(id);
  shell *own = place < 0 ? NULL : calloc(1, sizeof *own);
  if (!own) return NULL;
  own->host = host;
  own->own.of = images[place];
  instrument_reset_values(&own->own);
  own->plugin = (clap_plugin){&descriptors[place], own, shell_init, shell_destroy, shell_activate, shell_deactivate,
                              start_processing, stop_processing, shell_reset, shell_process, shell_extension, on_main_thread};
  return &own->plugin;
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
    for (const char *const *feature = features_of(of); to->add_feature && *feature; feature++) to->add_feature(to, *feature);
    if (to->add_feature) to->add_feature(to, of->category);
  }
  return true;
}

static const void *provider_extension(const clap_preset_provider *, const char *) { return NULL; }

static uint32_t provider_count(const void *) { return 1; }

static const clap_preset_descriptor *provider_at(const void *, uint32_t index) {
  return index ? NULL : &provider_descriptor;
}

static const clap_preset_provider *provider_create(const void *, const clap_preset_indexer *indexer, const char *id) {
  clap_preset_provider *own = indexer && id && !strcmp(id, provider_id) ? malloc(sizeof *own) : NULL;
  if (own)
    *own = (clap_preset_provider){&provider_descriptor, (void *)indexer, provider_init, provider_destroy, provider_metadata, provider_extension};
  return own;
}

static const void *const preset_factory[] = {provider_count, provider_at, provider_create};

static const void *get_factory(const char *id) {
  if (!strcmp(id, "clap.plugin-factory")) return &factory;
  return strcmp(id, "clap.preset-discovery-factory/2") ? NULL : preset_factory;
}

LS_EXPORT const clap_entry_t clap_entry = {CLAP_VERSION_USED, entry_init, entry_deinit, get_factory};
