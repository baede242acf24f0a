/* diffbot: firmware of a differential-drive robot. The main loop sleeps between interrupts. */
#include "board.h"
#include "clock.h"
#include "link.h"
#include "reset.h"
#include "robot.h"
#include "status.h"

static void listen(void)
{
    for (uint8_t link = 0; link < LINKS; link++) {
        const void *payload;
        while ((payload = link_receive(link)) != 0)
            robot_handle(link, payload);
    }
}

int main(void)
{
    reset_begin();
    board_start_timers();
    clock_start();
    link_start();
    robot_start();
    board_start_interrupts();
    for (;;) {
        uint16_t begun = (uint16_t)board_now();
        listen();
        while (clock_tick()) {
            robot_tick();
            reset_feed(); /* here alone: without the clock there is no dead-man timeout */
        }
        /* The motors are released and the watchdog resets the chip long before this wraps. */
        uint16_t took_us = (uint16_t)(((uint16_t)board_now() - begun) * 4);
        if (took_us > status[ITEM_LOOP])
            status[ITEM_LOOP] = took_us;
        board_sleep(); /* a byte received just before is read within a millisecond */
    }
}
