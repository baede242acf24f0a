/* The one converter, shared by the distance sensor and the battery. */
#ifndef ANALOG_H
#define ANALOG_H

#include <stdint.h>

#include "protocol.h"

void analog_configure(const settings_t *settings);

/* Starts the next conversion; from the clock's interrupt. */
void analog_convert(void);

/* A conversion is done; from the converter's interrupt. */
void analog_converted(void);

/* Mean of the last sixteen readings by four, or ANALOG_NONE; input 0 is the distance sensor, 1 the
   battery. */
uint16_t analog_mean(uint8_t input);

#endif
