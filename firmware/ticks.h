/* Moments and spans of the board's clock, in ticks of 4 us. Three bytes are enough where four would
   cost a tenth of the image: they come round after 67 s, and nothing here waits so long. */
#ifndef TICKS_H
#define TICKS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __AVR__
typedef __uint24 ticks_t;
#else
typedef uint32_t ticks_t;
#endif

#define TICKS_PER_SECOND 250000UL
#define TICKS_PER_MS 250
#define TICKS_UNKNOWN 0xFFFFFF

/* True when `now` is not before `moment`. */
static inline bool ticks_due(ticks_t now, ticks_t moment)
{
    return ((now - moment) & (ticks_t)0xFFFFFF) < (ticks_t)0x800000;
}

#endif
