#include <stdlib.h>

#include "motors.h"
#include "pins.h"

#define FULL 32767
#define NO_PIN 255
#define STEPS 255 /* of a pulse */
enum { OPEN = 0, SHORTED = 2 }; /* besides 1 and -1: driven */
/* In what states of the inputs the driver shorts the motor; in others it leaves it open. */
enum { ENABLE_LOW = 1, BOTH_LOW = 2, BOTH_HIGH = 4 };

/* simavr has no signal for the third PWM channel of a timer and none for phase-correct PWM, so duty
   is read from the registers: it works for every channel. */
static int level(const board_t *board, uint8_t pin)
{
    place_t place = pin_place(pin);
    const uint8_t *in = board->avr->data + pin_address(place.port);
    return (in[1] & in[2]) >> place.bit & 1; /* 1 for an output that is high */
}

/* Steps of a pulse for which a pin is high, from its begin on. An input without a pin is wired high. */
static int high(const board_t *board, uint8_t pin)
{
    if (pin == NO_PIN)
        return STEPS;
    place_t place = pin_place(pin);
    const uint8_t *data = board->avr->data;
    bool output = data[pin_address(place.port) + 1] >> place.bit & 1;
    if (!output)
        return 0;
    if (!place.control || !(data[place.control] >> place.connect & 1))
        return level(board, pin) ? STEPS : 0;
    bool inverting = data[place.control] >> (place.connect - 1) & 1;
    return inverting ? STEPS - data[place.compare] : data[place.compare];
}

/* What a driver does to its motor, by the truth tables of the data sheets; 1 when its first input drives. */
static int effect(uint8_t shorts, bool has_direction, bool enabled, bool first, bool second)
{
    if (has_direction)
        second = !first;
    if (!enabled && !(shorts & ENABLE_LOW))
        return OPEN;
    if (first == second)
        return shorts & (first ? BOTH_HIGH : BOTH_LOW) ? SHORTED : OPEN;
    return enabled ? first - second : SHORTED;
}

static void measure(board_t *board, unsigned motor)
{
    const uint8_t *pins = board->options.motor[motor];
    int highs[3], driven = 0, shorted = 0, next;
    for (unsigned i = 0; i < 3; i++)
        highs[i] = high(board, pins[i]);
    bool awake = pins[3] == NO_PIN || level(board, pins[3]);
    for (int at = 0; awake && at < STEPS; at = next) {
        next = STEPS;
        for (unsigned i = 0; i < 3; i++)
            if (highs[i] > at && highs[i] < next)
                next = highs[i];
        int does = effect(pins[4], pins[2] == NO_PIN, highs[0] > at, highs[1] > at, highs[2] > at);
        if (does == SHORTED)
            shorted += next - at;
        else
            driven += does * (next - at);
    }
    int16_t duty = (int16_t)(driven * FULL / STEPS), short_share = (int16_t)(shorted * FULL / STEPS);
    if (duty == board->duty[motor] && short_share == board->shorted[motor])
        return;
    board->duty[motor] = duty;
    board->shorted[motor] = short_share;
    if (board->event_count < EVENTS)
        board->events[board->event_count++] =
            (event_t){board_now(board), (uint8_t)motor, duty, short_share};
}

void motors_poll(board_t *board)
{
    for (unsigned motor = 0; motor < board->options.motors; motor++)
        measure(board, motor);
}
