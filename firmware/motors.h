/* Two motors behind an L298N: an enable with PWM and two inputs each. Duty in 1/32768. */
#ifndef MOTORS_H
#define MOTORS_H

#include <stdint.h>

#include "protocol.h"

void motors_configure(const settings_t *settings);
void motors_set(uint8_t wheel, int16_t duty);

/* Both off at once; may be called from an interrupt. */
void motors_release(void);

#endif
