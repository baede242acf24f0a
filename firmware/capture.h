/* Raw encoder edges for calibration, in a ring until they are sent in a capture frame. */
#ifndef CAPTURE_H
#define CAPTURE_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"
#include "ticks.h"

/* Adds an edge; from an interrupt. */
void capture_put(uint8_t wheel, bool level, ticks_t now);

/* Fills a frame when enough edges wait, or one has waited 100 ms; else returns false. */
bool capture_take(capture_t *frame, ticks_t now);

#endif
