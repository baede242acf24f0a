/* What each pin of a board can do. A board is a table (board_<name>.c); nothing else knows pins. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "progmem.h"

#define BOARD_NONE 0xFF

typedef volatile uint8_t register_t;

enum { ABLE_NOTHING, ABLE_LINK, ABLE_PWM, ABLE_INTERRUPT };

typedef struct {
    register_t *port; /* PINx; DDRx and PORTx follow it */
    uint8_t mask;
    uint8_t ability;
    uint8_t pwm;       /* number of the PWM output, or BOARD_NONE */
    uint8_t interrupt; /* number of the external interrupt, or BOARD_NONE */
} pin_t;

typedef struct {
    register_t *control; /* TCCRnA */
    register_t *compare; /* OCRnx; of a 16-bit timer its low byte */
    uint8_t connect;     /* mask of COMnx1 */
} pwm_t;

extern const uint8_t board_code; /* BOARD_... of the protocol */
extern const uint8_t board_analogs;
extern const uint8_t board_first_analog; /* pin of analog channel 0 */

/* The pin's abilities; false when the board has no such pin. */
bool board_pin(uint8_t number, pin_t *pin);
/* Makes the pin an input with pull-up, for outputs that only pull down; false without such a pin. */
bool board_input(uint8_t number, pin_t *pin);

void board_pwm(uint8_t number, pwm_t *output);

/* Starts the timers that make PWM (8-bit, fast, 977 Hz). */
void board_start_timers(void);

/* External interrupt `number` on a rising, falling or any edge; see ISCn in the data sheet. */
enum { SENSE_ANY = 1, SENSE_FALLING = 2, SENSE_RISING = 3 };
void board_sense(uint8_t number, uint8_t sense);

#endif
