/* The board's time: timer 1 at 4 us a tick; only differences mean anything. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

#include "ticks.h"

void clock_start(void);

/* From the timer's interrupts. */
void clock_overflow(void);
void clock_millisecond(void);
void clock_sample(void);

/* Time now. May be called with interrupts on or off. */
ticks_t clock_now(void);

/* True once for each millisecond that has begun. */
bool clock_tick(void);

/* The analog converter's turn comes every 1032 us: sixteen readings last 16.5 ms, the period in
   which a Sharp distance sensor takes a new measurement. */
#define CLOCK_SAMPLE_TICKS 258

#endif
