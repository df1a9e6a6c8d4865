/* A host that counts allocations within `process` and `reset`: random events, blocks, rates, states.

   attack PLUGIN ID SECONDS SEED: plays so many seconds of sound, then reports what went wrong in one line. */

#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "clap_abi.h"

void *__libc_malloc(size_t);
void *__libc_calloc(size_t, size_t);
void *__libc_realloc(void *, size_t);
void __libc_free(void *);

static _Thread_local int inside; /* of the audio thread; others may allocate */
static long allocations;

void *malloc(size_t size) {
  allocations += inside;
  return __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
  allocations += inside;
  return __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size) {
  allocations += inside;
  return __libc_realloc(memory, size);
}

void free(void *memory) {
  allocations += inside && memory;
  __libc_free(memory);
}

static uint64_t state;

static uint32_t number(uint32_t below) {
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return (uint32_t)(state >> 32) % below;
}

static double share(void) { return number(1 << 20) / (double)(1 << 20); }

typedef union { clap_event header; clap_event_note note; clap_event_expression expression; clap_event_param param; clap_event_midi midi; } any_event;
enum { MOST_EVENTS = 64, MOST_FRAMES = 4096 };
static any_event events[MOST_EVENTS];
static uint32_t event_count;

static uint32_t events_size(const clap_in_events *list) {
  (void)list;
  return event_count;
}

static const clap_event *events_get(const clap_in_events *list, uint32_t index) {
  (void)list;
  return &events[index].header;
}

static bool ignore(const clap_out_events *list, const clap_event *event) {
  (void)list, (void)event;
  return true;
}

static const void *no_extension(const clap_host *host, const char *id) {
  (void)host, (void)id;
  return NULL;
}

static void nothing(const clap_host *host) { (void)host; }

static const clap_host host = {{1, 2, 0}, NULL, "attack", "", "", "1", no_extension, nothing, nothing, nothing};
static float left[MOST_FRAMES], right[MOST_FRAMES];

static void process(const clap_plugin *plugin, uint32_t frames) {
  float *rows[] = {left, right};
  clap_audio output = {rows, NULL, 2, 0, 0};
  clap_in_events in = {NULL, events_size, events_get};
  clap_out_events out = {NULL, ignore};
  clap_process block = {-1, frames, NULL, NULL, &output, 0, 1, &in, &out};
  inside = 1;
  plugin->process(plugin, &block);
  inside = 0;
}

static uint8_t kept[1 << 16];
static uint64_t kept_size, kept_read;

static int64_t keep(const clap_ostream *stream, const void *bytes, uint64_t size) {
  (void)stream;
  memcpy(kept + kept_size, bytes, size);
  kept_size += size;
  return (int64_t)size;
}

static int64_t give(const clap_istream *stream, void *bytes, uint64_t size) {
  (void)stream;
  size = size < kept_size - kept_read ? size : kept_size - kept_read;
  memcpy(bytes, kept + kept_read, size);
  kept_read += size;
  return (int64_t)size;
}

static void add_random(const clap_plugin *plugin, uint32_t frame) {
  const clap_params *params = plugin->get_extension(plugin, "clap.params");
  any_event *event = &events[event_count++];
  memset(event, 0, sizeof *event);
  int16_t channel = (int16_t)((int)number(18) - 1), key = (int16_t)((int)number(132) - 2);
  int32_t id = (int32_t)number(12) - 1;
  uint32_t kind = number(10);
  if (kind < 4) {
    event->note = (clap_event_note){{sizeof event->note, frame, 0, kind < 3 ? CLAP_NOTE_ON : CLAP_NOTE_OFF, 0}, id, 0, channel, key, share()};
  } else if (kind == 4) {
    event->note = (clap_event_note){{sizeof event->note, frame, 0, CLAP_NOTE_CHOKE, 0}, id, 0, channel, key, 0};
  } else if (kind == 5) {
    double wild = number(10) ? 48 * share() - 24 : number(2) ? NAN : 1e300;
    event->expression = (clap_event_expression){{sizeof event->expression, frame, 0, CLAP_NOTE_EXPRESSION, 0}, (int32_t)number(8), id, 0, channel, key, wild};
  } else if (kind < 8) {
    clap_param info;
    params->info(plugin, number(params->count(plugin)), &info);
    double wild = number(20) ? info.low + share() * (info.high - info.low) : number(2) ? NAN : -INFINITY;
    event->param = (clap_event_param){{sizeof event->param, frame, 0, CLAP_PARAM_VALUE, 0}, info.id, NULL, -1, -1, -1, -1, wild};
  } else {
    event->midi = (clap_event_midi){{sizeof event->midi, frame, 0, CLAP_MIDI, 0}, 0, {(uint8_t)number(256), (uint8_t)number(256), (uint8_t)number(256)}};
  }
}

static int attack(const clap_plugin *plugin, double seconds) {
  static const double rates_hz[] = {44100, 48000, 88200, 96000, 192000, 22050};
  const clap_state *own = plugin->get_extension(plugin, "clap.state");
  double done_s = 0, rate_hz = 48000, peak = 0;
  long wild = 0, refused = 0, blocks = 0;
  plugin->activate(plugin, rate_hz, 1, MOST_FRAMES);
  while (done_s < seconds) {
    uint32_t frames = number(4) ? 1 + number(600) : 1 + number(MOST_FRAMES), frame = 0;
    event_count = 0;
    for (uint32_t left_over = number(number(8) ? 4 : MOST_EVENTS); left_over; left_over--) {
      frame += number(frames) / (left_over + 1);
      add_random(plugin, frame < frames ? frame : frames - 1);
    }
    process(plugin, frames);
    for (uint32_t place = 0; place < frames; place++) {
      if (!isfinite(left[place]) || !isfinite(right[place])) wild++;
      peak = fmax(peak, fmax(fabs(left[place]), fabs(right[place])));
    }
    done_s += frames / rate_hz;
    blocks++;
    if (!number(300)) {
      inside = 1;
      plugin->reset(plugin);
      inside = 0;
    }
    if (!number(400)) {
      kept_size = kept_read = 0;
      clap_ostream to = {NULL, keep};
      clap_istream from = {NULL, give};
      refused += !own->save(plugin, &to);
      if (!number(4)) kept[number((uint32_t)kept_size)] ^= (uint8_t)number(256); /* a damaged one is refused, or read */
      own->load(plugin, &from);
    }
    if (!number(900)) {
      if (number(2)) plugin->deactivate(plugin); /* else it is activated twice */
      rate_hz = rates_hz[number(6)];
      refused += !plugin->activate(plugin, rate_hz, 1, MOST_FRAMES);
    }
  }
  plugin->deactivate(plugin);
  printf("{\"seconds\": %.1f, \"blocks\": %ld, \"wild\": %ld, \"refused\": %ld, \"peak\": %.6f, \"allocations\": %ld}\n", done_s, blocks, wild,
         refused, peak, allocations);
  return 0;
}

int main(int count, char **words) {
  if (count < 5) return 2;
  inside = 1;
  void *volatile one = malloc(16);
  free(one);
  inside = 0;
  if (allocations != 2) return fprintf(stderr, "allocations are not counted here\n"), 3;
  allocations = 0;
  void *library = dlopen(words[1], RTLD_NOW);
  if (!library) return fprintf(stderr, "%s\n", dlerror()), 1;
  const clap_entry_t *entry = dlsym(library, "clap_entry");
  entry->init(words[1]);
  const clap_factory *factory = entry->get_factory("clap.plugin-factory");
  const clap_plugin *plugin = factory->create(factory, &host, words[2]);
  if (!plugin) return 1;
  plugin->init(plugin);
  state = 88172645463325252u + 977u * strtoull(words[4], NULL, 10);
  int result = attack(plugin, atof(words[3]));
  plugin->destroy(plugin);
  return result;
}
