/* The wheel-speed loop, in fixed point, for one wheel. Pure; also built for the host.
   Speeds in 1/256 rad/s, duty in 1/32768, time in timer ticks of 4 us. */
#ifndef SPEED_H
#define SPEED_H

#include <stdbool.h>
#include <stdint.h>

#include "ticks.h"

#define SPEED_PERIOD_MS 10
#define DUTY_FULL 32767

typedef struct {
    /* As in the settings: duty that just moves the wheel, duty per rad/s, duty per rad/s of error, in
       1/32768; duty per rad of error, in 1/INTEGRAL_ONE. */
    int16_t start, gain, proportional, integral;
    uint32_t pitch; /* angle of one slot, 1/256 rad/s times ticks */
    int16_t target;
    int16_t duty;
    int32_t sum; /* integrator, duty in 1/32768/256 */
    bool slewing;
    uint8_t stalled; /* loop periods with drive and without an edge */
} speed_t;

/* Angle of one slot in the unit of `pitch`, for `slots` counts per turn. */
uint32_t speed_pitch(uint16_t slots);

void speed_stop(speed_t *speed);

/* Sets a new target; its feed-forward acts in the next step, which should follow at once. True when it
   starts, stops or reverses the wheel: the last edges are then no measure of its speed. */
bool speed_command(speed_t *speed, int16_t target);

/* Computes the duty from the time between edges; `passed`: a period of the loop has passed. */
void speed_step(speed_t *speed, ticks_t period, bool passed);

/* To be called once a period: true when the wheel was driven for 500 ms and gave no edge. */
bool speed_stalled(speed_t *speed, bool edge);

#endif
