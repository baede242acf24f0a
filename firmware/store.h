/* Settings in the EEPROM: two slots written in turn, so that a cut at any byte leaves one valid. */
#ifndef STORE_H
#define STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* Payload of the newest valid slot; false when there is none. Waits for nothing at start-up. */
bool store_load(uint8_t payload[SIZE_SETTINGS]);

/* Begins to write a payload into the older slot. */
void store_begin(const uint8_t payload[SIZE_SETTINGS]);

/* Writes the next byte once the last one is done. */
void store_tick(void);

/* True when the payload last begun or loaded stands in the EEPROM. */
bool store_done(void);

#endif
