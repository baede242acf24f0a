#include "analog.h"

#include <stdbool.h>

#include "atomic.h"
#include "board.h"
#include "settings.h"

#define READINGS 16
#define SCALE 4 /* from the sum of sixteen 10-bit readings to the 12 bits of a frame */

#define INPUTS (ANALOG_SENSORS + RANGE_SENSORS)
#define BATTERY 1

/* Range, battery and further sensors, which the converter reads in turn. */
static struct {
    uint8_t channel;
    uint8_t readings;
    uint16_t sum;
    volatile uint16_t mean;
} inputs[INPUTS] = {[0 ... INPUTS - 1] = {PIN_NONE, 0, 0, ANALOG_NONE}};
static uint8_t current;
/* Counts readings of the range: the battery is read once per sixteen of them. */
static uint8_t turn;

/* Starts the first conversion from `input` on that is due. */
static void start(uint8_t input)
{
    for (; input < INPUTS; input++) {
        bool due = input != BATTERY || turn == 0 || inputs[0].channel == PIN_NONE;
        if (inputs[input].channel != PIN_NONE && due) {
            current = input;
            board_convert(inputs[input].channel);
            return;
        }
    }
}

void analog_configure(const settings_t *settings)
{
    ATOMIC
    {
        inputs[0].channel = settings->range;
        inputs[1].channel = settings->battery;
        for (uint8_t i = 0; i < RANGE_SENSORS; i++) {
            const uint8_t *pins = settings_range_pins(settings, i); /* PIN_NONE is one before 0 */
            inputs[ANALOG_SENSORS + i].channel = pins[0] == 0 ? (uint8_t)(pins[1] - 1) : PIN_NONE;
        }
        for (uint8_t i = 0; i < INPUTS; i++) {
            inputs[i].readings = 0;
            inputs[i].sum = 0;
            inputs[i].mean = ANALOG_NONE;
        }
    }
}

void analog_convert(void)
{
    turn = (uint8_t)(turn + 1) % READINGS;
    start(0);
}

void analog_converted(void)
{
    uint8_t input = current;
    inputs[input].sum += board_converted();
    if (++inputs[input].readings == READINGS) {
        inputs[input].mean = inputs[input].sum / SCALE;
        inputs[input].sum = 0;
        inputs[input].readings = 0;
    }
    start(input + 1);
}

uint16_t analog_mean(uint8_t input)
{
    uint16_t value;
    ATOMIC value = inputs[input].mean;
    return value;
}
