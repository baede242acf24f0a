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
    uint16_t age; /* since the last edge, 64 us; AGE_NONE when there was none, or long ago */
} encoder_t;

/* From the external interrupt of that number. */
void encoders_edge(uint8_t interrupt);

void encoders_configure(const settings_t *settings);

/* Which way a wheel turns, as the sign of what its motor is commanded. Quadrature knows better. */
void encoders_face(uint8_t wheel, int16_t wanted);

/* Both wheels at the same moment, which is returned. */
ticks_t encoders_read(encoder_t both[2]);

/* What the speed loop wants to know. */
speed_edges_t encoders_edges(uint8_t wheel);

/* Forget the run of edges: the next one is the first since rest. */
void encoders_forget(uint8_t wheel);

/* True when an edge was counted since the last call. */
bool encoders_moved(uint8_t wheel);

/* Raw edges of both flanks go to the capture ring while on. */
void encoders_capture(bool on);

#endif
