/* A gyro on the I2C bus of the emulated board. */
#ifndef EMULATED_GYRO_H
#define EMULATED_GYRO_H

#include "board_state.h"

/* Connects the gyro of the options, if any; after a reset of the board: what was under way is lost, and
   with the supply the gyro's registers too. */
void gyro_begin(board_t *board);
void gyro_reset(board_t *board, bool power);

/* Rates about x, y and z in units of 0.02 deg/s for inputs 0 to 2; input 3: a GYRO_... fault; from input
   GYRO_ACCELERATIONS on the accelerations along x, y and z in 1/16384 g. */
#define GYRO_ACCELERATIONS 4
void gyro_set(board_t *board, unsigned input, uint16_t value);

#endif
