/* Arduino Mega 2560. Timer 1 is the clock, so pins 11 and 12 have no PWM; 13 has that of timer 0. */
#include "board.h"

#ifdef __AVR__
#include <avr/io.h>
#include <util/atomic.h>
#endif

#include "protocol.h"

const uint8_t board_code = BOARD_MEGA2560;
const uint8_t board_analogs = 16;
const uint8_t board_first_analog = 54;

/* One word per pin: port, bit, number of the PWM output, number of the interrupt. */
enum { A, B, C, D, E, F, G, H, J, K, L };
#define PIN(port, bit, pwm, interrupt) (port | bit << 4 | (pwm) << 8 | interrupt << 12)
#define PLAIN(port, bit) PIN(port, bit, BOARD_NOTHING, BOARD_NOTHING)
#define LINK(port, bit) PIN(port, bit, BOARD_NOTHING, BOARD_LINK)
#define PWM(port, bit, output) PIN(port, bit, output, BOARD_NOTHING)
#define EDGE(port, bit, number) PIN(port, bit, BOARD_NOTHING, number)
#define BOTH(port, bit, output, number) PIN(port, bit, output, number)
/* Number of a PWM output: OCnA, OCnB or OCnC of a timer, in the order of `controls`. */
#define OC0(channel) (channel)
#define OC2(channel) (3 + channel)
#define OC3(channel) (6 + channel)
#define OC4(channel) (9 + channel)
#define OC5(channel) (12 + channel)

static const uint16_t pins[] PROGMEM = {
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

static uint8_t mask(uint8_t bit)
{
    uint8_t mask = 1;
    while (bit--)
        mask = (uint8_t)(mask << 1);
    return mask;
}

/* Data address of PINx: A to G are consecutive, H to L start at 0x100. */
static uint16_t address(uint8_t port)
{
    return (port < H ? 0x20 : 0x100 - 3 * H) + 3 * port;
}

bool board_pin(uint8_t number, pin_t *pin)
{
    if (number >= sizeof pins / sizeof *pins)
        return false;
    uint16_t word = pgm_read_word(&pins[number]);
    uint8_t abilities = (uint8_t)(word >> 8);
    pin->bit.at = (register_t *)(uintptr_t)address(word & 0xF);
    pin->bit.mask = mask((uint8_t)word >> 4);
    pin->pwm = abilities & 0xF;
    pin->interrupt = abilities >> 4;
    return true;
}

#ifdef __AVR__
void board_write(const bit_t *bit, uint8_t offset, bool high)
{
    register_t *at = bit->at + offset;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        uint8_t value = *at | bit->mask;
        if (!high)
            value ^= bit->mask;
        *at = value;
    }
}

bool board_read(const bit_t *bit)
{
    return *bit->at & bit->mask;
}

bool board_input(uint8_t number, bit_t *bit)
{
    pin_t pin;
    if (!board_pin(number, &pin))
        return false;
    *bit = pin.bit;
    board_write(bit, DIRECTION, false);
    board_write(bit, OUTPUT, true);
    return true;
}

/* OCRnx stand behind TCCRnA: from 3 on in steps of 1 for 8-bit timers, from 8 on in steps of 2 for
   16-bit ones. */
void board_pwm(uint8_t number, pwm_t *output)
{
    static const uint16_t controls[] PROGMEM = {0x44, 0xB0, 0x90, 0xA0, 0x120};
    const uint16_t *control = controls;
    bool wide = number >= OC3(A);
    for (; number > C; number -= 3)
        control++;
    output->connect.at = (register_t *)(uintptr_t)pgm_read_word(control);
    output->connect.mask = mask((uint8_t)(7 - 2 * number));
    output->compare = output->connect.at + (wide ? 8 + 2 * number : 3 + number);
}

void board_start_timers(void)
{
    TCCR0A = 1 << WGM01 | 1 << WGM00;
    TCCR0B = 1 << CS01 | 1 << CS00;
    TCCR2A = 1 << WGM21 | 1 << WGM20;
    TCCR2B = 1 << CS22;
    TCCR3A = TCCR4A = TCCR5A = 1 << WGM30;
    TCCR3B = TCCR4B = TCCR5B = 1 << WGM32 | 1 << CS31 | 1 << CS30;
}

_Static_assert(EDGE_BOTH == 1 && EDGE_FALLING == 2 && EDGE_RISING == 3, "bits ISCn of the data sheet");

void board_sense(uint8_t number, uint8_t sense)
{
    register_t *control = number < 4 ? &EICRA : &EICRB;
    uint8_t bit = mask(number), field = 3;
    for (number &= 3; number != 0; number--) {
        sense = (uint8_t)(sense << 2);
        field = (uint8_t)(field << 2);
    }
    EIMSK &= (uint8_t)~bit;
    *control = (uint8_t)((*control & ~field) | sense);
    EIFR = bit;
    EIMSK |= bit;
}
#endif
