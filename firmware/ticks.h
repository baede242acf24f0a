/* Times and durations of the board's clock, in ticks of 4 us. Three bytes, where four would cost a
   tenth of the image: they wrap after 67 s, longer than any duration used. */
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
