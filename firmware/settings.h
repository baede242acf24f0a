/* What the firmware must know of the robot: whether it can be used. Pure; also built for the host. */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdint.h>

#include "protocol.h"

/* REFUSAL_NONE, or why these settings cannot be used and which field is to blame. */
uint8_t settings_check(const settings_t *settings, uint8_t *field);

#endif
