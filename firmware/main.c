/* diffbot: the firmware of a two-wheeled robot. Sleeps until an interrupt brings work. */
#include <avr/interrupt.h>
#include <avr/sleep.h>

#include "board.h"
#include "clock.h"
#include "link.h"
#include "reset.h"
#include "robot.h"

static void listen(void)
{
    for (uint8_t link = 0; link < LINKS; link++) {
        const void *payload;
        while ((payload = link_receive(link)) != 0)
            robot_obey(link, payload);
    }
}

static void sleep_if_idle(void)
{
    cli();
    if (link_waiting()) {
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
    SMCR = 1 << SE; /* idle: timers and serial ports go on */
    sei();
    uint16_t longest = 0;
    for (;;) {
        uint16_t begun = (uint16_t)clock_now();
        reset_feed();
        listen();
        uint8_t milliseconds = clock_elapsed();
        for (uint8_t i = 0; i < milliseconds; i++)
            robot_tick();
        if (milliseconds && robot_tell((uint16_t)(longest * 4)))
            longest = 0;
        uint16_t took = (uint16_t)(clock_now() - begun); /* the watchdog bites long before it wraps */
        if (took > longest)
            longest = took;
        sleep_if_idle();
    }
}
