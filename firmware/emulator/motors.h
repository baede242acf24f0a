/* The motor drivers of the emulated board: for what share of a pulse they drive or short a motor, from
   the levels of the pins. */
#ifndef EMULATED_MOTORS_H
#define EMULATED_MOTORS_H

#include "board_state.h"

/* Records an event for each motor for which these shares have changed. */
void motors_poll(board_t *board);

#endif
