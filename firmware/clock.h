/* Periods of the board's clock. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdbool.h>

/* Starts the clock and its alarms. */
void clock_start(void);

/* From the alarms of the clock. clock_sample: true when a sample is due. */
void clock_millisecond(void);
bool clock_sample(void);

/* True once per millisecond. */
bool clock_tick(void);

/* Period of the analog converter, 1032 us: sixteen readings take 16.5 ms, the measuring period of a
   Sharp distance sensor. */
#define CLOCK_SAMPLE_TICKS 258

#endif
