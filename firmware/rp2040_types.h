/* Values and types of the hardware layer for the RP2040. */
#ifndef RP2040_TYPES_H
#define RP2040_TYPES_H

#include <stdint.h>

#define LINKS 2
#define LINK_USB 1 /* the USB port; the other is UART0, whose rate is a setting */
#define LINK_OF_RATE 0
#define LINK_ROOM_IN 255 /* bytes: of USB, three packets that come at once */

#define BOARD_EVERY_EDGE 1 /* two channels: can count all four edges of a slot */
#define BOARD_EDGES_PER_MS 100 /* of one wheel, so that the main loop goes on: 80,000/s and a quarter more */
#define BOARD_SHARES_PWM 1 /* two pins have one PWM output */
#define BOARD_LIGHT 25 /* pin of the LED */

/* Values in pin_t: no PWM output or interrupt; pin of the serial link, which has neither. */
#define BOARD_NOTHING 255
#define BOARD_LINK 254

/* A pin. */
typedef struct {
    volatile uint32_t *at; /* the levels of all pins; null when there is no pin */
    uint32_t mask;         /* its bit */
} bit_t;

/* A PWM output: half of the register CC of its slice. */
typedef struct {
    volatile uint16_t *compare;
} pwm_t;

#endif
