/* Check of the robot's settings. Pure; also built for the host. */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdint.h>

#include "protocol.h"

/* REFUSAL_NONE, or the reason why these settings cannot be used and the field that causes it. */
uint8_t settings_check(const settings_t *settings, uint8_t *field);

#endif
