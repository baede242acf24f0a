#include "clock.h"

#include "board.h"
#include "status.h"

#define MS_PER_MINUTE 60000U

static volatile uint8_t elapsed; /* ms */
static uint16_t last_millisecond, last_sample; /* nominal times, low 16 bits */
static uint16_t milliseconds;

void clock_start(void)
{
    board_alarm(ALARM_MILLISECOND, last_millisecond + TICKS_PER_MS);
    board_alarm(ALARM_SAMPLE, last_sample + CLOCK_SAMPLE_TICKS);
    board_start_clock();
}

/* An alarm time that has passed when it is set would come only after a whole round of the timer. So
   both functions count from the clock itself, however late they are, and check again after setting. */
void clock_millisecond(void)
{
    while ((uint16_t)(board_now_low() - last_millisecond) >= TICKS_PER_MS) {
        last_millisecond += TICKS_PER_MS;
        elapsed++;
        board_alarm(ALARM_MILLISECOND, last_millisecond + TICKS_PER_MS);
    }
}

bool clock_sample(void)
{
    bool due = false;
    while ((uint16_t)(board_now_low() - last_sample) >= CLOCK_SAMPLE_TICKS) {
        last_sample += CLOCK_SAMPLE_TICKS;
        board_alarm(ALARM_SAMPLE, last_sample + CLOCK_SAMPLE_TICKS);
        due = true;
    }
    return due;
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
