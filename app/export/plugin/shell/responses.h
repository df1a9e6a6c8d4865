/* Impulse responses of an instrument's body and room at any rate, computed as engine/effects computes them. */

#ifndef LS_RESPONSES_H
#define LS_RESPONSES_H

#include "instrument.h"

typedef struct { double left, right; } pair; /* a sample of both channels, or a complex number */
typedef struct { int64_t frames; pair *samples; } sound;

typedef struct {
  sound of[MIX_PARTS];           /* without frames: not there */
  double powers[POWER_CASES][16]; /* of noise through two of: nothing, body, room, both */
} responses;

/* False where there is no memory. What it gives is freed by the other in any case. */
bool responses_begin(responses *, const image *, double rate_hz, double size, double t60_s);
void responses_end(responses *);

/* What a body of a size does to the loudness of keys (BODY_SLOTS), as engine/effects/curves.py. False: no memory. */
bool responses_curves(const image *, double size, double *curves);

#endif
