/* The instrument as an LV2 plug-in; its interface is written from LV2's public documentation (https://lv2plug.in).
   Ports: 0 events, 1 left, 2 right, 3 latency, then one for each parameter. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "instrument.h"
#include "layout.h"

#ifdef _WIN32
#define LS_EXPORT __declspec(dllexport)
#else
#define LS_EXPORT __attribute__((visibility("default")))
#endif

extern const image *const images[];
extern const int32_t image_count;

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

typedef struct {
  instrument own;
  double rate_hz;
  uint32_t midi;
  const lv2_sequence *events;
  float *left, *right, *latency;
  const float *ports[MOST_PARAMETERS];
  float seen[MOST_PARAMETERS];
} shell;

static void *instantiate(const lv2_descriptor_t *descriptor, double rate_hz, const char *, const lv2_feature *const *features) {
  const lv2_map *map = NULL;
  for (; features && *features; features++)
    if (!strcmp((*features)->uri, "http://lv2plug.in/ns/ext/urid#map")) map = (*features)->data;
  for (int32_t each = 0; map && each < image_count; each++) {
    char uri[160];
    snprintf(uri, sizeof uri, "urn:%s", images[each]->id);
    if (strcmp(uri, descriptor->uri)) continue;
    shell *own = calloc(1, sizeof *own);
    if (!own) return NULL;
    own->rate_hz = rate_hz;
    own->midi = map->map(map->handle, "http://lv2plug.in/ns/ext/midi#MidiEvent");
    own->own.of = images[each];
    instrument_reset_values(&own->own);
    return own;
  }
  return NULL;
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
  instrument_reset_values(&own->own); /* ports that stand elsewhere follow */
  for (int32_t place = 0; place < own->own.of->parameter_count; place++) own->seen[place] = NAN;
  if (!instrument_begin(&own->own, own->rate_hz)) instrument_end(&own->own);
}

static void follow_ports(shell *own) {
  for (int32_t place = 0; place < own->own.of->parameter_count; place++) {
    if (!own->ports[place] || *own->ports[place] == own->seen[place]) continue;
    float value = *own->ports[place];
    bool first = isnan(own->seen[place]);
    own->seen[place] = value;
    if (!first || value != (float)parameters_of(own->own.of)[place].standard) instrument_change(&own->own, 0, place, value);
  }
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
  const char *next = NULL, *end = NULL;
  if (own->events && own->events->atom.size >= 8) {
    next = (const char *)own->events + sizeof(lv2_sequence);
    end = (const char *)own->events + sizeof(lv2_atom) + own->events->atom.size;
  }
  for (uint32_t done = 0; done < frames;) {
    uint32_t until = done + QUANTUM < frames ? done + QUANTUM : frames;
    while (next && next + sizeof(lv2_event) <= end) {
      const lv2_event *event = (const lv2_event *)next;
      if (event->frames >= until) break;
      uint32_t at = event->frames < done ? 0 : (uint32_t)event->frames - done;
      if (event->body.type == own->midi && event->body.size == 3 && next + sizeof(lv2_event) + 3 <= end)
        instrument_midi(&own->own, at, (const uint8_t *)next + sizeof(lv2_event));
      next += sizeof(lv2_event) + ((event->body.size + 7u) & ~7u);
    }
    instrument_render(&own->own, until - done, own->left + done, own->right + done);
    done = until;
  }
}

static void deactivate(void *handle) { instrument_end(&((shell *)handle)->own); }

static void cleanup(void *handle) {
  instrument_free(&((shell *)handle)->own);
  free(handle);
}

static const void *extension_data(const char *) { return NULL; }

LS_EXPORT const lv2_descriptor_t *lv2_descriptor(uint32_t index) {
  enum { MOST_IMAGES = 128 };
  static char uris[MOST_IMAGES][160];
  static lv2_descriptor_t descriptors[MOST_IMAGES];
  if (index >= (uint32_t)image_count || index >= MOST_IMAGES) return NULL;
  snprintf(uris[index], sizeof uris[index], "urn:%s", images[index]->id);
  descriptors[index] = (lv2_descriptor_t){uris[index], instantiate, connect_port, activate, run, deactivate, cleanup, extension_data};
  return &descriptors[index];
}
