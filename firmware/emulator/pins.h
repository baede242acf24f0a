/* Arduino pin numbers of the boards: port, bit, PWM registers. */
#ifndef PINS_H
#define PINS_H

#include "board_state.h"

typedef struct {
    char port;
    uint8_t bit;
    uint16_t control, compare; /* data addresses of TCCRnA and OCRnx; 0 without PWM */
    uint8_t connect;           /* bit COMnx1 */
} place_t;

/* Chooses the table of a chip. */
void pins_begin(const chip_t *chip);

place_t pin_place(uint8_t pin);
uint16_t pin_address(char port); /* of PINx */

/* Sets the level outside of a pin. simavr drives an input with pull-up from the port's register at
   every write unless it knows the external level; both must agree. */
void pins_drive(avr_t *avr, uint8_t pin, uint8_t level);

#endif
