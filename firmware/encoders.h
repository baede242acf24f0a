/* Two encoders: counts and times of edges, filtered against bounce. Wheel 0 is left. */
#ifndef ENCODERS_H
#define ENCODERS_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"
#include "speed.h"

typedef struct {
    uint16_t count;
    uint16_t rejected;
    uint32_t age; /* since the last edge, ticks of 4 us */
    bool any;     /* false when there was none, or too long ago to tell */
} encoder_t;

void encoders_configure(const settings_t *settings);

/* Which way a wheel turns, as its motor is commanded: 1 or -1. Quadrature knows better. */
void encoders_direct(uint8_t wheel, int8_t direction);

/* Both wheels at the same moment, which is `now`. */
void encoders_read(encoder_t both[2], uint32_t *now);

/* What the speed loop wants to know. */
speed_edges_t encoders_edges(uint8_t wheel);

/* Forget the run of edges: the next one is the first since rest. */
void encoders_forget(uint8_t wheel);

/* True when an edge was counted since the last call. */
bool encoders_moved(uint8_t wheel);

/* Raw edges of both flanks go to the capture ring while on. */
void encoders_capture(bool on);

#endif
