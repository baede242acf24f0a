/* HC-SR04 sensors at the pins of the emulated board. */
#ifndef EMULATED_SONARS_H
#define EMULATED_SONARS_H

#include "board_state.h"

/* Connects the sensors of the options; after a reset: their echoes are low again. */
void sonars_begin(board_t *board);
void sonars_reset(board_t *board);

/* Length of the echo of a sensor's target in units of 1 us, or SONAR_SILENT or SONAR_ENDLESS. */
void sonars_set(board_t *board, unsigned sonar, uint16_t us);

#endif
