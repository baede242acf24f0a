/* Encoders: counts and times of edges, filtered against bounce. */
#ifndef ENCODERS_H
#define ENCODERS_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"
#include "protocol.h"
#include "ticks.h"

/* Written by interrupts; everybody else reads with interrupts off what is longer than a byte. */
typedef struct {
    bit_t in;       /* at null before there are settings */
    bit_t in_b;     /* the second channel; at null with one channel */
    uint8_t interrupt;
    uint8_t wheel;  /* 0 left, 1 right */
    bool level;     /* last one seen, when both flanks interrupt */
    bool reversed;  /* quadrature counts the other way */
    bool any;       /* there is a last edge, not too old */
    volatile bool moved; /* an edge was counted; whoever reads this clears it */
    int8_t direction;
    volatile uint8_t run; /* edges since the start from rest, up to 2 */
    uint16_t count;
    ticks_t changed; /* when the level last changed */
    ticks_t last;    /* when the last edge counted */
    ticks_t period;
} encoder_t;

/* From its external interrupt. */
void encoders_edge(encoder_t *encoder);

/* What both have in common; neither interrupts any more until it is connected. */
void encoders_configure(const settings_t *settings);

/* `pins` are the first and the second channel, as they stand in the settings. Interrupts off. */
void encoders_connect(encoder_t *encoder, const uint8_t *pins);

/* Which way a wheel turns, as the sign of what its motor is commanded. Quadrature knows better. */
void encoders_face(encoder_t *encoder, int16_t wanted);

/* Since the last edge, 64 us; AGE_NONE when there was none, or long ago. Interrupts off. */
uint16_t encoders_age(encoder_t *encoder, ticks_t now) __attribute__((noinline));

/* The larger of the time between the last two edges and the time since the last; TICKS_UNKNOWN when
   there were fewer than two since the wheel started. */
ticks_t encoders_period(const encoder_t *encoder);

/* Forgets the run of edges: the next one is the first since rest. */
static inline void encoders_forget(encoder_t *encoder)
{
    encoder->run = 0;
}

/* Raw edges of both flanks go to the capture ring while on. */
void encoders_capture(encoder_t *left, encoder_t *right, bool on);

#endif
