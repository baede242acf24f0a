/* Arduino pin numbers of a Mega 2560: port, bit, PWM registers. */
#ifndef PINS_H
#define PINS_H

#include <stdint.h>

typedef struct {
    char port;
    uint8_t bit;
    uint16_t control, compare; /* data addresses of TCCRnA and OCRnx; 0 without PWM */
    uint8_t connect;           /* bit COMnx1 */
} place_t;

place_t pin_place(uint8_t pin);
uint16_t pin_address(char port); /* of PINx */

#endif
