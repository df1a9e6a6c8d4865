/* See drums.h. The physics is that of engine/resonators: drum.py, surface.py and air.py, whose names are used here.

   A key's block of the table is written again when one of its values has changed and the key is struck or heard. */

#include "drums.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

_Static_assert(sizeof(drum) == DRUM_BYTES && sizeof(drum_key) == DRUM_KEY_BYTES, "as image.py writes");

enum { CIRCLE, RECTANGLE, BAR };
enum { MODES_MOVED = 1, LOSSES_MOVED = 2, PLACES_MOVED = 4 }; /* what of a key has changed since it was written */

struct drums {
  double modulus, decay, brightness_decay, points[2];
  int8_t stale[KEYS];
  bool any_stale;
  int64_t capacity, most; /* modes of a key, and of the longest list of a surface */
  double *struck, *slopes; /* (drums, most): shapes at the places of blows, and of circles J_m' at the edge */
  double *bessels; /* J_m, m from -TERMS to `orders`, of all multiples of STEP up to `furthest` */
  int64_t orders;
  double furthest;
  double *work, *radiated; /* (3, most): ω, mass and radiated losses; (KEYS, capacity) */
  int32_t *order, *modes; /* (most,), and (KEYS, capacity): places in the list of the surface */
};

static const drum *drums_of(const image *of) { return (const drum *)((const slot *)of + of->drums); }
static const drum_key *keys_of(const image *of) { return (const drum_key *)((const slot *)of + of->drum_keys); }
static const double *list(const image *of, const drum *own, int64_t row) { return (const double *)of + own->list + row * own->count; }

int64_t drums_slots(const image *of) { return of->drums ? KEYS + KEYS * (DRUM_HEADER + DRUM_ROWS * of->modes) : 0; }

/* Special functions: all orders at once, from a high one down (Miller); J0 + 2 J2 + 2 J4 + ... = 1. */

typedef struct { double wanted, first, second, struve; } bessel_values; /* J_m, J_0, J_1, and Struve's H_1 */

static bessel_values bessel(int64_t m, double x) {
  double largest = fmax((double)m, x), bend = cbrt(x);
  if (x < 1e-9) return (bessel_values){m == 0, 1, x / 2, 0};
  if ((double)m > x + 12 * bend + 20) return (bessel_values){0};
  double above = 0, here = 1e-300, sum = 0, struve = 0, wanted = 0, second = 0;
  for (int64_t order = 2 * (int64_t)(largest / 2 + 4 * cbrt(largest) + 6); order > 0; order--) {
    if (order == m) wanted = here;
    if (order == 1) second = here;
    if (order % 2 == 0) sum += 2 * here, struve += here / (double)(4 * (order / 2) * (order / 2) - 1);
    double below = 2 * (double)order / x * here - above;
    above = here, here = below;
  }
  if (m == 0) wanted = here;
  sum += here;
  double first = here / sum;
  return (bessel_values){wanted / sum, first, second / sum, 2 / PI * (1 - first) + 4 / PI * struve / sum};
}

#define STEP 0.1
enum { TERMS = 4 };

static int64_t columns(const struct drums *with) { return with->orders + 2 * TERMS + 1; }

static void fill(struct drums *with) {
  for (int64_t step = 0; step <= (int64_t)(with->furthest / STEP) + 1; step++)
    for (int64_t m = -TERMS; m <= with->orders + TERMS; m++) {
      double found = bessel(m < 0 ? -m : m, (double)step * STEP).wanted;
      with->bessels[step * columns(with) + m + TERMS] = m < 0 && m % 2 ? -found : found;
    }
}

/* J_m by Taylor's series, whose derivatives are of other orders: to 3e-9. */
static double bessel_near(const struct drums *with, int64_t m, double x) {
  if (x > with->furthest || m > with->orders) return bessel(m, x).wanted;
  int64_t step = (int64_t)(x / STEP + 0.5);
  const double *j = with->bessels + step * columns(with) + m + TERMS;
  double d = (x - (double)step * STEP) / 2, two = d * d / 2, three = two * d / 3, four = three * d / 4;
  return j[0] + d * (j[-1] - j[1]) + two * (j[-2] - 2 * j[0] + j[2]) + three * (j[-3] - 3 * j[-1] + 3 * j[1] - j[3]) +
         four * (j[-4] - 4 * j[-2] + 6 * j[0] - 4 * j[2] + j[4]);
}

/* Surfaces */

static double held_across(const drum *own) { return own->shape == BAR ? 1 : 1 - own->poisson * own->poisson; }
static double mass_of(const drum *own) { return own->density_kg_m3 * own->thickness_m; }
static double bending_of(const drum *own) { return own->youngs_modulus_pa * pow(own->thickness_m, 3) / (12 * held_across(own)); }
static double radius_of(const drum *own) { return (own->length_m + own->width_m) / 4; }
static double area_of(const drum *own) { return own->shape == CIRCLE ? PI * radius_of(own) * radius_of(own) : own->length_m * own->width_m; }

static double wavenumber(const image *of, const drum *own, int64_t mode) {
  double m = list(of, own, 1)[mode] * PI / own->length_m, n = list(of, own, 2)[mode] * PI / own->width_m;
  return own->shape == CIRCLE ? list(of, own, 0)[mode] / radius_of(own) : sqrt(m * m + n * n);
}

static double of_sine(double m, double turn) {
  double side = m * PI, away = fabs(turn), half = (away - side) / 2, sign = fmod(m - 1, 4) < 2 ? 1 : -1;
  if (fmod(m, 2) == 0 && turn <= 0) sign = turn < 0 ? -sign : 0;
  return sign * side / (side + away) * (half == 0 ? 1 : sin(half) / half);
}

/* Surface.transform along the first axis: at wavenumber `along`, which may be negative. */
static double transformed(const image *of, const struct drums *with, const drum *own, const double *slopes, int64_t mode, double along) {
  double m = list(of, own, 1)[mode], n = list(of, own, 2)[mode];
  if (own->shape != CIRCLE) return 2 * of_sine(m, along * own->length_m) * (n == 0 ? sqrt(0.5) : of_sine(n, 0));
  if (n != 0) return 0; /* of a sine */
  double z = list(of, own, 0)[mode], s = fabs(along) * radius_of(own), slope = slopes[mode];
  double hankel = fabs(z - s) < 1e-6 * z ? slope * slope / 2 * (2 - s / z) : -z * slope * bessel_near(with, (int64_t)m, s) / (z * z - s * s);
  double height = (m == 0 ? 1 : sqrt(2)) / fabs(slope), turned = along < 0 && fmod(m, 2) == 1 ? -1 : 1;
  return 2 * height * hankel * turned;
}

static double shape_at(const image *of, const drum *own, const double *slopes, int64_t mode) {
  double m = list(of, own, 1)[mode], n = list(of, own, 2)[mode];
  if (own->shape != CIRCLE)
    return 2 * sin(PI * m * (1 + own->x) / 2) * (n == 0 ? sqrt(0.5) : sin(PI * n * (1 + own->y) / 2));
  double r = sqrt(own->x * own->x + own->y * own->y), angle = m * atan2(own->y, own->x);
  double height = (m == 0 ? 1 : sqrt(2)) / fabs(slopes[mode]);
  return bessel((int64_t)m, list(of, own, 0)[mode] * r).wanted * height * (n != 0 ? sin(angle) : cos(angle));
}

static double split(const image *of, const drum *own, int64_t mode) {
  double m = list(of, own, 1)[mode], side = m == 0 ? 0 : list(of, own, 2)[mode] != 0 ? 1 : -1;
  double ellipticity = (own->length_m - own->width_m) / (own->length_m + own->width_m);
  return own->shape == CIRCLE ? 1 + side * ((m == 1 ? ellipticity / 2 : 0) + own->uneven / 2) : 1;
}

/* Air */

/* Of one of two functions of ka, which the image has as Chebyshev polynomials of its square. */
static double air_of(const image *of, const drum *own, int64_t which, int64_t mode, double ka) {
  const double *row = (const double *)of + own->air_list + ((which ? own->air_modes : 0) + mode) * own->air_terms;
  double share = fmin(ka / own->air_reach, 1), t = 2 * share * share - 1, one = 0, two = 0;
  for (int64_t term = own->air_terms - 1; term > 0; term--) {
    double next = 2 * t * one - two + row[term];
    two = one, one = next;
  }
  return t * one - two + row[0];
}

/* The impedance of a shell's column of air less that of a piston in a baffle, of ρc: its real and imaginary parts. */
static void column(double k, double size_m, double shell_m, double *real, double *imaginary) {
  double ka = k * size_m, falls = exp(-ka * ka / 2), turn = -2 * k * (shell_m + BEYOND_THE_END * size_m);
  double x = falls * cos(turn), y = falls * sin(turn), whole = (1 + x) * (1 + x) + y * y;
  bessel_values at = bessel(1, 2 * ka);
  *real = (1 - x * x - y * y) / whole - (1 - at.second / ka);
  *imaginary = -2 * y / whole - at.struve / ka;
}

/* Modes: as DrumParameters.modes and DrumModes.of, without damping. They are many, or none. */
static int64_t solve(const image *of, struct drums *with, const drum *own, const double *slopes, double highest_hz, int64_t most) {
  double mu = mass_of(own), bending = bending_of(own), tension = own->tension_n_m, air = own->air_kg_m3;
  double load = mu * pow(2 * PI * highest_hz, 2), area = area_of(own), size_m = sqrt(area / PI);
  double reach = (air ? 1.2 : 1) * sqrt(2 * load / (tension + sqrt(tension * tension + 4 * bending * load)));
  double density = own->length_m * own->width_m / (4 * PI) * (own->shape == CIRCLE ? PI / 4 : 1);
  if (density * reach * reach > MOST_SURFACE_MODES) reach = sqrt(2.5 * (double)(most + 50) / density);
  double *omega = with->work, *masses = omega + with->most, *radiated = masses + with->most;
  int64_t low = -1, found = 0;
  double before = 0;
  for (int64_t mode = 0; mode < own->count; mode++) {
    double kappa = wavenumber(of, own, mode), squared = kappa * kappa, mass = mu;
    if (kappa > reach * (1 + 1e-9)) break;
    double stiffness = tension * squared + bending * squared * squared, sigma = 0;
    if (own->shape == CIRCLE && kappa == before && mode) {
      mass = masses[mode - 1], sigma = radiated[mode - 1]; /* the other of a pair */
    } else if (air) {
      bool exact = kappa * size_m < AIR_EXACT;
      low++;
      for (int turn = 0; turn < AIR_ROUNDS; turn++) {
        double k = sqrt(stiffness / mass) / AIR_M_S;
        double load_m = exact && turn >= AIR_ROUNDS - AIR_EXACT_ROUNDS ? size_m * air_of(of, own, 0, low, k * size_m)
                                                                       : 1 / sqrt(fmax(squared - k * k, 0.01 * squared));
        mass = mu + AIR_SIDES * air * load_m;
      }
      double at = sqrt(stiffness / mass), ka = at / AIR_M_S * size_m;
      if (exact) sigma = AIR_SIDES * air * at * size_m * ka * air_of(of, own, 1, low, ka) / (2 * mass);
    }
    double volume = own->shell_m || own->cavity_m3 ? transformed(of, with, own, slopes, mode, 0) : 0;
    if (own->shell_m && volume * volume > LEAST_VOLUME) {
      double still = mass, moved = air * volume * volume, real = 0, imaginary = 0;
      for (int turn = 0; turn < COLUMN_ROUNDS; turn++) {
        double k = sqrt(stiffness / mass) / AIR_M_S;
        column(k, size_m, own->shell_m, &real, &imaginary);
        mass = (mass + fmax(still + moved * imaginary / k, mu / 2)) / 2;
      }
      sigma = fmax(sigma * 2 * still + moved * AIR_M_S * real, 0) / (2 * mass);
    }
    double spring = own->cavity_m3 ? AIR_KG_M3 * AIR_M_S * AIR_M_S / own->cavity_m3 * volume * volume * area / mass : 0;
    before = kappa, masses[mode] = mass, radiated[mode] = sigma;
    omega[mode] = sqrt(stiffness / mass + spring) * split(of, own, mode);
    if (omega[mode] >= 2 * PI * highest_hz) continue;
    int64_t place = found++; /* they come nearly in order */
    for (; place > 0 && omega[with->order[place - 1]] > omega[mode]; place--) with->order[place] = with->order[place - 1];
    with->order[place] = (int32_t)mode;
  }
  return found < most ? found : most;
}

/* ω of the mode that gives a drum its pitch; 0: it has none. */
static double principal(const image *of, struct drums *with, const drum *own, const double *slopes) {
  double side = PI / own->length_m, other = PI / own->width_m;
  double across = own->shape == CIRCLE ? 2 * J01 / own->length_m : sqrt(side * side + other * other);
  double in_vacuo_hz = across * sqrt((own->tension_n_m + bending_of(own) * across * across) / mass_of(own)) / (2 * PI);
  int64_t modes = solve(of, with, own, slopes, LOW_MODES_HZ * in_vacuo_hz, (int64_t)LOW_MODES), place = 0;
  if (!modes) return 0;
  if (own->cavity_m3 && own->shape == CIRCLE)
    while (place < modes && list(of, own, 1)[with->order[place]] != 1) place++;
  return with->work[with->order[place < modes ? place : 0]];
}

static bool within(double value, double low, double high) { return value >= low && value <= high; }

static bool possible(const drum *own) {
  double shorter = own->shape == BAR ? own->length_m : fmin(own->length_m, own->width_m);
  return within(own->length_m, LENGTH_LOW, LENGTH_HIGH) && within(own->width_m, WIDTH_LOW, WIDTH_HIGH) &&
         within(own->youngs_modulus_pa, MODULUS_LOW, MODULUS_HIGH) && within(own->tension_n_m, TENSION_LOW, TENSION_HIGH) &&
         within(own->d1_kg_m2_s, D1_LOW, D1_HIGH) && within(own->d3_kg_s, D3_LOW, D3_HIGH) && own->thickness_m <= shorter / 10;
}

/* As `drum_keys.tuned`: the drum is changed to that of a key. How many modes it has; 0: it is impossible. */
static int64_t tune(const image *of, struct drums *with, drum *own, const double *slopes, double ratio) {
  if (ratio != 1 && own->tension_n_m == 0) {
    own->length_m /= sqrt(ratio), own->width_m /= sqrt(ratio);
  } else if (ratio != 1) {
    double wanted = ratio * principal(of, with, own, slopes), factor = ratio * ratio, at_rest = own->tension_n_m;
    for (int round = 0; round < TUNINGS; round++) {
      own->tension_n_m = at_rest * factor;
      double found = possible(own) ? principal(of, with, own, slopes) : 0;
      if (!(wanted > 0 && found > 0)) return 0;
      if (fabs(wanted / found - 1) < NEAR) break;
      factor *= pow(wanted / found, 2);
    }
    own->tension_n_m = at_rest * factor;
  }
  int64_t found = possible(own) ? solve(of, with, own, slopes, of->highest_hz, MOST_DRUM_MODES) : 0;
  return found < with->capacity ? found : with->capacity;
}

/* Blocks of the table */

static drum of_key(const instrument *own, int64_t key) {
  drum found = drums_of(own->of)[keys_of(own->of)[key].drum];
  found.youngs_modulus_pa *= own->drums->modulus;
  found.d1_kg_m2_s *= own->drums->decay, found.d3_kg_s *= own->drums->brightness_decay;
  return found;
}

static void write_modes(instrument *own, int64_t key, slot *block) {
  const image *of = own->of;
  struct drums *with = own->drums;
  const drum_key *played = &keys_of(of)[key];
  const double *slopes = with->slopes + played->drum * with->most, *struck = with->struck + played->drum * with->most;
  drum tuned = of_key(own, key);
  int64_t modes = possible(&tuned) ? tune(of, with, &tuned, slopes, played->ratio) : 0;
  double mu = mass_of(&tuned), mass_kg = mu * area_of(&tuned);
  double coupling = tuned.youngs_modulus_pa * tuned.thickness_m / (2 * held_across(&tuned)) / mu;
  block[DRUM_MODES].whole = modes;
  block[DRUM_MALLET_KG].real = tuned.mallet_kg, block[DRUM_CONTACT_S].real = tuned.contact_s, block[DRUM_MASS_KG].real = mass_kg;
  block[DRUM_SOFTEST_M_S].real = played->softest_m_s, block[DRUM_HARDEST_M_S].real = played->hardest_m_s;
  for (int64_t place = 0; place < modes; place++) {
    int64_t mode = with->order[place];
    double kappa = wavenumber(of, &tuned, mode), mass = with->work[with->most + mode], turn = kappa * tuned.radius_m;
    double stretch = kappa * kappa * mu / mass, spread = turn < 1e-6 ? 1 : 2 * bessel_near(with, 1, turn) / turn;
    slot *row = block + DRUM_HEADER + place;
    row[0].real = pow(with->work[mode], 2);
    row[2 * modes].real = coupling * stretch, row[3 * modes].real = stretch;
    row[4 * modes].real = struck[mode] * sqrt(mu / mass) * spread / mass_kg;
    with->modes[key * with->capacity + place] = (int32_t)mode;
    with->radiated[key * with->capacity + place] = with->work[2 * with->most + mode];
  }
}

static void write_losses(instrument *own, int64_t key, slot *block) {
  drum now = of_key(own, key);
  int64_t modes = block[DRUM_MODES].whole;
  double size = keys_of(own->of)[key].ratio, mu = mass_of(&now);
  if (now.tension_n_m == 0) now.length_m /= sqrt(size), now.width_m /= sqrt(size);
  for (int64_t place = 0; place < modes; place++) {
    int64_t which = key * own->drums->capacity + place;
    double squared = pow(wavenumber(own->of, &now, own->drums->modes[which]), 2);
    slot *row = block + DRUM_HEADER + place;
    double lost = (now.d1_kg_m2_s + now.d3_kg_s * squared) * row[3 * modes].real / squared / (2 * mu);
    row[modes].real = lost + own->drums->radiated[which];
  }
}

/* As DrumModes.radiated. */
static void write_places(instrument *own, int64_t key, slot *block) {
  const image *of = own->of;
  const drum_key *played = &keys_of(of)[key];
  const double *slopes = own->drums->slopes + played->drum * own->drums->most;
  drum now = of_key(own, key);
  if (now.tension_n_m == 0) now.length_m /= sqrt(played->ratio), now.width_m /= sqrt(played->ratio);
  int64_t modes = block[DRUM_MODES].whole, points = own->table[TABLE_POINTS].whole;
  double area = area_of(&now);
  for (int64_t place = 0; place < modes; place++) {
    int64_t mode = own->drums->modes[key * own->drums->capacity + place];
    slot *row = block + DRUM_HEADER + place;
    double scale = sqrt(row[3 * modes].real) / wavenumber(of, &now, mode), k = sqrt(row[0].real) / AIR_M_S;
    double strength = AIR_KG_M3 * row[0].real / (2 * PI) * area * scale / FULL_SCALE_PA;
    for (int64_t point = 0; point < points; point++)
      row[(5 + point) * modes].real = strength * transformed(of, own->drums, &now, slopes, mode, k * (2 * own->drums->points[point] - 1));
  }
}

static void write_key(instrument *own, int64_t key) {
  int64_t slots = own->table[TABLE_DRUMS].whole, first = slots + KEYS + key * (DRUM_HEADER + DRUM_ROWS * own->drums->capacity);
  int8_t stale = own->drums->stale[key];
  slot *block = own->table + first;
  own->drums->stale[key] = 0;
  if (keys_of(own->of)[key].drum < 0) return;
  if (stale & MODES_MOVED) write_modes(own, key, block);
  if (stale & (MODES_MOVED | LOSSES_MOVED)) write_losses(own, key, block);
  if (stale & (MODES_MOVED | PLACES_MOVED)) write_places(own, key, block);
  drum now = of_key(own, key);
  own->table[slots + key].whole = block[DRUM_MODES].whole && possible(&now) ? first : 0;
}

void drums_follow(instrument *own, int64_t which, double value) {
  struct drums *with = own->drums;
  int8_t moved = 0;
  if (which == MODULUS_FACTOR) with->modulus = value, moved = MODES_MOVED;
  if (which == DECAY) with->decay = value, moved = LOSSES_MOVED;
  if (which == BRIGHTNESS_DECAY) with->brightness_decay = value, moved = LOSSES_MOVED;
  if (which == POINT || which == POINT + 1) with->points[which - POINT] = value, moved = PLACES_MOVED;
  for (int64_t key = 0; moved && key < KEYS; key++) with->stale[key] |= moved;
  with->any_stale |= moved != 0;
}

static void write_struck(instrument *own, const slot *event) {
  int64_t key = event[EVENT_KEY].whole;
  if (event[EVENT_KIND].whole == NOTE_ON && own->drums->stale[key]) write_key(own, key);
}

void drums_prepare(instrument *own) {
  const slot *player = own->player;
  if (!own->drums || !own->drums->any_stale) return;
  for (int64_t taken = player[PLAYER_TAKEN].whole; taken < player[PLAYER_PUSHED].whole; taken++)
    write_struck(own, player + PLAYER_EVENTS + taken % EVENTS * EVENT_SLOTS);
  for (int64_t place = 0; place < player[PLAYER_QUEUED].whole; place++)
    write_struck(own, player + PLAYER_QUEUE + place * EVENT_SLOTS);
  for (int64_t note = 0; note < MOST_NOTES; note++) {
    const slot *ringing = player + PLAYER_NOTES + note * NOTE_SLOTS;
    int64_t key = ringing[NOTE_KEY].whole;
    const slot *voice = (const slot *)(intptr_t)ringing[NOTE_VOICES].whole;
    bool listens = ringing[NOTE_STATE].whole == RINGS && voice && !voice[NEXT_WEIGHTS].whole; /* else it fades to other places yet */
    if (listens && own->drums->stale[key] & PLACES_MOVED) write_key(own, key);
  }
}

bool drums_begin(instrument *own) {
  const image *of = own->of;
  if (!of->drums) return true;
  struct drums *with = own->drums = calloc(1, sizeof *with);
  if (!with) return false;
  const drum *all = drums_of(of);
  for (int64_t each = 0; each < of->drum_count; each++) {
    with->most = all[each].count > with->most ? all[each].count : with->most;
    with->furthest = fmax(with->furthest, all[each].air_reach / 2);
  }
  with->orders = (int64_t)(with->furthest + 12 * cbrt(with->furthest)) + 20; /* beyond them it is nothing */
  with->capacity = of->modes;
  with->struck = calloc((size_t)(of->drum_count * with->most), sizeof(double));
  with->slopes = calloc((size_t)(of->drum_count * with->most), sizeof(double));
  with->bessels = calloc((size_t)(columns(with) * ((int64_t)(with->furthest / STEP) + 2)), sizeof(double));
  with->work = calloc((size_t)(3 * with->most), sizeof(double));
  with->radiated = calloc((size_t)(KEYS * with->capacity), sizeof(double));
  with->order = calloc((size_t)with->most, sizeof(int32_t));
  with->modes = calloc((size_t)(KEYS * with->capacity), sizeof(int32_t));
  if (!with->struck || !with->slopes || !with->bessels || !with->work || !with->radiated || !with->order || !with->modes) return false;
  fill(with);
  for (int64_t each = 0; each < of->drum_count; each++) {
    double *slopes = with->slopes + each * with->most, *struck = with->struck + each * with->most;
    for (int64_t mode = 0; mode < all[each].count; mode++) {
      if (all[each].shape == CIRCLE) slopes[mode] = -bessel((int64_t)list(of, &all[each], 1)[mode] + 1, list(of, &all[each], 0)[mode]).wanted;
      struck[mode] = shape_at(of, &all[each], slopes, mode);
    }
  }
  const slot *values = own->table + TABLE_VALUES;
  const int64_t followed[] = {MODULUS_FACTOR, DECAY, BRIGHTNESS_DECAY, POINT, POINT + 1};
  for (size_t each = 0; each < sizeof followed / sizeof *followed; each++) drums_follow(own, followed[each], values[followed[each]].real);
  own->table[TABLE_DRUMS].whole = of->table_slots;
  for (int64_t key = 0; key < KEYS; key++) write_key(own, key);
  with->any_stale = false;
  return true;
}

void drums_end(instrument *own) {
  struct drums *with = own->drums;
  own->drums = NULL;
  if (!with) return;
  free(with->struck), free(with->slopes), free(with->bessels), free(with->work), free(with->radiated), free(with->order), free(with->modes);
  free(with);
}
