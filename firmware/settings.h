/* Check of the robot's settings. Pure; also built for the host. */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* True when what a longer settings frame has beyond the fields known here is zero; `size` is the length of
   its payload. */
bool settings_known(const settings_t *settings, uint8_t size, uint8_t *field);

/* REFUSAL_NONE, or the reason why these settings cannot be used and the field that causes it. */
uint8_t settings_check(const settings_t *settings, uint8_t *field);

/* Trigger and input of a sensor, as in the settings. */
static inline const uint8_t *settings_range_pins(const settings_t *settings, uint8_t sensor)
{
    return &settings->trigger_1 + 2 * sensor;
}

#endif
