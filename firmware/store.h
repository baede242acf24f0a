/* Settings in the memory that keeps its content without power: two slots, written alternately, so that one is valid after a power loss. */
#ifndef STORE_H
#define STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* Settings of the newest valid slot; false when there is none. */
bool store_load(settings_t *settings);

/* Starts to write settings into the older slot. */
void store_begin(const settings_t *settings);

/* Writes the next byte when the last one is written. */
void store_tick(void);

/* True when the settings last started or loaded are in the EEPROM. */
bool store_done(void);

#endif
