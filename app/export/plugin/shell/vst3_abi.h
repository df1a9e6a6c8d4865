/* The part of VST3's binary interface that the shell uses: facts of its public C interface, written from its documentation.
   https://steinbergmedia.github.io/vst3_dev_portal - of each record the size or its last place is asserted. */

#ifndef LS_VST3_ABI_H
#define LS_VST3_ABI_H

#include "abi.h"

typedef uint16_t vst_text[128]; /* UTF-16 */
typedef uint8_t vst_uid[16];

#ifdef _WIN32 /* identifiers and results are those of COM */
#define UID_HEAD(a, b) (a) & 255, (a) >> 8 & 255, (a) >> 16 & 255, (a) >> 24, (b) >> 16 & 255, (b) >> 24, (b) & 255, (b) >> 8 & 255
enum { VST_OK = 0, VST_FALSE = 1, VST_NO_INTERFACE = (int)0x80004002, VST_BAD_ARGUMENT = (int)0x80070057, VST_MISSING = (int)0x80004001 };
#else
#define UID_HEAD(a, b) (a) >> 24, (a) >> 16 & 255, (a) >> 8 & 255, (a) & 255, (b) >> 24, (b) >> 16 & 255, (b) >> 8 & 255, (b) & 255
enum { VST_OK = 0, VST_FALSE = 1, VST_NO_INTERFACE = -1, VST_BAD_ARGUMENT = 2, VST_MISSING = 3 };
#endif
#define UID_TAIL(c, d) (c) >> 24, (c) >> 16 & 255, (c) >> 8 & 255, (c) & 255, (d) >> 24, (d) >> 16 & 255, (d) >> 8 & 255, (d) & 255
#define UID(a, b, c, d) {UID_HEAD(a##u, b##u), UID_TAIL(c##u, d##u)}

static const vst_uid UID_UNKNOWN = UID(0x00000000, 0x00000000, 0xC0000000, 0x00000046);
static const vst_uid UID_FACTORY = UID(0x7A4D811C, 0x52114A1F, 0xAED9D2EE, 0x0B43BF9F);
static const vst_uid UID_FACTORY2 = UID(0x0007B650, 0xF24B4C0B, 0xA464EDB9, 0xF00B2ABB);
static const vst_uid UID_FACTORY3 = UID(0x4555A2AB, 0xC1234E57, 0x9B122910, 0x36878931);
static const vst_uid UID_BASE = UID(0x22888DDB, 0x156E45AE, 0x8358B348, 0x08190625);
static const vst_uid UID_COMPONENT = UID(0xE831FF31, 0xF2D54301, 0x928EBBEE, 0x25697802);
static const vst_uid UID_PROCESSOR = UID(0x42043F99, 0xB7DA453C, 0xA569E79D, 0x9AAEC33D);
static const vst_uid UID_CONTROLLER = UID(0xDCD7BBE3, 0x7742448D, 0xA874AACC, 0x979C759E);
static const vst_uid UID_MIDI_MAPPING = UID(0xDF0FF9F7, 0x49B74669, 0xB63AB732, 0x7ADBF5E5);
static const vst_uid UID_EXPRESSIONS = UID(0xB7F8F859, 0x41234872, 0x91169581, 0x4F3721A3);
static const vst_uid UID_REQUIREMENTS = UID(0x2A654303, 0xEF764E3D, 0x95B5FE83, 0x730EF6D0);

/* An interface is a pointer to a table of functions, of which the first three are those of FUnknown. Tables of hosts have
   types here; those of the plug-in are written once, with the functions, in the order of the documentation. */

/* Factory */
typedef struct { char vendor[64], url[256], email[128]; int32_t flags; } vst_factory_info;
AT(vst_factory_info, flags, 448);
enum { VST_FACTORY_UNICODE = 16 };
enum { VST_MANY_INSTANCES = 0x7FFFFFFF };
typedef struct { vst_uid id; int32_t cardinality; char category[32], name[64]; } vst_class;
_Static_assert(sizeof(vst_class) == 116, "vst_class");
typedef struct {
  vst_class first;
  uint32_t flags;
  char subcategories[128], vendor[64], version[64], sdk[64];
} vst_class2;
_Static_assert(sizeof(vst_class2) == 440, "vst_class2");
typedef struct {
  vst_uid id;
  int32_t cardinality;
  char category[32];
  uint16_t name[64];
  uint32_t flags;
  char subcategories[128];
  uint16_t vendor[64], version[64], sdk[64];
} vst_class3;
_Static_assert(sizeof(vst_class3) == 696, "vst_class3");

/* Component */
enum { VST_AUDIO, VST_EVENTS };
enum { VST_INPUT, VST_OUTPUT };
enum { VST_MAIN = 0, VST_DEFAULT_ACTIVE = 1 };
typedef struct { int32_t media, direction, channels; vst_text name; int32_t type; uint32_t flags; } vst_bus;
AT(vst_bus, type, 268);
typedef struct vst_stream {
  const struct {
    const void *unknown[3];
    int32_t (*read)(struct vst_stream *, void *, int32_t, int32_t *done);
    int32_t (*write)(struct vst_stream *, void *, int32_t, int32_t *done);
  } *table; /* seek and tell follow */
} vst_stream;

/* Processor */
enum { VST_REALTIME, VST_PREFETCH, VST_OFFLINE };
typedef struct { int32_t mode, sample_size, most_frames; double rate_hz; } vst_setup;
AT(vst_setup, rate_hz, 16);
typedef struct { int32_t channels; uint64_t silence; float **data; } vst_buffers;
AT(vst_buffers, data, 16);
typedef struct vst_queue {
  const struct {
    const void *unknown[3];
    uint32_t (*id)(struct vst_queue *);
    int32_t (*count)(struct vst_queue *);
    int32_t (*point)(struct vst_queue *, int32_t, int32_t *frame, double *value);
    int32_t (*add)(struct vst_queue *, int32_t frame, double value, int32_t *);
  } *table;
} vst_queue;
typedef struct vst_changes {
  const struct {
    const void *unknown[3];
    int32_t (*count)(struct vst_changes *);
    vst_queue *(*queue)(struct vst_changes *, int32_t);
    vst_queue *(*add)(struct vst_changes *, const uint32_t *id, int32_t *);
  } *table;
} vst_changes;
enum { VST_NOTE_ON = 0, VST_NOTE_OFF = 1, VST_POLY_PRESSURE = 3, VST_NOTE_EXPRESSION = 4 };
enum { VST_TUNING = 2, VST_BRIGHTNESS = 5 };
typedef struct {
  int32_t bus, frame;
  double quarter;
  uint16_t flags, type;
  union { /* at an offset of 24, for it holds pointers and doubles */
    struct { int16_t channel, key; float cents, velocity; int32_t length, note; } on;
    struct { int16_t channel, key; float velocity; int32_t note; float cents; } off;
    struct { uint32_t id; int32_t note; double value; } expression;
    void *others;
  };
} vst_event;
AT(vst_event, on.note, 40);
AT(vst_event, off.note, 32);
AT(vst_event, expression.value, 32);
_Static_assert(sizeof(vst_event) == 48, "vst_event");
typedef struct vst_events {
  const struct {
    const void *unknown[3];
    int32_t (*count)(struct vst_events *);
    int32_t (*event)(struct vst_events *, int32_t, vst_event *);
  } *table;
} vst_events;
typedef struct {
  int32_t mode, sample_size, frames, inputs_count, outputs_count;
  vst_buffers *inputs, *outputs;
  vst_changes *changes, *changes_out;
  vst_events *events, *events_out;
  void *context;
} vst_process;
AT(vst_process, events, 56);

/* Controller */
typedef struct {
  uint32_t id;
  vst_text title, short_title, units;
  int32_t steps;
  double standard;
  int32_t unit, flags;
} vst_parameter;
AT(vst_parameter, flags, 788);
enum { VST_CAN_AUTOMATE = 1, VST_LIST = 8, VST_HIDDEN = 16 };
enum { VST_PITCH_BEND = 129 };
typedef struct { double standard, low, high; int32_t steps; } vst_range;
typedef struct {
  uint32_t id;
  vst_text title, short_title, units;
  int32_t unit;
  vst_range range;
  uint32_t parameter;
  int32_t flags;
} vst_expression;
AT(vst_expression, flags, 812);
enum { VST_BIPOLAR = 1, VST_ABSOLUTE = 4 };

#endif
