/* Body and room as the convolver hears them, at their mixes, size and time.

   Mixes are followed by the audio thread, a part a quantum. Another size or time needs another response, which a thread
   computes beside the sound; while a host renders offline, the sound waits for it, so that it is the same each time. */

#ifndef LS_EFFECTS_H
#define LS_EFFECTS_H

#include "instrument.h"

bool effects_begin(instrument *); /* at its rate and its values; allocates; false where there is no memory */
double *effects_mixed(const instrument *); /* the latest mix; NULL: none, or it is not complete */
void effects_reset(instrument *, double *mixed); /* to a mixer at rest: nothing rings; the mix is kept where it is the wanted one */
bool effects_follow(instrument *); /* once a quantum; whether keys have other levels now */
bool effects_wait(const instrument *); /* whether a response is still to come */
double effects_tail_s(const instrument *);
void effects_end(instrument *);
void effects_free(instrument *); /* and what is kept from rate to rate */

#endif
