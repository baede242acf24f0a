/* Telemetry of the board, at the rate of the settings. */
#ifndef TELEMETRY_H
#define TELEMETRY_H

#include <stdbool.h>
#include <stdint.h>

#include "deadman.h"
#include "protocol.h"

void telemetry_configure(const settings_t *settings);

/* Sends the frames that are due, on every active link. */
void telemetry_tick(const deadman_t *deadman, uint16_t faults);

/* While on, raw edges are sent, and state frames at half their rate. */
void telemetry_capture(bool on);

#endif
