/* Functions of each pin of a board. A board is a table (board_<name>.c); no other module knows pins. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "progmem.h"

/* Values in pin_t: no PWM output or interrupt; pin of a serial link, which has neither. */
#define BOARD_NOTHING 15
#define BOARD_LINK 14

typedef volatile uint8_t register_t;

/* One bit of a register. For a pin the register is PINx; DDRx and PORTx follow it. */
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
    register_t *compare; /* OCRnx; its low byte for a 16-bit timer */
} pwm_t;

extern const uint8_t board_code; /* BOARD_... of the protocol */
extern const uint8_t board_analogs;
extern const uint8_t board_first_analog; /* pin of analog channel 0 */

/* Functions of a pin; false when the board has no such pin. */
bool board_pin(uint8_t number, pin_t *pin);

/* Sets or clears the bit in the register `offset` after its own. Atomic: the single instructions for
   this do not reach ports above G. */
void board_write(const bit_t *bit, uint8_t offset, bool high);

/* True when the pin is high. */
bool board_read(const bit_t *bit);

/* Makes the pin an input with pull-up, for open-collector outputs; false without such a pin. */
bool board_input(uint8_t number, bit_t *bit);

void board_pwm(uint8_t number, pwm_t *output);

/* Starts the timers of the PWM outputs (8-bit, fast, 977 Hz). */
void board_start_timers(void);

/* Enables external interrupt `number` for an EDGE_... of the protocol. */
void board_sense(uint8_t number, uint8_t sense);

#endif
