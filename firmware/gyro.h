/* A gyro on the I2C bus: the angle that it has turned about one of its axes, summed 100 times a second. */
#ifndef GYRO_H
#define GYRO_H

#include <stdint.h>

#include "protocol.h"

void gyro_configure(const settings_t *settings);

/* To be called each millisecond. */
void gyro_tick(void);

/* Low bits of the angle, in TURN_NANODEGREES. */
uint16_t gyro_turn(void);

/* FLAG_GYRO_... of what makes the angle wrong, or made it wrong lately; 0 without a gyro. */
uint16_t gyro_faults(void);

#endif
