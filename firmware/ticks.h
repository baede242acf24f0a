/* Times and durations of the board's clock, in ticks of 4 us. They wrap after 4.8 hours: only differences
   of times that are closer together have a meaning. */
#ifndef TICKS_H
#define TICKS_H

#include <stdbool.h>
#include <stdint.h>

typedef uint32_t ticks_t;

#define TICKS_PER_SECOND 250000UL
#define TICKS_PER_MS 250

/* True when `now` is not before `moment`. */
static inline bool ticks_due(ticks_t now, ticks_t moment)
{
    return (int32_t)(now - moment) >= 0;
}

#endif
