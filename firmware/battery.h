/* Detection of a low battery from its readings. Pure; also built for the host. */
#ifndef BATTERY_H
#define BATTERY_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint16_t low;  /* reading below which the battery is low; 0: never */
    uint8_t count; /* checks with a low reading less those with another */
} battery_t;

/* Adds a reading, or ANALOG_NONE. To be called each 100 ms. */
void battery_check(battery_t *battery, uint16_t reading);

/* True when it has been low for 2 s: a moment of full load is not a low battery. */
bool battery_is_low(const battery_t *battery);

/* True when it has been low for 10 s: the robot must stop. */
bool battery_must_stop(const battery_t *battery);

#endif
