/* Arduino Uno and Nano, ATmega328P. Timer 2 is the clock, so pins 3 and 11 have no PWM; 5 and 6 have
   that of timer 0, 9 and 10 that of timer 1. An Uno has no A6 and A7. */
#include "avr_pins.h"
#include "protocol.h"

const uint8_t board_code = BOARD_ATMEGA328P;
const uint8_t board_analogs = 8;
const uint8_t board_first_analog = 14;
const uint8_t board_sda = 18; /* A4 */
const uint8_t board_scl = 19; /* A5 */

/* OCnA or OCnB of a timer, in the order of `avr_timers`. */
#define OC0(channel) (channel)
#define OC1(channel) (3 + channel)

const uint16_t avr_timers[] PROGMEM = {0x44, 0x80};
const uint8_t avr_first_wide = OC1(A);
const uint8_t avr_groups[] PROGMEM = {B, C, D};

const uint16_t avr_pins[] PROGMEM = {
    /* 0 */ LINK(D, 0), LINK(D, 1), EDGE(D, 2, 0), EDGE(D, 3, 1),
    /* 4 */ PLAIN(D, 4), PWM(D, 5, OC0(B)), PWM(D, 6, OC0(A)), PLAIN(D, 7),
    /* 8 */ PLAIN(B, 0), PWM(B, 1, OC1(A)), PWM(B, 2, OC1(B)), PLAIN(B, 3),
    /* 12 */ PLAIN(B, 4), PLAIN(B, 5), PLAIN(C, 0), PLAIN(C, 1),
    /* 16 */ PLAIN(C, 2), PLAIN(C, 3), PLAIN(C, 4), PLAIN(C, 5),
    /* 20 */ ANALOG_ONLY, ANALOG_ONLY,
};
const uint8_t avr_pin_count = sizeof avr_pins / sizeof *avr_pins;

#ifdef __AVR__
#include <avr/interrupt.h>
#include <avr/io.h>

#include "atomic.h"

static volatile uint32_t overflows; /* of 24 bits: they wrap with the clock */

void board_start_timers(void)
{
    TCCR0A = 1 << WGM01 | 1 << WGM00;
    TCCR0B = 1 << CS01 | 1 << CS00;
    TCCR1A = 1 << WGM10;
    TCCR1B = 1 << WGM12 | 1 << CS11 | 1 << CS10;
}

/* A bootloader may have used the timer: its count is no time, and its overflow flag would be read as an
   overflow that is yet to be counted, by which board_now would be too late for half a round. */
void board_start_clock(void)
{
    TCCR2A = 0;
    TCNT2 = 0;
    TCCR2B = 1 << CS22;
    TIFR2 = 0xFF;
    TIMSK2 = 1 << TOIE2 | 1 << OCIE2A | 1 << OCIE2B;
}

ticks_t board_now(void)
{
    ticks_t high;
    uint8_t low;
    ATOMIC
    {
        low = TCNT2;
        high = overflows;
        if ((TIFR2 & 1 << TOV2) && low < 0x80)
            high++; /* the overflow interrupt is pending */
    }
    return high << 8 | low;
}

uint16_t board_now_low(void)
{
    return (uint16_t)board_now();
}

void board_alarm(uint8_t alarm, uint16_t time)
{
    if (alarm == ALARM_MILLISECOND)
        OCR2A = (uint8_t)time;
    else
        OCR2B = (uint8_t)time;
}

ISR(TIMER2_OVF_vect)
{
    overflows++;
}
#endif
