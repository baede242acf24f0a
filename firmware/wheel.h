/* The two wheels: left, right. */
#ifndef WHEEL_H
#define WHEEL_H

#include "encoders.h"
#include "motors.h"
#include "speed.h"

typedef struct {
    speed_t speed;
    motor_t motor;
    encoder_t encoder;
} wheel_t;

extern wheel_t wheels[2];
#define LEFT (&wheels[0])
#define RIGHT (&wheels[1])

/* Both motors off; may be called from an interrupt. */
void wheels_release(void);

#endif
