/* The instrument as an LV2 plug-in; its interface is written from LV2's public documentation (https://lv2plug.in).
   Ports: 0 events, 1 left, 2 right, 3 latency, then one for each parameter.

   A macro moves parameters whose ports stay where they are: ports belong to the host. So a saved state holds all values,
   and the ports at which they were reached. A port that a host sets as it was saved then changes nothing. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "instrument.h"

typedef struct { const char *uri; void *data; } lv2_feature;
typedef struct { void *handle; uint32_t (*map)(void *handle, const char *uri); } lv2_map;
typedef struct { uint32_t size, type; } lv2_atom;
typedef struct { lv2_atom atom; uint32_t unit, padding; } lv2_sequence;
typedef struct { int64_t frames; lv2_atom body; } lv2_event;
typedef struct lv2_descriptor {
  const char *uri;
  void *(*instantiate)(const struct lv2_descriptor *, double rate_hz, const char *path, const lv2_feature *const *);
  void (*connect_port)(void *, uint32_t port, void *data);
  void (*activate)(void *);
  void (*run)(void *, uint32_t frames);
  void (*deactivate)(void *);
  void (*cleanup)(void *);
  const void *(*extension_data)(const char *uri);
} lv2_descriptor_t;
_Static_assert(sizeof(lv2_descriptor_t) == 64, "lv2_descriptor");
_Static_assert(sizeof(lv2_event) == 16, "lv2_event");

enum { PORT_EVENTS, PORT_LEFT, PORT_RIGHT, PORT_LATENCY, PORT_FIRST };

typedef int32_t (*lv2_store)(void *handle, uint32_t key, const void *value, size_t size, uint32_t type, uint32_t flags);
typedef const void *(*lv2_retrieve)(void *handle, uint32_t key, size_t *size, uint32_t *type, uint32_t *flags);
typedef struct {
  int32_t (*save)(void *, lv2_store, void *handle, uint32_t flags, const lv2_feature *const *);
  int32_t (*restore)(void *, lv2_retrieve, void *handle, uint32_t flags, const lv2_feature *const *);
} lv2_state;
enum { STATE_SUCCESS, STATE_UNKNOWN, STATE_BAD_TYPE, STATE_BAD_FLAGS, STATE_NO_FEATURE, STATE_NO_PROPERTY };
enum { STATE_IS_POD = 1, STATE_IS_PORTABLE = 2 };

typedef struct {
  instrument own;
  double rate_hz;
  uint32_t midi, chunk, keys[2]; /* keys: of the values and of the ports in a state */
  const lv2_sequence *events;
  float *left, *right, *latency;
  const float *ports[MOST_PARAMETERS];
  double seen[MOST_PARAMETERS];     /* of ports: the values that the parameters have followed */
  double restored[MOST_PARAMETERS]; /* of ports, with a state; NaN: the port has been there, or elsewhere, since */
  bool begun;                       /* nothing is rendered yet */
} shell;

static const char URN[] = "urn:";

/* Single precision, as ports have it. */
static double port_standard(const shell *own, int32_t place) { return (float)parameters_of(own->own.of)[place].standard; }

static void *instantiate(const lv2_descriptor_t *descriptor, double rate_hz, const char *, const lv2_feature *const *features) {
  const lv2_map *map = NULL;
  for (; features && *features; features++)
    if (!strcmp((*features)->uri, "http://lv2plug.in/ns/ext/urid#map")) map = (*features)->data;
  int32_t number = image_with_id(descriptor->uri + sizeof URN - 1);
  shell *own = number >= 0 && map && rate_is_possible(rate_hz) ? calloc(1, sizeof *own) : NULL;
  if (!own) return NULL;
  own->rate_hz = rate_hz;
  own->midi = map->map(map->handle, "http://lv2plug.in/ns/ext/midi#MidiEvent");
  own->chunk = map->map(map->handle, "http://lv2plug.in/ns/ext/atom#Chunk");
  own->keys[0] = map->map(map->handle, "urn:org.learned-strings:state#values");
  own->keys[1] = map->map(map->handle, "urn:org.learned-strings:state#ports");
  own->own.of = images[number];
  instrument_reset_values(&own->own);
  for (int32_t place = 0; place < own->own.of->parameter_count; place++)
    own->seen[place] = port_standard(own, place), own->restored[place] = NAN;
  return own;
}

static void connect_port(void *handle, uint32_t port, void *data) {
  shell *own = handle;
  if (port == PORT_EVENTS) own->events = data;
  else if (port == PORT_LEFT) own->left = data;
  else if (port == PORT_RIGHT) own->right = data;
  else if (port == PORT_LATENCY) own->latency = data;
  else if (port - PORT_FIRST < (uint32_t)own->own.of->parameter_count) own->ports[port - PORT_FIRST] = data;
}

static void activate(void *handle) {
  shell *own = handle;
  own->begun = instrument_begin(&own->own, own->rate_hz);
}

/* A port counts when it moves: a macro may have moved its parameter since. */
static void follow_ports(shell *own) {
  bool moved = false;
  for (int32_t place = 0; place < own->own.of->parameter_count; place++) {
    const parameter *each = &parameters_of(own->own.of)[place];
    double value = own->ports[place] ? *own->ports[place] : NAN;
    if (!isfinite(value)) continue;
    value = (float)fmin(fmax(value, each->low), each->high);
    bool back = value == own->restored[place], other = value != own->seen[place];
    if (back || other) own->restored[place] = NAN;
    own->seen[place] = value;
    if (back || !other) continue;
    if (value == port_standard(own, place)) value = each->standard;
    if (own->begun) instrument_set(&own->own, place, value);
    else instrument_take(&own->own, 0, (event){.kind = PARAMETER, .key = place, .value = value});
    moved = true;
  }
  if (own->begun && (moved || own->own.loaded)) instrument_reset(&own->own); /* nothing sounds: no knob glides */
}

typedef struct { const char *next, *end; uint32_t midi; } given;

static bool next_event(void *context, event *to) {
  given *from = context;
  while (from->next && from->next + sizeof(lv2_event) <= from->end) {
    const lv2_event *each = (const lv2_event *)from->next;
    const char *bytes = from->next + sizeof(lv2_event);
    from->next = bytes + ((each->body.size + 7u) & ~7u);
    if (each->body.type != from->midi || each->body.size != 3 || bytes + 3 > from->end) continue;
    if (!event_of_midi((const uint8_t *)bytes, to)) continue;
    to->frame = each->frames;
    return true;
  }
  return false;
}

static void run(void *handle, uint32_t frames) {
  shell *own = handle;
  if (own->latency) *own->latency = (float)instrument_latency();
  if (!own->left || !own->right) return;
  if (!own->own.mixer) {
    memset(own->left, 0, frames * sizeof(float));
    memset(own->right, 0, frames * sizeof(float));
    return;
  }
  follow_ports(own);
  if (frames) own->begun = false;
  given from = {NULL, NULL, own->midi};
  if (own->events && own->events->atom.size >= 8) {
    from.next = (const char *)own->events + sizeof(lv2_sequence);
    from.end = (const char *)own->events + sizeof(lv2_atom) + own->events->atom.size;
  }
  instrument_play(&own->own, frames, (float *[]){own->left, own->right}, 2, next_event, &from);
}

static void deactivate(void *handle) { instrument_end(&((shell *)handle)->own); }

static void cleanup(void *handle) {
  instrument_free(&((shell *)handle)->own);
  free(handle);
}

static int32_t save(void *handle, lv2_store store, void *with, uint32_t, const lv2_feature *const *) {
  shell *own = handle;
  uint8_t bytes[STATE_BYTES];
  const double *parts[] = {own->own.values, own->seen};
  for (int32_t each = 0; each < 2; each++) {
    size_t size = (size_t)state_write(own->own.of, parts[each], bytes);
    int32_t result = store(with, own->keys[each], bytes, size, own->chunk, STATE_IS_POD | STATE_IS_PORTABLE);
    if (result != STATE_SUCCESS) return result;
  }
  return STATE_SUCCESS;
}

/* Both parts are read before either counts. */
static int32_t restore(void *handle, lv2_retrieve retrieve, void *with, uint32_t, const lv2_feature *const *) {
  shell *own = handle;
  const uint8_t *parts[2];
  size_t sizes[2] = {0};
  for (int32_t each = 0; each < 2; each++) {
    uint32_t type = 0, flags = 0;
    parts[each] = retrieve(with, own->keys[each], &sizes[each], &type, &flags);
    if (!parts[each]) return STATE_NO_PROPERTY;
    if (type != own->chunk) return STATE_BAD_TYPE;
    if (sizes[each] > MOST_STATE_BYTES) return STATE_UNKNOWN;
  }
  double ports[MOST_PARAMETERS];
  if (!state_read(own->own.of, parts[1], (int64_t)sizes[1], ports)) return STATE_UNKNOWN;
  if (!instrument_load(&own->own, parts[0], (int64_t)sizes[0])) return STATE_UNKNOWN;
  for (int32_t place = 0; place < own->own.of->parameter_count; place++) own->restored[place] = (float)ports[place];
  return STATE_SUCCESS;
}

static const void *extension_data(const char *uri) {
  static const lv2_state state = {save, restore};
  return strcmp(uri, "http://lv2plug.in/ns/ext/state#interface") ? NULL : &state;
}

LS_EXPORT const lv2_descriptor_t *lv2_descriptor(uint32_t index) {
  static char uris[MOST_IMAGES][160];
  static lv2_descriptor_t descriptors[MOST_IMAGES];
  if (index >= (uint32_t)image_count) return NULL;
  snprintf(uris[index], sizeof uris[index], "%s%s", URN, images[index]->id);
  descriptors[index] = (lv2_descriptor_t){uris[index], instantiate, connect_port, activate, run, deactivate, cleanup, extension_data};
  return &descriptors[index];
}
