#include "motors.h"

/* The timer drives the pin only between 0 and full duty, which fast PWM cannot produce exactly. */
static void enable(const motor_t *motor, uint8_t duty)
{
    if (!motor->pwm.compare)
        return;
    if (motor->inverted)
        duty = (uint8_t)~duty;
    *motor->pwm.compare = duty; /* the high byte of a 16-bit timer stays 0 */
    board_write(&motor->pins[ENABLE], OUTPUT, duty == UINT8_MAX);
    board_write(&motor->pwm.connect, 0, (uint8_t)(duty + 1) > 1);
}

void motors_configure(motor_t *motor, const uint8_t *pins)
{
    for (uint8_t i = 0; i < MOTOR_PINS; i++) {
        pin_t pin;
        board_pin(pins[i], &pin);
        motor->pins[i] = pin.bit;
        if (i == ENABLE) {
            board_pwm(pin.pwm, &motor->pwm);
            enable(motor, 0);
        }
        board_write(&motor->pins[i], DIRECTION, true);
    }
}

void motors_set(const motor_t *motor, int16_t duty)
{
    uint16_t size = (uint16_t)(duty < 0 ? -duty : duty);
    uint8_t pwm = (uint8_t)((size - (size >> 8) + 64) >> 7); /* 255 / 32768, rounded */
    bool forward = (duty > 0) != motor->reversed;
    if (!motor->pwm.compare)
        return;
    board_write(&motor->pins[IN1], OUTPUT, pwm != 0 && forward);
    board_write(&motor->pins[IN2], OUTPUT, pwm != 0 && !forward);
    enable(motor, pwm == 0 && motor->brake ? UINT8_MAX : pwm);
}

void motors_release(const motor_t *motor)
{
    enable(motor, 0);
}
