/* What the board tells of itself, at its own pace. */
#ifndef TELEMETRY_H
#define TELEMETRY_H

#include <stdbool.h>
#include <stdint.h>

#include "deadman.h"
#include "protocol.h"

void telemetry_configure(const settings_t *settings);

/* Sends what is due on every link that has been spoken to. */
void telemetry_tick(const deadman_t *deadman, uint8_t faults);

/* Raw edges go out, and state frames at half their rate, while on. */
void telemetry_capture(bool on);

#endif
