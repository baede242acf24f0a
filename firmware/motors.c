#include "motors.h"

#include "protocol.h"

static void enable(const motor_t *motor, uint8_t duty)
{
    board_set_duty(&motor->pins[ENABLE], &motor->pwm[0], motor->inverted ? (uint8_t)~duty : duty);
}

static void put_both(const motor_t *motor, uint8_t first, uint8_t second)
{
    board_set_duty(&motor->pins[IN1], &motor->pwm[0], first);
    board_set_duty(&motor->pins[IN2], &motor->pwm[1], second);
}

static bool pulses_inputs(const motor_t *motor)
{
    return motor->driver >= DRIVER_TWO_PWM;
}

void motors_configure(motor_t *motor, const uint8_t *pins)
{
    for (uint8_t i = 0; i < MOTOR_PINS; i++) {
        pin_t pin;
        motor->pins[i].mask = 0;
        if (!board_pin(pins[i], &pin))
            continue; /* none: not an input of this driver */
        motor->pins[i] = pin.bit;
        if (pulses_inputs(motor) != (i == ENABLE)) /* settings_check has found its PWM */
            board_pwm(pin.pwm, &motor->pwm[i == IN2]);
    }
    motors_release(motor); /* before the pins become outputs */
    for (uint8_t i = 0; i < MOTOR_PINS; i++)
        if (pins[i] != PIN_NONE)
            board_write(&motor->pins[i], DIRECTION, true);
}

/* In pulses on the inputs one of them is high, and the other one between the pulses: the windings are driven, then
   shorted. At the end of a motion they stay shorted. */
static void pulse_inputs(motor_t *motor, uint8_t pwm, bool forward)
{
    uint8_t low = (uint8_t)~pwm;
    motor->held |= pwm != 0;
    if (!motor->held && !motor->brake) {
        motors_release(motor);
        return;
    }
    put_both(motor, forward ? UINT8_MAX : low, forward ? low : UINT8_MAX);
    if (motor->pins[ENABLE].mask)
        board_write(&motor->pins[ENABLE], OUTPUT, !motor->inverted);
}

void motors_set(motor_t *motor, int16_t duty)
{
    uint16_t size = (uint16_t)(duty < 0 ? -duty : duty);
    uint8_t pwm = (uint8_t)((size - (size >> 8) + 64) >> 7); /* 255 / 32768, rounded */
    bool forward = (duty > 0) != motor->reversed;
    bool brake = pwm == 0 && motor->brake;
    if (!motor->pwm[0].compare)
        return;
    if (motor->driver == DRIVER_PULSED_INPUTS) {
        pulse_inputs(motor, pwm, forward);
        return;
    }
    uint8_t first = brake ? UINT8_MAX : forward ? pwm : 0;
    uint8_t second = brake ? UINT8_MAX : forward ? 0 : pwm;
    if (motor->driver == DRIVER_TWO_PWM) {
        put_both(motor, first, second);
        return;
    }
    if (motor->driver == DRIVER_ENABLE_DIRECTION) {
        board_write(&motor->pins[IN1], OUTPUT, forward); /* at duty 0 these drivers always brake */
        enable(motor, pwm);
        return;
    }
    /* Both inputs high: a TB6612 brakes only so, an L298N also with both low. */
    board_write(&motor->pins[IN1], OUTPUT, first != 0);
    board_write(&motor->pins[IN2], OUTPUT, second != 0);
    enable(motor, brake ? UINT8_MAX : pwm);
}

void motors_release(const motor_t *motor)
{
    if (!motor->pwm[0].compare)
        return;
    if (!pulses_inputs(motor)) {
        enable(motor, 0);
        return;
    }
    if (motor->pins[ENABLE].mask)
        board_write(&motor->pins[ENABLE], OUTPUT, motor->inverted);
    put_both(motor, 0, 0);
}
