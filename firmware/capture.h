/* Raw encoder edges, for calibration: kept in a ring until a capture frame takes them away. */
#ifndef CAPTURE_H
#define CAPTURE_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"
#include "ticks.h"

/* From an interrupt. */
void capture_put(uint8_t wheel, bool level, ticks_t now);

/* Fills a frame once there is enough for one, or something has waited long; false otherwise. */
bool capture_take(capture_t *frame, ticks_t now);

#endif
