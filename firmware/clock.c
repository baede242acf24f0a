#include "clock.h"

#include <avr/io.h>
#include <util/atomic.h>

#include "analog.h"
#include "motors.h"
#include "reset.h"

#define MS_PER_MINUTE 60000U

static volatile uint8_t overflows;
static volatile uint8_t elapsed;
static uint16_t milliseconds, minutes;

void clock_start(void)
{
    TCCR1A = 0;
    TCCR1B = 1 << CS11 | 1 << CS10;
    OCR1A = TICKS_PER_MS;
    OCR1B = CLOCK_SAMPLE_TICKS;
    TIMSK1 = 1 << TOIE1 | 1 << OCIE1A | 1 << OCIE1B;
}

void clock_overflow(void)
{
    overflows++;
}

void clock_millisecond(void)
{
    OCR1A += TICKS_PER_MS;
    elapsed++;
    if (reset_hung())
        motors_release();
}

void clock_sample(void)
{
    OCR1B += CLOCK_SAMPLE_TICKS;
    analog_convert();
}

ticks_t clock_now(void)
{
    uint8_t high;
    uint16_t low;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        low = TCNT1;
        high = overflows;
        if ((TIFR1 & 1 << TOV1) && low < 0x8000)
            high++; /* the overflow's interrupt is still waiting */
    }
    return (ticks_t)high << 16 | low;
}

uint8_t clock_elapsed(void)
{
    uint8_t taken;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        taken = elapsed;
        elapsed = 0;
    }
    milliseconds += taken;
    if (milliseconds >= MS_PER_MINUTE) {
        milliseconds -= MS_PER_MINUTE;
        minutes++;
    }
    return taken;
}

uint16_t clock_uptime(void)
{
    return minutes;
}
