/* Drums of an instrument, computed from their parameters as app/instrument/drum_keys.py computes them. */

#ifndef LS_DRUMS_H
#define LS_DRUMS_H

#include "instrument.h"

int64_t drums_slots(const image *);      /* of the instrument's table behind what the image holds of it */
bool drums_begin(instrument *);          /* allocates; false where there is no memory */
void drums_end(instrument *);
void drums_follow(instrument *, int64_t which, double value); /* one of the instrument's values has changed */
void drums_prepare(instrument *);        /* what is struck or heard in the next quantum follows */

#endif
