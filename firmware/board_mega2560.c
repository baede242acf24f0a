/* Arduino Mega 2560. Timer 1 is the clock, so pins 11 and 12 have no PWM; 13 has that of timer 0. */
#include "avr_pins.h"
#include "protocol.h"

const uint8_t board_code = BOARD_MEGA2560;
const uint8_t board_analogs = 16;
const uint8_t board_first_analog = 54;
const uint8_t board_sda = 20;
const uint8_t board_scl = 21;

/* OCnA, OCnB or OCnC of a timer, in the order of `avr_timers`. */
#define OC0(channel) (channel)
#define OC2(channel) (3 + channel)
#define OC3(channel) (6 + channel)
#define OC4(channel) (9 + channel)
#define OC5(channel) (12 + channel)

const uint16_t avr_timers[] PROGMEM = {0x44, 0xB0, 0x90, 0xA0, 0x120};
const uint8_t avr_first_wide = OC3(A);
/* Ports J and K have such interrupts too; they are left out, since the emulator's have none. */
const uint8_t avr_groups[] PROGMEM = {B, NO_PORT, NO_PORT};

const uint16_t avr_pins[] PROGMEM = {
    /* 0 */ LINK(E, 0), LINK(E, 1), BOTH(E, 4, OC3(B), 4), BOTH(E, 5, OC3(C), 5),
    /* 4 */ PWM(G, 5, OC0(B)), PWM(E, 3, OC3(A)), PWM(H, 3, OC4(A)), PWM(H, 4, OC4(B)),
    /* 8 */ PWM(H, 5, OC4(C)), PWM(H, 6, OC2(B)), PWM(B, 4, OC2(A)), PLAIN(B, 5),
    /* 12 */ PLAIN(B, 6), PWM(B, 7, OC0(A)), PLAIN(J, 1), PLAIN(J, 0),
    /* 16 */ PLAIN(H, 1), PLAIN(H, 0), LINK(D, 3), LINK(D, 2),
    /* 20 */ EDGE(D, 1, 1), EDGE(D, 0, 0), PLAIN(A, 0), PLAIN(A, 1),
    /* 24 */ PLAIN(A, 2), PLAIN(A, 3), PLAIN(A, 4), PLAIN(A, 5),
    /* 28 */ PLAIN(A, 6), PLAIN(A, 7), PLAIN(C, 7), PLAIN(C, 6),
    /* 32 */ PLAIN(C, 5), PLAIN(C, 4), PLAIN(C, 3), PLAIN(C, 2),
    /* 36 */ PLAIN(C, 1), PLAIN(C, 0), PLAIN(D, 7), PLAIN(G, 2),
    /* 40 */ PLAIN(G, 1), PLAIN(G, 0), PLAIN(L, 7), PLAIN(L, 6),
    /* 44 */ PWM(L, 5, OC5(C)), PWM(L, 4, OC5(B)), PWM(L, 3, OC5(A)), PLAIN(L, 2),
    /* 48 */ PLAIN(L, 1), PLAIN(L, 0), PLAIN(B, 3), PLAIN(B, 2),
    /* 52 */ PLAIN(B, 1), PLAIN(B, 0), PLAIN(F, 0), PLAIN(F, 1),
    /* 56 */ PLAIN(F, 2), PLAIN(F, 3), PLAIN(F, 4), PLAIN(F, 5),
    /* 60 */ PLAIN(F, 6), PLAIN(F, 7), PLAIN(K, 0), PLAIN(K, 1),
    /* 64 */ PLAIN(K, 2), PLAIN(K, 3), PLAIN(K, 4), PLAIN(K, 5),
    /* 68 */ PLAIN(K, 6), PLAIN(K, 7),
};
const uint8_t avr_pin_count = sizeof avr_pins / sizeof *avr_pins;

#ifdef __AVR__
#include <avr/interrupt.h>
#include <avr/io.h>

#include "atomic.h"

static volatile uint16_t overflows;

void board_start_timers(void)
{
    TCCR0A = 1 << WGM01 | 1 << WGM00;
    TCCR0B = 1 << CS01 | 1 << CS00;
    TCCR2A = 1 << WGM21 | 1 << WGM20;
    TCCR2B = 1 << CS22;
    TCCR3A = TCCR4A = TCCR5A = 1 << WGM30;
    TCCR3B = TCCR4B = TCCR5B = 1 << WGM32 | 1 << CS31 | 1 << CS30;
}

/* A bootloader may have used the timer: its count is no time, and its overflow flag would be read as an
   overflow that is yet to be counted, by which board_now would be too late for half a round. */
void board_start_clock(void)
{
    TCCR1A = 0;
    TCNT1 = 0;
    TCCR1B = 1 << CS11 | 1 << CS10;
    TIFR1 = 0xFF;
    TIMSK1 = 1 << TOIE1 | 1 << OCIE1A | 1 << OCIE1B;
}

ticks_t board_now(void)
{
    uint16_t high;
    uint16_t low;
    ATOMIC
    {
        low = TCNT1;
        high = overflows;
        if ((TIFR1 & 1 << TOV1) && low < 0x8000)
            high++; /* the overflow interrupt is pending */
    }
    return (ticks_t)high << 16 | low;
}

uint16_t board_now_low(void)
{
    return TCNT1;
}

void board_alarm(uint8_t alarm, uint16_t time)
{
    if (alarm == ALARM_MILLISECOND)
        OCR1A = time;
    else
        OCR1B = time;
}

ISR(TIMER1_OVF_vect)
{
    overflows++;
}
#endif
