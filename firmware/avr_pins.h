/* Tables of an AVR board, which board_<name>.c defines. */
#ifndef AVR_PINS_H
#define AVR_PINS_H

#include "board.h"

/* One word per pin: port, bit, number of the PWM output, number of the interrupt. */
enum { A, B, C, D, E, F, G, H, J, K, L, NO_PORT };
#define PIN(port, bit, pwm, interrupt) (port | bit << 4 | (pwm) << 8 | interrupt << 12)
#define PLAIN(port, bit) PIN(port, bit, BOARD_NOTHING, BOARD_NOTHING)
#define LINK(port, bit) PIN(port, bit, BOARD_NOTHING, BOARD_LINK)
#define PWM(port, bit, output) PIN(port, bit, output, BOARD_NOTHING)
#define EDGE(port, bit, number) PIN(port, bit, BOARD_NOTHING, number)
#define BOTH(port, bit, output, number) PIN(port, bit, output, number)
#define ANALOG_ONLY PLAIN(NO_PORT, 0)

/* Number of a PWM output: three for each timer, in the order of avr_timers. */
#define OUTPUTS_PER_TIMER 3

extern const uint16_t avr_pins[] PROGMEM;
extern const uint8_t avr_pin_count;
extern const uint16_t avr_timers[] PROGMEM; /* data addresses of TCCRnA */
extern const uint8_t avr_groups[NO_GROUP] PROGMEM; /* ports of the pin change interrupts */
extern const uint8_t avr_first_wide;        /* first PWM output of a 16-bit timer */

#endif
