/* Cause and number of the present start, and the watchdog. */
#ifndef RESET_H
#define RESET_H

#include <stdbool.h>
#include <stdint.h>

extern uint8_t reset_cause; /* RESET_... of the protocol */

/* Determines the cause, counts the start, starts the watchdog. */
void reset_begin(void);

/* Low 4 bits of the number of starts. */
uint8_t reset_boot(void);

/* To be called when the main loop has done the work of a millisecond. */
void reset_feed(void);

/* To be called each millisecond from an interrupt: true when the main loop has hung for 100 ms. */
bool reset_hung(void);

#endif
