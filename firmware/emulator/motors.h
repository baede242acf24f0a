/* The motor drivers of the emulated board: duty and brake, from the chip's registers. */
#ifndef EMULATED_MOTORS_H
#define EMULATED_MOTORS_H

#include "board_state.h"

/* Records an event for each motor whose duty or brake has changed. */
void motors_poll(board_t *board);

#endif
