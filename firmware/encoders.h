/* Encoders: counts and times of edges, filtered against bounce. */
#ifndef ENCODERS_H
#define ENCODERS_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"
#include "protocol.h"
#include "storm.h"
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
    int8_t direction;
    uint8_t fast_edges; /* of two channels: successive edges in quick succession, one way */
    uint16_t count;
    volatile uint16_t edges; /* counted, in either direction; wraps */
    uint16_t taken; /* of them, by encoders_take */
    storm_t storm;
    ticks_t changed; /* when the level last changed */
    ticks_t last;    /* when the last edge was counted */
    uint8_t interrupt_b; /* of channel B when every edge counts, else BOARD_NOTHING */
    uint8_t quarter;     /* of a slot, 0 to 3 forward, at the last interrupt */
} encoder_t;

/* From its external interrupts. */
void encoders_edge(encoder_t *encoder);

/* Applies the settings of both encoders; each is off until it is connected. */
void encoders_configure(const settings_t *settings);

/* `pins`: first and second channel, as in the settings. `edges_per_s`: of the wheel at full duty, 0 if
   unknown. To be called with interrupts off. */
void encoders_connect(encoder_t *encoder, const uint8_t *pins, uint32_t edges_per_s);

/* To be called each millisecond. */
void encoders_tick(encoder_t *encoder);

/* To be called each STORM_CHECK_MS. */
void encoders_check(encoder_t *encoder);

/* Sets the counting direction to the sign of the motor's command. No effect with quadrature. */
void encoders_set_direction(encoder_t *encoder, int16_t command);

/* Age of the last edge in 64 us; AGE_NONE when there was none, or too long ago. To be called with
   interrupts off. */
uint16_t encoders_age(encoder_t *encoder, ticks_t now) __attribute__((noinline));

/* Number of edges since the last call; `last` is the time of the last of them. */
uint16_t encoders_take(encoder_t *encoder, ticks_t *last);

/* While on, every rising and falling edge is added to the capture ring. */
void encoders_capture(encoder_t *left, encoder_t *right, bool on);

#endif
