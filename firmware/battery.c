#include "battery.h"

#include "protocol.h"

#define LOW_CHECKS 20
#define STOP_CHECKS 100

void battery_check(battery_t *battery, uint16_t reading)
{
    bool low = reading != ANALOG_NONE && reading < battery->low;
    if (low && battery->count < STOP_CHECKS)
        battery->count++;
    else if (!low && battery->count != 0)
        battery->count--;
}

bool battery_is_low(const battery_t *battery)
{
    return battery->count >= LOW_CHECKS;
}

bool battery_must_stop(const battery_t *battery)
{
    return battery->count >= STOP_CHECKS;
}
