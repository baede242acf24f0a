#include "motors.h"

#include <avr/io.h>
#include <stdbool.h>
#include <util/atomic.h>

#include "board.h"

typedef struct {
    pin_t enable, in1, in2;
    pwm_t pwm;
    bool reversed;
} motor_t;

static motor_t motors[2];
static bool configured, inverted, brake;

static void write(const pin_t *pin, bool high)
{
    volatile uint8_t *port = (volatile uint8_t *)(pin->port + 2);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (high)
            *port |= pin->mask;
        else
            *port &= (uint8_t)~pin->mask;
    }
}

static void make_output(const pin_t *pin, bool high)
{
    write(pin, high);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) *(volatile uint8_t *)(pin->port + 1) |= pin->mask;
}

/* The timer holds the pin only between the ends: fast PWM cannot be quite off or quite on. */
static void enable(const motor_t *motor, uint8_t duty)
{
    volatile uint8_t *control = (volatile uint8_t *)motor->pwm.control;
    if (inverted)
        duty = (uint8_t)~duty;
    bool connected = duty != 0 && duty != UINT8_MAX;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (motor->pwm.wide)
            *(volatile uint16_t *)motor->pwm.compare = duty;
        else
            *(volatile uint8_t *)motor->pwm.compare = duty;
        write(&motor->enable, duty == UINT8_MAX);
        if (connected)
            *control |= (uint8_t)(1 << motor->pwm.connect);
        else
            *control &= (uint8_t)~(1 << motor->pwm.connect);
    }
}

static void configure(motor_t *motor, uint8_t enable_pin, uint8_t in1, uint8_t in2, bool reversed)
{
    board_pin(enable_pin, &motor->enable);
    board_pin(in1, &motor->in1);
    board_pin(in2, &motor->in2);
    motor->pwm = board_pwm(motor->enable.pwm);
    motor->reversed = reversed;
    make_output(&motor->enable, inverted);
    make_output(&motor->in1, false);
    make_output(&motor->in2, false);
}

/* Pins of earlier settings go back to inputs, as after a reset. */
static void forget(const motor_t *motor)
{
    const pin_t *pins[] = {&motor->enable, &motor->in1, &motor->in2};
    for (uint8_t i = 0; i < 3; i++) {
        write(pins[i], false);
        *(volatile uint8_t *)(pins[i]->port + 1) &= (uint8_t)~pins[i]->mask;
    }
}

void motors_configure(const settings_t *settings)
{
    if (configured) {
        motors_release();
        forget(&motors[0]);
        forget(&motors[1]);
    }
    inverted = settings->enable_inverted;
    brake = settings->brake;
    configure(&motors[0], settings->left_enable, settings->left_in1, settings->left_in2,
              settings->left_reversed);
    configure(&motors[1], settings->right_enable, settings->right_in1, settings->right_in2,
              settings->right_reversed);
    configured = true;
    motors_set(0, 0);
    motors_set(1, 0);
}

void motors_set(uint8_t wheel, int16_t duty)
{
    if (!configured)
        return;
    const motor_t *motor = &motors[wheel];
    bool forward = (duty > 0) != motor->reversed;
    uint16_t size = (uint16_t)(duty < 0 ? -(int32_t)duty : duty);
    uint8_t pwm = (uint8_t)(((uint32_t)size * UINT8_MAX + 0x4000) >> 15);
    write(&motor->in1, pwm != 0 && forward);
    write(&motor->in2, pwm != 0 && !forward);
    enable(motor, pwm == 0 && brake ? UINT8_MAX : pwm);
}

void motors_release(void)
{
    if (!configured)
        return;
    enable(&motors[0], 0);
    enable(&motors[1], 0);
}
