/* Why the board started, which start this is, and the watchdog. */
#ifndef RESET_H
#define RESET_H

#include <stdbool.h>
#include <stdint.h>

extern uint8_t reset_cause; /* RESET_... of the protocol */

/* Finds the cause, counts the start, turns the watchdog on. */
void reset_begin(void);

/* Low bits of the number of starts since power came on. */
uint8_t reset_boot(void);

/* To be called by every pass of the main loop. */
void reset_feed(void);

/* Called each millisecond from an interrupt: true when the main loop has not passed for 100 ms. */
bool reset_hung(void);

/* Bytes of stack never used. */
uint16_t reset_free_stack(void);

#endif
