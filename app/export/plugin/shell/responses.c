/* See responses.h. Both channels are one complex signal, left its real part: all filters here are real.

   The room is that of engine/effects/room.py, the body that of body.py, levels and rates those of impulse.py. */

#include "responses.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "layout.h"

#define PI 3.14159265358979323846

/* Fourier transforms */

typedef struct { int64_t size; pair *turns; } circle; /* exp(-2 pi i k / size), k below size / 2 */

static pair times(pair a, pair b) { return (pair){a.left * b.left - a.right * b.right, a.left * b.right + a.right * b.left}; }

static int64_t room_for(int64_t frames) {
  int64_t size = 1;
  while (size < frames) size *= 2;
  return size;
}

static bool widen(circle *own, int64_t size) {
  if (own->size >= size) return true;
  free(own->turns);
  own->turns = malloc((size_t)(size / 2 + 1) * sizeof(pair));
  own->size = own->turns ? size : 0;
  for (int64_t k = 0; own->turns && k < size / 2; k++) own->turns[k] = (pair){cos(2 * PI * (double)k / (double)size), -sin(2 * PI * (double)k / (double)size)};
  return own->turns;
}

/* In place; `size` is a power of two, and the circle is as wide. Backwards, the sum is not divided by the size. */
static void transform(const circle *with, pair *z, int64_t size, bool backwards) {
  for (int64_t place = 1, other = 0; place < size; place++) {
    int64_t bit = size >> 1;
    for (; other & bit; bit >>= 1) other ^= bit;
    other |= bit;
    if (place < other) {
      pair kept = z[place];
      z[place] = z[other], z[other] = kept;
    }
  }
  for (int64_t length = 2; length <= size; length *= 2)
    for (int64_t first = 0, half = length / 2, step = with->size / length; first < size; first += length)
      for (int64_t k = 0; k < half; k++) {
        pair turn = with->turns[k * step], *one = z + first + k, *two = one + half;
        if (backwards) turn.right = -turn.right;
        pair turned = times(turn, *two);
        *two = (pair){one->left - turned.left, one->right - turned.right};
        *one = (pair){one->left + turned.left, one->right + turned.right};
      }
}

static pair *spectrum(circle *with, const pair *samples, int64_t frames, int64_t size) {
  pair *z = calloc((size_t)size, sizeof(pair));
  if (!z || !widen(with, size)) {
    free(z);
    return NULL;
  }
  memcpy(z, samples, (size_t)frames * sizeof(pair));
  transform(with, z, size, false);
  return z;
}

/* exp(-pi i k^2 / n) */
static pair chirp(int64_t k, int64_t n) {
  double turn = PI * (double)(k * k % (2 * n)) / (double)n;
  return (pair){cos(turn), -sin(turn)};
}

/* A transform of any length n in place (L. Bluestein, IEEE Trans. Audio Electroacoust. 18 (1970) 451). */
static bool transform_any(circle *with, pair *z, int64_t n) {
  int64_t size = room_for(2 * n - 1);
  pair *one = calloc((size_t)size, sizeof(pair)), *two = calloc((size_t)size, sizeof(pair));
  bool made = one && two && widen(with, size);
  for (int64_t k = 0; made && k < n; k++) {
    pair turn = chirp(k, n);
    one[k] = times(z[k], turn);
    turn.right = -turn.right;
    two[k] = turn;
    if (k) two[size - k] = turn;
  }
  if (made) {
    transform(with, one, size, false);
    transform(with, two, size, false);
    for (int64_t k = 0; k < size; k++) one[k] = times(one[k], two[k]);
    transform(with, one, size, true);
    for (int64_t k = 0; k < n; k++) {
      pair found = times(one[k], chirp(k, n));
      z[k] = (pair){found.left / (double)size, found.right / (double)size};
    }
  }
  free(one);
  free(two);
  return made;
}

/* impulse.py */

/* The fraction next to a ratio, of a denominator up to 1000. */
static void fraction(double ratio, int64_t *numerator, int64_t *denominator) {
  int64_t p0 = 0, q0 = 1, p1 = 1, q1 = 0;
  double rest = ratio;
  while (rest < 1e9) {
    int64_t whole = (int64_t)rest, p2 = p0 + whole * p1, q2 = q0 + whole * q1;
    if (q2 > 1000) break;
    p0 = p1, q0 = q1, p1 = p2, q1 = q2;
    rest = 1 / fmax(rest - (double)whole, 1e-12);
  }
  int64_t more = (1000 - q0) / q1;
  double bound = (double)(p0 + more * p1) / (double)(q0 + more * q1);
  bool latest = fabs((double)p1 / (double)q1 - ratio) <= fabs(bound - ratio);
  *numerator = latest ? p1 : p0 + more * p1;
  *denominator = latest ? q1 : q0 + more * q1;
}

static bool resample(circle *with, sound *own, double from_hz, double to_hz) {
  if (from_hz == to_hz || !own->frames) return true;
  int64_t numerator, denominator;
  fraction(to_hz / from_hz, &numerator, &denominator);
  int64_t units = (own->frames + denominator - 1) / denominator, padded = 2 * units * denominator, made = 2 * units * numerator;
  int64_t kept = (padded < made ? padded : made) / 2, frames = (int64_t)rint((double)own->frames * to_hz / from_hz);
  if (frames < 1) frames = 1;
  int64_t most = padded > made ? padded : made;
  pair *before = calloc((size_t)most, sizeof(pair)), *after = calloc((size_t)(most > frames ? most : frames), sizeof(pair));
  bool done = before && after;
  if (done) {
    memcpy(before, own->samples, (size_t)own->frames * sizeof(pair));
    done = transform_any(with, before, padded);
  }
  if (done) { /* backwards: the conjugate of the transform of the conjugate */
    for (int64_t k = 0; k < kept; k++) after[k] = (pair){before[k].left, -before[k].right};
    for (int64_t k = 1; k < kept; k++) after[made - k] = (pair){before[padded - k].left, -before[padded - k].right};
    done = transform_any(with, after, made);
    for (int64_t frame = 0; frame < frames; frame++)
      after[frame] = frame < made ? (pair){after[frame].left / (double)padded, -after[frame].right / (double)padded} : (pair){0, 0};
  }
  free(before);
  if (!done) {
    free(after);
    return false;
  }
  free(own->samples);
  *own = (sound){frames, after};
  return true;
}

static bool without_subsonic(circle *with, sound *own, double edge_hz, double rate_hz) {
  int64_t size = room_for(2 * own->frames);
  pair *z = spectrum(with, own->samples, own->frames, size);
  if (!z) return false;
  z[0] = (pair){0, 0};
  for (int64_t k = 1; k < size; k++) {
    double s = (double)(k <= size / 2 ? k : k - size) * rate_hz / (double)size / edge_hz; /* Butterworth at i s */
    double re = 1 - s * s, im = sqrt(2) * s, square = re * re + im * im;
    z[k] = times(z[k], (pair){-s * s * re / square, k == size / 2 ? 0 : s * s * im / square}); /* real where both meet */
  }
  transform(with, z, size, true);
  for (int64_t frame = 0; frame < own->frames; frame++) own->samples[frame] = (pair){z[frame].left / (double)size, z[frame].right / (double)size};
  free(z);
  return true;
}

static void fade(sound *own) {
  int64_t frames = (int64_t)rint(FADE_SHARE * (double)own->frames);
  if (frames < 1) frames = 1;
  for (int64_t frame = 1; frame <= frames; frame++) {
    double share = 0.5 + 0.5 * cos(PI * (double)frame / (double)frames);
    pair *each = own->samples + own->frames - frames + frame - 1;
    each->left *= share, each->right *= share;
  }
}

/* The power of noise through each two of some responses, (count, count); null: those without frames, and `count` of them. */
static bool noise_powers(circle *with, const sound *const *of, int32_t count, int64_t frames, double rate_hz, double *powers) {
  int64_t least = (int64_t)rate_hz / 4, size = room_for(frames > least ? frames : least);
  pair *spectra[1 + MIX_PARTS] = {NULL};
  bool made = true;
  for (int32_t each = 0; each < count; each++)
    if (of[each]->frames && made) made = (spectra[each] = spectrum(with, of[each]->samples, of[each]->frames, size));
  double total = 0;
  memset(powers, 0, (size_t)(count * count) * sizeof(double));
  for (int64_t k = 0; made && k <= size / 2; k++) {
    double hz = rate_hz / 2 * (double)k / (double)(size / 2);
    if (hz < LOUDNESS_LOW_HZ || hz > LOUDNESS_HIGH_HZ) continue;
    pair left[1 + MIX_PARTS] = {0}, right[1 + MIX_PARTS] = {0};
    for (int32_t each = 0; each < count; each++) {
      if (!spectra[each]) continue;
      pair a = spectra[each][k], b = spectra[each][(size - k) % size];
      left[each] = (pair){0.5 * (a.left + b.left), 0.5 * (a.right - b.right)};
      right[each] = (pair){0.5 * (a.right + b.right), 0.5 * (b.left - a.left)};
    }
    total += 2 / hz;
    for (int32_t i = 0; i < count; i++)
      for (int32_t j = 0; j < count; j++)
        powers[i * count + j] += (left[i].left * left[j].left + left[i].right * left[j].right + right[i].left * right[j].left + right[i].right * right[j].right) / hz;
  }
  for (int32_t each = 0; each < count * count; each++) powers[each] /= total;
  for (int32_t each = 0; each < count; each++) free(spectra[each]);
  return made;
}

static bool as_loud(circle *with, sound *own, double rate_hz) {
  double power;
  const sound *all[] = {own};
  if (!noise_powers(with, all, 1, own->frames, rate_hz, &power)) return false;
  double factor = 1 / fmax(sqrt(power), 1e-30);
  for (int64_t frame = 0; frame < own->frames; frame++) own->samples[frame].left *= factor, own->samples[frame].right *= factor;
  return true;
}

static bool in_series(circle *with, const sound *one, const sound *two, sound *both) {
  int64_t frames = one->frames + two->frames - 1, size = room_for(frames);
  pair *a = spectrum(with, one->samples, one->frames, size), *b = spectrum(with, two->samples, two->frames, size);
  bool made = a && b;
  for (int64_t k = 0; made && k <= size / 2; k++) { /* the spectra of both channels, apart, multiplied, together again */
    int64_t other = (size - k) % size;
    pair left[2], right[2];
    const pair *all[] = {a, b};
    for (int32_t each = 0; each < 2; each++) {
      pair x = all[each][k], y = all[each][other];
      left[each] = (pair){0.5 * (x.left + y.left), 0.5 * (x.right - y.right)};
      right[each] = (pair){0.5 * (x.right + y.right), 0.5 * (y.left - x.left)};
    }
    pair l = times(left[0], left[1]), r = times(right[0], right[1]);
    a[k] = (pair){l.left - r.right, l.right + r.left};
    a[other] = (pair){l.left + r.right, r.left - l.right};
  }
  free(b);
  if (!made) {
    free(a);
    return false;
  }
  transform(with, a, size, true);
  for (int64_t frame = 0; frame < frames; frame++) a[frame].left /= (double)size, a[frame].right /= (double)size;
  *both = (sound){frames, a};
  return true;
}

/* body.py */

enum { RUN = 128 }; /* frames between which a mode is computed from the one before */

static bool body_of(circle *with, const image *of, double rate_hz, double size, sound *own) {
  if (of->impulse_frames) {
    const int32_t *stored = (const int32_t *)of + of->impulse;
    int64_t frames = of->impulse_frames, channels = of->impulse_channels;
    *own = (sound){frames, malloc((size_t)frames * sizeof(pair))};
    if (!own->samples) return false;
    for (int64_t frame = 0; frame < frames; frame++)
      own->samples[frame] = (pair){of->impulse_unit * stored[frame * channels], of->impulse_unit * stored[frame * channels + channels - 1]};
    if (!resample(with, own, of->impulse_hz / size, rate_hz)) return false;
    int64_t longest = (int64_t)(LONGEST_IMPULSE_S * rate_hz);
    if (own->frames > longest) {
      own->frames = longest;
      fade(own);
    }
    return as_loud(with, own, rate_hz);
  }
  const double *hz = (const double *)of + of->body, *decay = hz + of->body_modes, *left = decay + of->body_modes, *right = left + of->body_modes;
  double highest_hz = fmin(BODY_HIGHEST_HZ, 0.45 * rate_hz);
  int64_t runs = (int64_t)ceil(of->body_s * size * rate_hz / RUN);
  *own = (sound){runs * RUN, calloc((size_t)(runs * RUN), sizeof(pair))};
  if (!own->samples) return false;
  for (int64_t mode = 0; mode < of->body_modes; mode++) {
    if (hz[mode] / size >= highest_hz) continue;
    double omega = 2 * PI * hz[mode] / size, sigma = decay[mode] / size, fall = exp(-sigma / rate_hz);
    pair step = {fall * cos(omega / rate_hz), fall * sin(omega / rate_hz)};
    for (int64_t run = 0; run < runs; run++) {
      double time_s = (double)run * RUN / rate_hz, level = exp(-sigma * time_s);
      pair now = {level * cos(omega * time_s), level * sin(omega * time_s)};
      for (pair *each = own->samples + run * RUN, *end = each + RUN; each < end; each++) {
        each->left += left[mode] / size * now.right, each->right += right[mode] / size * now.right;
        now = times(now, step);
      }
    }
  }
  if (!without_subsonic(with, own, of->body_subsonic_hz / size, rate_hz)) return false;
  fade(own);
  return as_loud(with, own, rate_hz);
}

/* room.py */

extern const int32_t *const noise; /* (frames, 2), in units */

static void add_image(sound *own, const double listener_m[3], const double image_m[3], double direct_m, double last) {
  for (int32_t side = 0; side < 2; side++) {
    double square = 0;
    for (int32_t axis = 0; axis < 3; axis++) {
      double apart = image_m[axis] - listener_m[axis] - (axis == 1 ? (side ? 0.5 : -0.5) * ROOM_APART_M : 0);
      square += apart * apart;
    }
    double way_m = sqrt(square), place = (way_m - direct_m) / SOUND_M_S * ROOM_HZ;
    if (place < 0 || place >= last) continue;
    int64_t before = (int64_t)place;
    double share = place - (double)before;
    for (int32_t each = 0; each < 2; each++) {
      if (before + each >= own->frames) continue;
      double part = (each ? share : 1 - share) * direct_m / way_m;
      if (side) own->samples[before + each].right += part;
      else own->samples[before + each].left += part;
    }
  }
}

static const double sides[] = ROOM_SIDES_M, source[] = ROOM_SOURCE, listener[] = ROOM_LISTENER;
static const double bands_hz[] = ROOM_BANDS_HZ, bands_t60[] = ROOM_BANDS_T60;
enum { BANDS = sizeof bands_hz / sizeof *bands_hz };

/* The weight of a band at a frequency: linear over octaves between bands, and as at the ends beyond. */
static double band_share(int32_t band, double hz) {
  double octave = log2(fmax(hz, 1));
  if (octave <= log2(bands_hz[0])) return band == 0;
  if (octave >= log2(bands_hz[BANDS - 1])) return band == BANDS - 1;
  for (int32_t each = 0; each + 1 < BANDS; each++) {
    double low = log2(bands_hz[each]), high = log2(bands_hz[each + 1]);
    if (octave > high) continue;
    double way = (octave - low) / (high - low);
    return band == each ? 1 - way : band == each + 1 ? way : 0;
  }
  return 0;
}

static bool decay_bands(circle *with, sound *own, double t60_s) {
  int64_t size = room_for(2 * own->frames);
  pair *total = calloc((size_t)size, sizeof(pair)), *fallen = malloc((size_t)own->frames * sizeof(pair));
  bool made = total && fallen;
  for (int32_t band = 0; made && band < BANDS; band++) {
    for (int64_t frame = 0; frame < own->frames; frame++) {
      double fall = exp(-log(1000) / (t60_s * bands_t60[band]) * ((double)frame / ROOM_HZ));
      fallen[frame] = (pair){own->samples[frame].left * fall, own->samples[frame].right * fall};
    }
    pair *z = spectrum(with, fallen, own->frames, size);
    made = z;
    for (int64_t k = 0; made && k <= size / 2; k++) {
      double share = band_share(band, (double)k * ROOM_HZ / (double)size);
      int64_t other = (size - k) % size;
      total[k].left += share * z[k].left, total[k].right += share * z[k].right;
      if (other != k) total[other].left += share * z[other].left, total[other].right += share * z[other].right;
    }
    free(z);
  }
  if (made) {
    transform(with, total, size, true);
    for (int64_t frame = 0; frame < own->frames; frame++)
      own->samples[frame] = (pair){total[frame].left / (double)size, total[frame].right / (double)size};
  }
  free(total);
  free(fallen);
  return made;
}

static bool room_of(circle *with, double t60_s, double rate_hz, sound *own) {
  double sides_m[3], source_m[3], listener_m[3], volume_m3 = 1, shortest_m = INFINITY, square = 0;
  for (int32_t axis = 0; axis < 3; axis++) {
    sides_m[axis] = sides[axis] * sqrt(t60_s / 0.5);
    source_m[axis] = source[axis] * sides_m[axis], listener_m[axis] = listener[axis] * sides_m[axis];
    volume_m3 *= sides_m[axis];
    shortest_m = fmin(shortest_m, sides_m[axis]);
    square += (source_m[axis] - listener_m[axis]) * (source_m[axis] - listener_m[axis]);
  }
  double mixing_s = ROOM_MIXING_S * sqrt(volume_m3), direct_m = sqrt(square);
  int64_t frames = (int64_t)rint(t60_s * ROOM_HZ), furthest = (int64_t)ceil((mixing_s * SOUND_M_S + direct_m) / (2 * shortest_m)) + 1;
  *own = (sound){frames, calloc((size_t)frames, sizeof(pair))};
  if (!own->samples) return false;
  double last = fmin((double)frames, mixing_s * ROOM_HZ);
  int64_t many = 2 * (2 * furthest + 1); /* of an axis: by turns, to both sides */
  for (int64_t number = 1; number <= many * many * many; number++) {
    int64_t left_over = number - 1;
    double image_m[3];
    bool itself = true;
    for (int32_t axis = 0; axis < 3; axis++, left_over /= many) {
      int64_t turn = left_over % many / 2 - furthest;
      bool mirrored = left_over % 2;
      image_m[axis] = 2 * (double)turn * sides_m[axis] + (mirrored ? -1 : 1) * source_m[axis];
      itself = itself && !turn && !mirrored;
    }
    if (!itself) add_image(own, listener_m, image_m, direct_m, last);
  }
  double level = direct_m * sqrt(4 * PI * SOUND_M_S / volume_m3 / ROOM_HZ);
  for (int64_t frame = 0; frame < frames; frame++) {
    double turn = fmin(fmax(2 * ((double)frame / ROOM_HZ) / mixing_s - 1, 0), 1) * (PI / 2), c = cos(turn), s = level * NOISE_UNIT * sin(turn);
    pair *each = own->samples + frame;
    *each = (pair){each->left * c + noise[2 * frame] * s, each->right * c + noise[2 * frame + 1] * s};
  }
  if (!decay_bands(with, own, t60_s) || !without_subsonic(with, own, ROOM_SUBSONIC_HZ, ROOM_HZ)) return false;
  fade(own);
  return resample(with, own, ROOM_HZ, rate_hz) && as_loud(with, own, rate_hz);
}

/* Both */

bool responses_begin(responses *own, const image *of, double rate_hz, double size, double t60_s) {
  memset(own, 0, sizeof *own);
  circle with = {0, NULL};
  bool body = of->body_modes || of->impulse_frames, made = true;
  if (body) made = body_of(&with, of, rate_hz, size, &own->of[PART_BODY]);
  if (made) made = room_of(&with, t60_s, rate_hz, &own->of[PART_ROOM]);
  if (made && body) made = in_series(&with, &own->of[PART_BODY], &own->of[PART_ROOM], &own->of[PART_BOTH]);
  pair one = {1, 1};
  sound nothing = {1, &one};
  const sound *all[] = {&nothing, &own->of[PART_BODY], &own->of[PART_ROOM], &own->of[PART_BOTH]};
  const int32_t longest[] = {0, PART_BODY, PART_ROOM, PART_BOTH}; /* frequencies depend on the length */
  for (int32_t which = 1; made && which < POWER_CASES; which++) {
    int64_t frames = own->of[longest[which]].frames;
    if (which & POWER_BODY && !body) continue;
    const sound silent = {0, NULL}, *heard[] = {all[0], which & POWER_BODY ? all[1] : &silent, which & POWER_ROOM ? all[2] : &silent, which == 3 ? all[3] : &silent};
    made = noise_powers(&with, heard, 1 + MIX_PARTS, frames, rate_hz, own->powers[which]);
  }
  free(with.turns);
  return made;
}

void responses_end(responses *own) {
  for (int32_t which = 0; which < MIX_PARTS; which++) {
    free(own->of[which].samples);
    own->of[which] = (sound){0, NULL};
  }
}

/* curves.py */

/* The integral up to a place between multiples of a step, from those up to the multiples. */
static double area_at(const double *areas, int64_t count, double place) {
  if (place >= (double)(count - 1)) return areas[count - 1];
  int64_t before = (int64_t)place;
  return areas[before] + (place - (double)before) * (areas[before + 1] - areas[before]);
}

bool responses_curves(const image *of, double body_size, double *curves) {
  circle with = {0, NULL};
  sound body = {0, NULL};
  bool made = body_of(&with, of, CURVES_HZ, body_size, &body);
  int64_t least = (int64_t)rint(CURVES_HZ / CURVES_FINEST_HZ), size = room_for(body.frames > least ? body.frames : least), count = size / 2 + 1;
  pair *z = made ? spectrum(&with, body.samples, body.frames, size) : NULL, one = {1, 1};
  double *areas = calloc((size_t)(3 * count), sizeof(double)), step_hz = (double)CURVES_HZ / (double)size, last[3] = {0}, powers[4];
  const sound nothing = {1, &one}, *both[] = {&nothing, &body};
  made = z && areas && noise_powers(&with, both, 2, body.frames, CURVES_HZ, powers);
  for (int64_t k = 0; made && k < count; k++) {
    pair a = z[k], b = z[(size - k) % size];
    pair left = {0.5 * (a.left + b.left), 0.5 * (a.right - b.right)}, right = {0.5 * (a.right + b.right), 0.5 * (b.left - a.left)};
    double rows[] = {0.5 * (left.left + right.left), 0.5 * (left.right + right.right),
                     0.5 * (left.left * left.left + left.right * left.right + right.left * right.left + right.right * right.right)};
    for (int32_t row = 0; row < 3; row++) {
      if (k) areas[row * count + k] = areas[row * count + k - 1] + 0.5 * (rows[row] + last[row]) * step_hz;
      last[row] = rows[row];
    }
  }
  if (made) {
    curves[BODY_CROSS] = powers[1];
    curves[BODY_STEP] = 0;
    double sum = 0;
    for (int64_t frame = 0; frame < body.frames; frame++) curves[BODY_STEP] = fmax(curves[BODY_STEP], fabs(sum += body.samples[frame].left));
  }
  for (int32_t point = 0; made && point < BODY_POINTS; point++) {
    double low_hz = BODY_LOWEST_HZ * exp2((point - 0.5) / BODY_STEPS), high_hz = BODY_LOWEST_HZ * exp2((point + 0.5) / BODY_STEPS);
    for (int32_t row = 0; row < 3; row++) {
      const double *of_row = areas + row * count;
      curves[BODY_HEADER + row * BODY_POINTS + point] =
          (area_at(of_row, count, high_hz / step_hz) - area_at(of_row, count, low_hz / step_hz)) / (high_hz - low_hz);
    }
  }
  free(z);
  free(areas);
  free(body.samples);
  free(with.turns);
  return made;
}
