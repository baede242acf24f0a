#include "clock.h"

#include <avr/io.h>
#include <util/atomic.h>

#include "status.h"

#define MS_PER_MINUTE 60000U

static volatile uint8_t overflows;
static volatile uint8_t elapsed;
static uint16_t milliseconds;

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
}

void clock_sample(void)
{
    OCR1B += CLOCK_SAMPLE_TICKS;
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
            high++; /* the overflow interrupt is pending */
    }
    return (ticks_t)high << 16 | low;
}

bool clock_tick(void)
{
    static uint8_t seen;
    if (seen == elapsed)
        return false;
    seen++;
    if (++milliseconds == MS_PER_MINUTE) {
        milliseconds = 0;
        status[ITEM_UPTIME]++;
    }
    return true;
}
