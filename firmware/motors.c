#include "motors.h"

#include <avr/io.h>
#include <stdbool.h>
#include <util/atomic.h>

#include "board.h"

typedef struct {
    pin_t enable, in[2];
    pwm_t pwm;
    bool reversed;
} motor_t;

static motor_t motors[2];
static bool configured, inverted, brake;

/* A port's register, for the ports beyond single-instruction reach too. */
static void write(register_t *at, uint8_t mask, bool high)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (high)
            *at |= mask;
        else
            *at &= (uint8_t)~mask;
    }
}

/* The timer holds the pin only between the ends: fast PWM cannot be quite off or quite on. */
static void enable(const motor_t *motor, uint8_t duty)
{
    if (inverted)
        duty = (uint8_t)~duty;
    *motor->pwm.compare = duty; /* the high byte of a 16-bit timer's stays 0 */
    write(&motor->enable.port[2], motor->enable.mask, duty == UINT8_MAX);
    write(motor->pwm.control, motor->pwm.connect, duty != 0 && duty != UINT8_MAX);
}

static void output(uint8_t number, pin_t *pin)
{
    board_pin(number, pin);
    write(&pin->port[1], pin->mask, true);
}

/* `pins` are enable, in1, in2, as they stand in the settings. */
static void configure(motor_t *motor, const uint8_t *pins, bool reversed)
{
    motor->reversed = reversed;
    board_pin(pins[0], &motor->enable);
    board_pwm(motor->enable.pwm, &motor->pwm);
    enable(motor, 0);
    output(pins[0], &motor->enable);
    output(pins[1], &motor->in[0]);
    output(pins[2], &motor->in[1]);
}

void motors_configure(const settings_t *settings)
{
    motors_release(); /* by the old settings */
    inverted = settings->enable_inverted;
    brake = settings->brake;
    configure(&motors[0], &settings->left_enable, settings->left_reversed);
    configure(&motors[1], &settings->right_enable, settings->right_reversed);
    configured = true;
}

void motors_set(uint8_t wheel, int16_t duty)
{
    if (!configured)
        return;
    const motor_t *motor = &motors[wheel];
    uint16_t size = (uint16_t)(duty < 0 ? -duty : duty);
    uint8_t pwm = (uint8_t)((size - (size >> 8) + 64) >> 7); /* 255 / 32768, rounded */
    bool forward = (duty > 0) != motor->reversed;
    for (uint8_t i = 0; i < 2; i++)
        write(&motor->in[i].port[2], motor->in[i].mask, pwm != 0 && forward == (i == 0));
    enable(motor, pwm == 0 && brake ? UINT8_MAX : pwm);
}

void motors_release(void)
{
    for (uint8_t wheel = 0; configured && wheel < 2; wheel++)
        enable(&motors[wheel], 0);
}
