/* Arduino Mega 2560. Timer 1 is the clock, so pins 11 and 12 make no PWM; 13 does, by timer 0. */
#include "board.h"

#ifdef __AVR__
#include <avr/io.h>
#endif

#include "progmem.h"
#include "protocol.h"

const uint8_t board_code = BOARD_MEGA2560;
const uint8_t board_analogs = 16;

/* Data addresses of PINx. */
enum {
    A = 0x20, B = 0x23, C = 0x26, D = 0x29, E = 0x2C, F = 0x2F, G = 0x32,
    H = 0x100, J = 0x103, K = 0x106, L = 0x109
};
/* Bits COMnA1, COMnB1, COMnC1 of every TCCRnA. */
enum { OUT_A = 7, OUT_B = 5, OUT_C = 3 };
#define PLAIN(port, bit) {port, 1 << bit, BOARD_NONE, BOARD_NONE, false}
#define LINK(port, bit) {port, 1 << bit, BOARD_NONE, BOARD_NONE, true}
#define PWM(port, bit, output) {port, 1 << bit, output, BOARD_NONE, false}
#define EDGE(port, bit, number) {port, 1 << bit, BOARD_NONE, number, false}
#define BOTH(port, bit, output, number) {port, 1 << bit, output, number, false}

static const pwm_t outputs[] PROGMEM = {
    {0x44, 0x47, OUT_A, false}, {0x44, 0x48, OUT_B, false},                            /* 0, 1 */
    {0xB0, 0xB3, OUT_A, false}, {0xB0, 0xB4, OUT_B, false},                            /* 2, 3 */
    {0x90, 0x98, OUT_A, true}, {0x90, 0x9A, OUT_B, true}, {0x90, 0x9C, OUT_C, true},  /* 4-6 */
    {0xA0, 0xA8, OUT_A, true}, {0xA0, 0xAA, OUT_B, true}, {0xA0, 0xAC, OUT_C, true},  /* 7-9 */
    {0x120, 0x128, OUT_A, true}, {0x120, 0x12A, OUT_B, true}, {0x120, 0x12C, OUT_C, true},
};

static const pin_t pins[] PROGMEM = {
    LINK(E, 0), LINK(E, 1), BOTH(E, 4, 5, 4), BOTH(E, 5, 6, 5), PWM(G, 5, 1),            /* 0-4 */
    PWM(E, 3, 4), PWM(H, 3, 7), PWM(H, 4, 8), PWM(H, 5, 9), PWM(H, 6, 3),                /* 5-9 */
    PWM(B, 4, 2), PLAIN(B, 5), PLAIN(B, 6), PWM(B, 7, 0), PLAIN(J, 1),                   /* 10-14 */
    PLAIN(J, 0), PLAIN(H, 1), PLAIN(H, 0), LINK(D, 3), LINK(D, 2),                       /* 15-19 */
    EDGE(D, 1, 1), EDGE(D, 0, 0), PLAIN(A, 0), PLAIN(A, 1), PLAIN(A, 2),                 /* 20-24 */
    PLAIN(A, 3), PLAIN(A, 4), PLAIN(A, 5), PLAIN(A, 6), PLAIN(A, 7),                     /* 25-29 */
    PLAIN(C, 7), PLAIN(C, 6), PLAIN(C, 5), PLAIN(C, 4), PLAIN(C, 3),                     /* 30-34 */
    PLAIN(C, 2), PLAIN(C, 1), PLAIN(C, 0), PLAIN(D, 7), PLAIN(G, 2),                     /* 35-39 */
    PLAIN(G, 1), PLAIN(G, 0), PLAIN(L, 7), PLAIN(L, 6), PWM(L, 5, 12),                   /* 40-44 */
    PWM(L, 4, 11), PWM(L, 3, 10), PLAIN(L, 2), PLAIN(L, 1), PLAIN(L, 0),                 /* 45-49 */
    PLAIN(B, 3), PLAIN(B, 2), PLAIN(B, 1), PLAIN(B, 0), PLAIN(F, 0),                     /* 50-54 */
    PLAIN(F, 1), PLAIN(F, 2), PLAIN(F, 3), PLAIN(F, 4), PLAIN(F, 5),                     /* 55-59 */
    PLAIN(F, 6), PLAIN(F, 7), PLAIN(K, 0), PLAIN(K, 1), PLAIN(K, 2),                     /* 60-64 */
    PLAIN(K, 3), PLAIN(K, 4), PLAIN(K, 5), PLAIN(K, 6), PLAIN(K, 7),                     /* 65-69 */
};

bool board_pin(uint8_t number, pin_t *pin)
{
    if (number >= sizeof pins / sizeof *pins)
        return false;
    memcpy_P(pin, &pins[number], sizeof *pin);
    return true;
}

pwm_t board_pwm(uint8_t number)
{
    pwm_t output;
    memcpy_P(&output, &outputs[number], sizeof output);
    return output;
}

#ifdef __AVR__
void board_start_timers(void)
{
    TCCR0A = 1 << WGM01 | 1 << WGM00;
    TCCR0B = 1 << CS01 | 1 << CS00;
    TCCR2A = 1 << WGM21 | 1 << WGM20;
    TCCR2B = 1 << CS22;
    TCCR3A = 1 << WGM30;
    TCCR3B = 1 << WGM32 | 1 << CS31 | 1 << CS30;
    TCCR4A = 1 << WGM40;
    TCCR4B = 1 << WGM42 | 1 << CS41 | 1 << CS40;
    TCCR5A = 1 << WGM50;
    TCCR5B = 1 << WGM52 | 1 << CS51 | 1 << CS50;
}

void board_sense(uint8_t number, uint8_t sense)
{
    volatile uint8_t *control = number < 4 ? &EICRA : &EICRB;
    uint8_t shift = (uint8_t)(2 * (number & 3));
    EIMSK &= (uint8_t)~(1 << number);
    *control = (uint8_t)((*control & ~(3 << shift)) | sense << shift);
    EIFR = (uint8_t)(1 << number);
    EIMSK |= (uint8_t)(1 << number);
}

void board_interrupts_off(void)
{
    EIMSK = 0;
}
#endif
