#include "wheel.h"

wheel_t wheels[2];

void wheels_release(void)
{
    motors_release(&LEFT->motor);
    motors_release(&RIGHT->motor);
}
