/* diffbot: the firmware of a two-wheeled robot. Sleeps until an interrupt brings work. */
#include <avr/interrupt.h>
#include <avr/sleep.h>

#include "board.h"
#include "clock.h"
#include "link.h"
#include "reset.h"
#include "robot.h"
#include "telemetry.h"

static volatile uint8_t *const sleeping = &SMCR;

static void listen(void)
{
    for (uint8_t link = 0; link < LINKS; link++) {
        const uint8_t *payload;
        while ((payload = link_receive(link)) != 0)
            robot_obey(link, payload);
    }
}

static void sleep_unless(bool work)
{
    *sleeping = 1 << SE;
    cli();
    if (work || link_waiting()) {
        sei();
        return;
    }
    sei(); /* the next instruction runs before any interrupt, so none is slept through */
    sleep_cpu();
}

int main(void)
{
    reset_begin();
    board_start_timers();
    clock_start();
    link_start();
    robot_start();
    sei();
    uint16_t longest = 0;
    for (;;) {
        uint32_t begun = clock_now();
        reset_feed();
        listen();
        uint8_t milliseconds = clock_elapsed();
        for (uint8_t i = 0; i < milliseconds; i++)
            robot_tick();
        if (milliseconds)
            robot_tell((uint16_t)(longest * 4));
        if (telemetry_second())
            longest = 0;
        uint32_t took = clock_now() - begun;
        if (took > longest)
            longest = took > UINT16_MAX / 4 ? UINT16_MAX / 4 : (uint16_t)took;
        sleep_unless(false);
    }
}
