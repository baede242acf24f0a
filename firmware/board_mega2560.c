/* Arduino Mega 2560. Timer 1 is the clock, so pins 11 and 12 make no PWM; 13 does, by timer 0. */
#include "board.h"

#ifdef __AVR__
#include <avr/io.h>
#endif

#include "protocol.h"

const uint8_t board_code = BOARD_MEGA2560;
const uint8_t board_analogs = 16;
const uint8_t board_first_analog = 54;

/* One word a pin: port, bit, ability, number of the PWM output, number of the interrupt. */
enum { A, B, C, D, E, F, G, H, J, K, L };
#define PIN(port, bit, ability, pwm, interrupt) \
    (port | bit << 4 | ability << 7 | pwm << 9 | interrupt << 13)
#define PLAIN(port, bit) PIN(port, bit, ABLE_NOTHING, 0, 0)
#define LINK(port, bit) PIN(port, bit, ABLE_LINK, 0, 0)
#define PWM(port, bit, output) PIN(port, bit, ABLE_PWM, output, 0)
#define EDGE(port, bit, number) PIN(port, bit, ABLE_INTERRUPT, 0, number)
/* The pins with both: interrupts above 3 tell them from those without PWM. */
#define BOTH(port, bit, output, number) PIN(port, bit, ABLE_INTERRUPT, output, number)

static const uint16_t pins[] PROGMEM = {
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

/* Data addresses of TCCRnA and OCRnx, and the bit COMnx1. */
static const struct {
    uint16_t control, compare;
    uint8_t connect;
} outputs[] PROGMEM = {
    {0x44, 0x47, 7},   {0x44, 0x48, 5},                      /* 0, 1: timer 0 */
    {0xB0, 0xB3, 7},   {0xB0, 0xB4, 5},                      /* 2, 3: timer 2 */
    {0x90, 0x98, 7},   {0x90, 0x9A, 5},   {0x90, 0x9C, 3},   /* 4 to 6: timer 3 */
    {0xA0, 0xA8, 7},   {0xA0, 0xAA, 5},   {0xA0, 0xAC, 3},   /* 7 to 9: timer 4 */
    {0x120, 0x128, 7}, {0x120, 0x12A, 5}, {0x120, 0x12C, 3}, /* 10 to 12: timer 5 */
};

/* Data address of PINx: A to G stand in a row, H to L further up. */
static uint16_t port_address(uint8_t port)
{
    return port < H ? 0x20 + 3 * port : 0x100 + 3 * (port - H);
}

bool board_pin(uint8_t number, pin_t *pin)
{
    if (number >= sizeof pins / sizeof *pins)
        return false;
    uint16_t word = pgm_read_word(&pins[number]);
    uint8_t high = (uint8_t)(word >> 8);
    pin->port = (register_t *)(uintptr_t)port_address(word & 0xF);
    pin->mask = (uint8_t)(1 << (word >> 4 & 7));
    pin->ability = (uint8_t)(word >> 7 & 3);
    pin->interrupt = pin->ability == ABLE_INTERRUPT ? high >> 5 : BOARD_NONE;
    bool pwm = pin->ability == ABLE_PWM || (pin->ability == ABLE_INTERRUPT && pin->interrupt > 3);
    pin->pwm = pwm ? high >> 1 & 0xF : BOARD_NONE;
    return true;
}

void board_pwm(uint8_t number, pwm_t *output)
{
    output->control = (register_t *)(uintptr_t)pgm_read_word(&outputs[number].control);
    output->compare = (register_t *)(uintptr_t)pgm_read_word(&outputs[number].compare);
    output->connect = (uint8_t)(1 << pgm_read_byte(&outputs[number].connect));
}

bool board_input(uint8_t number, pin_t *pin)
{
    if (!board_pin(number, pin))
        return false;
    pin->port[1] &= (uint8_t)~pin->mask;
    pin->port[2] |= pin->mask;
    return true;
}

#ifdef __AVR__
void board_start_timers(void)
{
    TCCR0A = 1 << WGM01 | 1 << WGM00;
    TCCR0B = 1 << CS01 | 1 << CS00;
    TCCR2A = 1 << WGM21 | 1 << WGM20;
    TCCR2B = 1 << CS22;
    TCCR3A = TCCR4A = TCCR5A = 1 << WGM30;
    TCCR3B = TCCR4B = TCCR5B = 1 << WGM32 | 1 << CS31 | 1 << CS30;
}

void board_sense(uint8_t number, uint8_t sense)
{
    register_t *control = number < 4 ? &EICRA : &EICRB;
    uint8_t mask = (uint8_t)(1 << number), field = 3;
    for (uint8_t i = number & 3; i != 0; i--) {
        sense = (uint8_t)(sense << 2);
        field = (uint8_t)(field << 2);
    }
    EIMSK &= (uint8_t)~mask;
    *control = (uint8_t)((*control & ~field) | sense);
    EIFR = mask;
    EIMSK |= mask;
}
#endif
