/* The analog converter, shared by the distance sensors and the battery. */
#ifndef ANALOG_H
#define ANALOG_H

#include <stdint.h>

#include "protocol.h"

void analog_configure(const settings_t *settings);

/* Starts the next conversion; from the clock's interrupt. */
void analog_convert(void);

/* Takes the result of a conversion; from the converter's interrupt. */
void analog_converted(void);

#define ANALOG_SENSORS 2 /* the first input of the sensors in range frames */

/* Sum of the last sixteen conversions divided by 4, or ANALOG_NONE. Input 0 is the distance sensor,
   1 the battery, those from ANALOG_SENSORS on are the sensors in range frames. */
uint16_t analog_mean(uint8_t input);

#endif
