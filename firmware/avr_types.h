/* Values and types of the hardware layer for AVR boards. */
#ifndef AVR_TYPES_H
#define AVR_TYPES_H

#include <stdint.h>

/* Serial links: with one, USB cable and radio module share it and its rate is a setting; with two, USB
   is the first, at a fixed rate. */
#ifdef __AVR_ATmega328P__
#define LINKS 1
#else
#define LINKS 2
#endif
#define LINK_OF_RATE (LINKS - 1)
#define LINK_ROOM_IN 64 /* 5.5 ms at 115200 baud */

#define BOARD_EVERY_EDGE 0 /* two channels: counts one edge of a slot only */
#define BOARD_EDGES_PER_MS 32 /* of one pin, so that the main loop goes on: 4 us each */
#define BOARD_SHARES_PWM 0 /* no two pins have one PWM output */
#define BOARD_LIGHT 13 /* pin of the LED */

/* Values in pin_t: no PWM output or interrupt; pin of a serial link, which has neither. */
#define BOARD_NOTHING 15
#define BOARD_LINK 14

typedef volatile uint8_t register_t;

/* One bit of a register. For a pin the register is PINx; DDRx and PORTx follow it. */
typedef struct {
    register_t *at;
    uint8_t mask;
} bit_t;

typedef struct {
    bit_t connect;       /* COMnx1 */
    register_t *compare; /* OCRnx; its low byte for a 16-bit timer */
} pwm_t;

#endif
