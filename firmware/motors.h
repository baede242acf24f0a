/* A motor behind an L298N: an enable with PWM and two inputs. Duty in 1/32768. */
#ifndef MOTORS_H
#define MOTORS_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"

enum { ENABLE, IN1, IN2, MOTOR_PINS };

typedef struct {
    bit_t pins[MOTOR_PINS];
    pwm_t pwm; /* compare is null before there are settings */
    bool reversed, inverted, brake;
} motor_t;

/* `pins` are enable, in1, in2, as they stand in the settings; the flags are set already. */
void motors_configure(motor_t *motor, const uint8_t *pins);

void motors_set(const motor_t *motor, int16_t duty);

/* Off at once; may be called from an interrupt. */
void motors_release(const motor_t *motor);

#endif
