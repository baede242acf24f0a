#include <stdlib.h>

#include "motors.h"
#include "pins.h"

#define FULL 32767

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

static void measure(board_t *board, unsigned motor)
{
    const uint8_t *pins = board->options.motor[motor];
    int duty = enabled(board, pins[0]);
    int forward = level(board, pins[1]) - level(board, pins[2]);
    uint8_t brake = forward == 0 && duty != 0;
    int16_t driven = (int16_t)(forward * duty);
    if (driven == board->duty[motor] && brake == board->brake[motor])
        return;
    board->duty[motor] = driven;
    board->brake[motor] = brake;
    if (board->event_count < EVENTS)
        board->events[board->event_count++] =
            (event_t){board_now(board), (uint8_t)motor, brake, driven};
}

void motors_poll(board_t *board)
{
    for (unsigned motor = 0; motor < board->options.motors; motor++)
        measure(board, motor);
}
