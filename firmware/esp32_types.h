/* Values and types of the hardware layer for the ESP32, on the API of its Arduino core. */
#ifndef ESP32_TYPES_H
#define ESP32_TYPES_H

#include <stdint.h>

#define LINKS 1 /* Serial: the USB socket */
#define LINK_OF_RATE 0
#define LINK_ROOM_IN 255 /* bytes: they are taken over once a millisecond */

#define BOARD_EVERY_EDGE 0 /* two channels: counts one edge of a slot only */
#define BOARD_EDGES_PER_MS 32 /* of one pin, so that the main loop goes on */
#define BOARD_SHARES_PWM 0 /* no two pins have one PWM output */
#define BOARD_LIGHT 2 /* pin of the LED of most boards */

/* Values in pin_t: no PWM output or interrupt; pin of the serial link, which has neither. */
#define BOARD_NOTHING 255
#define BOARD_LINK 254

/* A pin. */
typedef struct {
    const uint8_t *at; /* its number; null when there is no pin */
    uint8_t mask;
} bit_t;

/* A PWM output. */
typedef struct {
    const uint8_t *compare; /* number of its pin */
} pwm_t;

#define main diffbot_main /* the core has its own, which calls setup and loop */

#endif
