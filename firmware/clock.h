/* Board time: timer 1 at 4 us per tick. Only differences have a meaning. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

#include "ticks.h"

void clock_start(void);

/* From the timer's interrupts. */
void clock_overflow(void);
void clock_millisecond(void);
void clock_sample(void);

/* Present time. May be called with interrupts on or off. */
ticks_t clock_now(void);

/* True once per millisecond. */
bool clock_tick(void);

/* Period of the analog converter, 1032 us: sixteen readings take 16.5 ms, the measuring period of a
   Sharp distance sensor. */
#define CLOCK_SAMPLE_TICKS 258

#endif
