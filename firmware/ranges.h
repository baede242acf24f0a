/* Distance sensors besides the one of the state frame: HC-SR04 and analog ones, measured in turn. */
#ifndef RANGES_H
#define RANGES_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

void ranges_configure(const settings_t *settings);

/* The pin of the echo has changed; from its interrupt. */
void ranges_changed(void);

/* To be called each millisecond: true when `frame` is to be sent. */
bool ranges_tick(range_t *frame);

#endif
