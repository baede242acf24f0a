/* Settings in the EEPROM: two slots written in turn, so that a cut at any byte leaves one valid. */
#ifndef STORE_H
#define STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* Settings of the newest valid slot; false when there is none. */
bool store_load(settings_t *settings);

/* Begins to write settings into the older slot. */
void store_begin(const settings_t *settings);

/* Writes the next byte once the last one is done. */
void store_tick(void);

/* True when the settings last begun or loaded stand in the EEPROM. */
bool store_done(void);

#endif
