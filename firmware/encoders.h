/* Encoders: counts and times of edges, filtered against bounce. */
#ifndef ENCODERS_H
#define ENCODERS_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"
#include "protocol.h"
#include "ticks.h"

/* Written by interrupts; elsewhere fields longer than a byte are read with interrupts off. */
typedef struct {
    bit_t in;       /* `at` is null before there are settings */
    bit_t in_b;     /* the second channel; `at` is null with one channel */
    uint8_t interrupt;
    uint8_t wheel;  /* 0 left, 1 right */
    bool level;     /* at the last interrupt, when both edges interrupt */
    bool reversed;  /* quadrature counts down going forward */
    bool any;       /* `last` is valid */
    volatile bool moved; /* an edge was counted; the reader clears it */
    int8_t direction;
    volatile uint8_t run; /* edges since standstill, up to 2 */
    uint16_t count;
    ticks_t changed; /* when the level last changed */
    ticks_t last;    /* when the last edge was counted */
    ticks_t period;
} encoder_t;

/* From its external interrupt. */
void encoders_edge(encoder_t *encoder);

/* Applies the settings of both encoders; each is off until it is connected. */
void encoders_configure(const settings_t *settings);

/* `pins`: first and second channel, as in the settings. To be called with interrupts off. */
void encoders_connect(encoder_t *encoder, const uint8_t *pins);

/* Sets the counting direction to the sign of the motor's command. No effect with quadrature. */
void encoders_set_direction(encoder_t *encoder, int16_t wanted);

/* Age of the last edge in 64 us; AGE_NONE when there was none, or too long ago. To be called with
   interrupts off. */
uint16_t encoders_age(encoder_t *encoder, ticks_t now) __attribute__((noinline));

/* The larger of the time between the last two edges and the time since the last one; TICKS_UNKNOWN
   with fewer than two edges since standstill. */
ticks_t encoders_period(const encoder_t *encoder);

/* The next edge is the first since standstill. */
static inline void encoders_forget(encoder_t *encoder)
{
    encoder->run = 0;
}

/* While on, every rising and falling edge is added to the capture ring. */
void encoders_capture(encoder_t *left, encoder_t *right, bool on);

#endif
