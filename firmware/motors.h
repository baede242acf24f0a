/* A motor on a driver with one of the kinds of inputs (DRIVER_... of the protocol). Duty in 1/32768. */
#ifndef MOTORS_H
#define MOTORS_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"

enum { ENABLE, IN1, IN2, MOTOR_PINS };

typedef struct {
    bit_t pins[MOTOR_PINS];
    pwm_t pwm[2]; /* of enable, or of in1 and in2; `compare` of the first is null before there are settings */
    uint8_t driver;
    bool reversed, inverted, brake;
    bool held; /* DRIVER_PULSED_INPUTS: driven, and not at rest since then */
} motor_t;

/* `pins`: enable, in1, in2, as in the settings. Driver and flags must be set before. */
void motors_configure(motor_t *motor, const uint8_t *pins);

void motors_set(motor_t *motor, int16_t duty);

/* Motor off; may be called from an interrupt. */
void motors_release(const motor_t *motor);

#endif
