/* What each pin of a board can do. A board is a table (board_<name>.c); nothing else knows pins. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "progmem.h"

/* Of pin_t: neither a PWM output nor an interrupt; and a serial link's, which is neither. */
#define BOARD_NOTHING 15
#define BOARD_LINK 14

typedef volatile uint8_t register_t;

/* One bit of a register; of a pin, the register is PINx, and DDRx and PORTx follow it. */
typedef struct {
    register_t *at;
    uint8_t mask;
} bit_t;
enum { LEVEL, DIRECTION, OUTPUT };

typedef struct {
    bit_t bit;
    uint8_t pwm;       /* number of the PWM output, or BOARD_NOTHING */
    uint8_t interrupt; /* number of the external interrupt, BOARD_LINK or BOARD_NOTHING */
} pin_t;

typedef struct {
    bit_t connect;       /* COMnx1 */
    register_t *compare; /* OCRnx; of a 16-bit timer its low byte */
} pwm_t;

extern const uint8_t board_code; /* BOARD_... of the protocol */
extern const uint8_t board_analogs;
extern const uint8_t board_first_analog; /* pin of analog channel 0 */

/* The pin's abilities; false when the board has no such pin. */
bool board_pin(uint8_t number, pin_t *pin);

/* Sets or clears the bit in the register that stands `offset` behind its own, undisturbed by
   interrupts: ports above G are out of reach of the single instructions that do it. */
void board_write(const bit_t *bit, uint8_t offset, bool high);

/* True when the pin is high. */
bool board_read(const bit_t *bit);

/* Makes the pin an input with pull-up, for outputs that only pull down; false without such a pin. */
bool board_input(uint8_t number, bit_t *bit);

void board_pwm(uint8_t number, pwm_t *output);

/* Starts the timers that make PWM (8-bit, fast, 977 Hz). */
void board_start_timers(void);

/* External interrupt `number` on an EDGE_... of the protocol. */
void board_sense(uint8_t number, uint8_t sense);

#endif
