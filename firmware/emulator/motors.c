#include <stdlib.h>

#include "motors.h"
#include "pins.h"

#define FULL 32767
#define NO_PIN 255
enum { ENABLE_IN1_IN2, ENABLE_DIRECTION, TWO_PWM }; /* kinds of drivers */

/* simavr has no signal for the third PWM channel of a timer and none for phase-correct PWM, so duty
   is read from the registers: it works for every channel. */
static int level(const board_t *board, uint8_t pin)
{
    place_t place = pin_place(pin);
    const uint8_t *in = board->avr->data + pin_address(place.port);
    return (in[1] & in[2]) >> place.bit & 1; /* 1 for an output that is high */
}

static int enabled(const board_t *board, uint8_t pin)
{
    place_t place = pin_place(pin);
    const uint8_t *data = board->avr->data;
    bool output = data[pin_address(place.port) + 1] >> place.bit & 1;
    if (!output)
        return 0;
    if (!place.control || !(data[place.control] >> place.connect & 1))
        return level(board, pin) ? FULL : 0;
    int duty = data[place.compare] * FULL / 255;
    bool inverting = data[place.control] >> (place.connect - 1) & 1;
    return inverting ? FULL - duty : duty;
}

/* Truth tables of the drivers' data sheets. Duty, positive when the first input drives. */
static int driven(const board_t *board, const uint8_t *pins, uint8_t *brake)
{
    uint8_t kind = pins[3], standby = pins[4];
    *brake = 0;
    if (standby != NO_PIN && !level(board, standby))
        return 0;
    if (kind == TWO_PWM) {
        int first = enabled(board, pins[1]), second = enabled(board, pins[2]);
        *brake = first == FULL && second == FULL;
        return first - second;
    }
    int duty = enabled(board, pins[0]);
    if (kind == ENABLE_DIRECTION) {
        *brake = duty == 0;
        return level(board, pins[1]) ? duty : -duty;
    }
    int first = level(board, pins[1]), second = level(board, pins[2]);
    /* A TB6612, which has a standby input, brakes with both inputs high; an L298N when they are equal. */
    *brake = first == second && duty != 0 && (first || standby == NO_PIN);
    return (first - second) * duty;
}

static void measure(board_t *board, unsigned motor)
{
    uint8_t brake;
    int16_t duty = (int16_t)driven(board, board->options.motor[motor], &brake);
    if (duty == board->duty[motor] && brake == board->brake[motor])
        return;
    board->duty[motor] = duty;
    board->brake[motor] = brake;
    if (board->event_count < EVENTS)
        board->events[board->event_count++] =
            (event_t){board_now(board), (uint8_t)motor, brake, duty};
}

void motors_poll(board_t *board)
{
    for (unsigned motor = 0; motor < board->options.motors; motor++)
        measure(board, motor);
}
