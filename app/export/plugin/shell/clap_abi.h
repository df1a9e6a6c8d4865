/* The part of CLAP's binary interface that the shell uses, written from its public documentation.
   https://cleveraudio.org - version 1.2.0 of the interface. Of each record the size or its last place is asserted. */

#ifndef LS_CLAP_ABI_H
#define LS_CLAP_ABI_H

#include "abi.h"

typedef struct { uint32_t major, minor, revision; } clap_version;
#define CLAP_VERSION_USED ((clap_version){1, 2, 0})

typedef struct {
  clap_version version;
  bool (*init)(const char *path);
  void (*deinit)(void);
  const void *(*get_factory)(const char *id);
} clap_entry_t;
AT(clap_entry_t, init, 16);

typedef struct {
  clap_version version;
  const char *id, *name, *vendor, *url, *manual_url, *support_url, *plugin_version, *description;
  const char *const *features;
} clap_descriptor;
AT(clap_descriptor, features, 80);

typedef struct clap_host {
  clap_version version;
  void *data;
  const char *name, *vendor, *url, *host_version;
  const void *(*get_extension)(const struct clap_host *, const char *id);
  void (*request_restart)(const struct clap_host *);
  void (*request_process)(const struct clap_host *);
  void (*request_callback)(const struct clap_host *);
} clap_host;
AT(clap_host, get_extension, 56);

typedef struct { uint32_t size, time; uint16_t space, type; uint32_t flags; } clap_event;
_Static_assert(sizeof(clap_event) == 16, "clap_event");
enum { CLAP_NOTE_ON, CLAP_NOTE_OFF, CLAP_NOTE_CHOKE, CLAP_NOTE_END, CLAP_NOTE_EXPRESSION, CLAP_PARAM_VALUE,
       CLAP_PARAM_MOD, CLAP_GESTURE_BEGIN, CLAP_GESTURE_END, CLAP_TRANSPORT, CLAP_MIDI };
enum { CLAP_EXPRESSION_TUNING = 3, CLAP_EXPRESSION_BRIGHTNESS = 5 };

typedef struct { clap_event header; int32_t note_id; int16_t port, channel, key; double velocity; } clap_event_note;
AT(clap_event_note, velocity, 32);
typedef struct { clap_event header; int32_t id, note_id; int16_t port, channel, key; double value; } clap_event_expression;
AT(clap_event_expression, value, 32);
typedef struct {
  clap_event header;
  uint32_t param;
  void *cookie;
  int32_t note_id;
  int16_t port, channel, key;
  double value;
} clap_event_param;
AT(clap_event_param, value, 48);
typedef struct { clap_event header; uint16_t port; uint8_t data[3]; } clap_event_midi;
AT(clap_event_midi, data, 18);

typedef struct clap_in_events {
  void *context;
  uint32_t (*size)(const struct clap_in_events *);
  const clap_event *(*get)(const struct clap_in_events *, uint32_t);
} clap_in_events;
typedef struct clap_out_events {
  void *context;
  bool (*try_push)(const struct clap_out_events *, const clap_event *);
} clap_out_events;

typedef struct { float **data32; double **data64; uint32_t channels, latency; uint64_t constant_mask; } clap_audio;
AT(clap_audio, constant_mask, 24);
typedef struct {
  int64_t steady_time;
  uint32_t frames;
  const void *transport;
  const clap_audio *inputs;
  clap_audio *outputs;
  uint32_t inputs_count, outputs_count;
  const clap_in_events *in_events;
  const clap_out_events *out_events;
} clap_process;
AT(clap_process, in_events, 48);
enum { CLAP_ERROR, CLAP_CONTINUE, CLAP_CONTINUE_IF_NOT_QUIET, CLAP_TAIL, CLAP_SLEEP };

typedef struct clap_plugin {
  const clap_descriptor *descriptor;
  void *data;
  bool (*init)(const struct clap_plugin *);
  void (*destroy)(const struct clap_plugin *);
  bool (*activate)(const struct clap_plugin *, double rate_hz, uint32_t least, uint32_t most);
  void (*deactivate)(const struct clap_plugin *);
  bool (*start_processing)(const struct clap_plugin *);
  void (*stop_processing)(const struct clap_plugin *);
  void (*reset)(const struct clap_plugin *);
  int32_t (*process)(const struct clap_plugin *, const clap_process *);
  const void *(*get_extension)(const struct clap_plugin *, const char *id);
  void (*on_main_thread)(const struct clap_plugin *);
} clap_plugin;
AT(clap_plugin, process, 72);

typedef struct clap_factory {
  uint32_t (*count)(const struct clap_factory *);
  const clap_descriptor *(*descriptor)(const struct clap_factory *, uint32_t);
  const clap_plugin *(*create)(const struct clap_factory *, const clap_host *, const char *id);
} clap_factory;

/* Discovery of presets */
enum { CLAP_PRESET_IN_FILE, CLAP_PRESET_IN_PLUGIN };
enum { CLAP_PRESET_IS_FACTORY = 1 };
typedef struct { const char *abi, *id; } clap_universal_id;
_Static_assert(sizeof(clap_universal_id) == 16, "clap_universal_id");
typedef struct clap_preset_receiver {
  void *data;
  void (*on_error)(const struct clap_preset_receiver *, int32_t os_error, const char *message);
  bool (*begin_preset)(const struct clap_preset_receiver *, const char *name, const char *load_key);
  void (*add_plugin_id)(const struct clap_preset_receiver *, const clap_universal_id *);
  void (*set_soundpack_id)(const struct clap_preset_receiver *, const char *);
  void (*set_flags)(const struct clap_preset_receiver *, uint32_t);
  void (*add_creator)(const struct clap_preset_receiver *, const char *);
  void (*set_description)(const struct clap_preset_receiver *, const char *);
  void (*set_timestamps)(const struct clap_preset_receiver *, uint64_t created, uint64_t modified);
  void (*add_feature)(const struct clap_preset_receiver *, const char *);
  void (*add_extra_info)(const struct clap_preset_receiver *, const char *key, const char *value);
} clap_preset_receiver;
_Static_assert(sizeof(clap_preset_receiver) == 88, "clap_preset_receiver");
typedef struct { uint32_t flags; const char *name; uint32_t kind; const char *location; } clap_preset_location;
_Static_assert(sizeof(clap_preset_location) == 32, "clap_preset_location");
typedef struct { clap_version version; const char *id, *name, *vendor; } clap_preset_descriptor;
_Static_assert(sizeof(clap_preset_descriptor) == 40, "clap_preset_descriptor");
typedef struct clap_preset_provider {
  const clap_preset_descriptor *descriptor;
  void *data;
  bool (*init)(const struct clap_preset_provider *);
  void (*destroy)(const struct clap_preset_provider *);
  bool (*get_metadata)(const struct clap_preset_provider *, uint32_t kind, const char *location, const clap_preset_receiver *);
  const void *(*get_extension)(const struct clap_preset_provider *, const char *id);
} clap_preset_provider;
_Static_assert(sizeof(clap_preset_provider) == 48, "clap_preset_provider");
typedef struct clap_preset_indexer {
  clap_version version;
  const char *name, *vendor, *url, *host_version;
  void *data;
  bool (*declare_filetype)(const struct clap_preset_indexer *, const void *);
  bool (*declare_location)(const struct clap_preset_indexer *, const clap_preset_location *);
  bool (*declare_soundpack)(const struct clap_preset_indexer *, const void *);
  const void *(*get_extension)(const struct clap_preset_indexer *, const char *id);
} clap_preset_indexer;
_Static_assert(sizeof(clap_preset_indexer) == 88, "clap_preset_indexer");

/* Extensions. Their tables are written once, with the functions; those that a host in C calls have types here. */
typedef struct {
  uint32_t id;
  char name[256];
  uint32_t flags, channels;
  const char *type;
  uint32_t in_place;
} clap_audio_port;
AT(clap_audio_port, type, 272);
enum { CLAP_PORT_IS_MAIN = 1 };

typedef struct { uint32_t id, dialects, preferred; char name[256]; } clap_note_port;
_Static_assert(sizeof(clap_note_port) == 268, "clap_note_port");
enum { CLAP_DIALECT_CLAP = 1, CLAP_DIALECT_MIDI = 2, CLAP_DIALECT_MPE = 4 };

typedef struct {
  uint32_t id, flags;
  void *cookie;
  char name[256], module[1024];
  double low, high, standard;
} clap_param;
AT(clap_param, low, 1296);
enum { CLAP_PARAM_STEPPED = 1, CLAP_PARAM_AUTOMATABLE = 1 << 5, CLAP_PARAM_ENUM = 1 << 16 };
typedef struct {
  uint32_t (*count)(const clap_plugin *);
  bool (*info)(const clap_plugin *, uint32_t, clap_param *);
  bool (*value)(const clap_plugin *, uint32_t id, double *);
  bool (*to_text)(const clap_plugin *, uint32_t id, double, char *, uint32_t);
  bool (*from_text)(const clap_plugin *, uint32_t id, const char *, double *);
  void (*flush)(const clap_plugin *, const clap_in_events *, const clap_out_events *);
} clap_params;

typedef struct clap_ostream {
  void *context;
  int64_t (*write)(const struct clap_ostream *, const void *, uint64_t);
} clap_ostream;
typedef struct clap_istream {
  void *context;
  int64_t (*read)(const struct clap_istream *, void *, uint64_t);
} clap_istream;
typedef struct {
  bool (*save)(const clap_plugin *, const clap_ostream *);
  bool (*load)(const clap_plugin *, const clap_istream *);
} clap_state;

enum { CLAP_RENDER_REALTIME, CLAP_RENDER_OFFLINE };

/* Extensions of hosts */
enum { CLAP_RESCAN_VALUES = 1 };
typedef struct { void (*rescan)(const clap_host *, uint32_t flags); } clap_host_params; /* two more are not called */
typedef struct {
  void (*on_error)(const clap_host *, uint32_t kind, const char *location, const char *load_key, int32_t os_error, const char *message);
  void (*loaded)(const clap_host *, uint32_t kind, const char *location, const char *load_key);
} clap_host_preset_load;
_Static_assert(sizeof(clap_host_preset_load) == 16, "clap_host_preset_load");

#endif
