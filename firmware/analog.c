#include "analog.h"

#include "atomic.h"
#include "board.h"

#define READINGS 16
#define SCALE 4 /* from the sum of sixteen 10-bit readings to the 12 bits of a frame */

/* Range and battery, which the converter reads in turn. */
static struct {
    uint8_t channel;
    uint8_t readings;
    uint16_t sum;
    volatile uint16_t mean;
} inputs[2] = {{PIN_NONE, 0, 0, ANALOG_NONE}, {PIN_NONE, 0, 0, ANALOG_NONE}};
static uint8_t current;
/* Counts readings of the range: the battery is read once per sixteen of them. */
static uint8_t turn;

static void start(uint8_t input)
{
    uint8_t channel = inputs[input].channel;
    if (channel == PIN_NONE)
        return;
    current = input;
    board_convert(channel);
}

void analog_configure(const settings_t *settings)
{
    ATOMIC
    {
        inputs[0].channel = settings->range;
        inputs[1].channel = settings->battery;
        for (uint8_t i = 0; i < 2; i++) {
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
    if (inputs[0].channel == PIN_NONE)
        start(1);
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
    if (input == 0 && turn == 0)
        start(1);
}

uint16_t analog_mean(uint8_t input)
{
    uint16_t value;
    ATOMIC value = inputs[input].mean;
    return value;
}
