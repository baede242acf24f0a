/* The wheel-speed loop, in fixed point, for one wheel: the same specification as WheelSpeedLoop in
   diffbotctl/control/speed_loop.py, which explains it. Pure; also built for the host.
   Speeds in 1/256 rad/s, duty in 1/32768, time in timer ticks of 4 us or periods of the loop. */
#ifndef SPEED_H
#define SPEED_H

#include <stdbool.h>
#include <stdint.h>

#include "ticks.h"

#define SPEED_PERIOD_MS 10
#define DUTY_FULL 32767

/* Number of edges that one measurement is based on. */
enum { NOT_MEASURED, FIRST_EDGE, MEASURED };

typedef struct {
    /* As in the settings: duty that just moves the wheel, duty per rad/s, duty per rad/s of error, in
       1/32768; duty per rad of error, in 1/INTEGRAL_ONE. */
    int16_t start, gain, proportional, integral;
    int32_t pitch; /* angle of one slot, in 1/65536 rad/s times a period */
    uint8_t lag; /* of the motor, periods; 0: unknown */
    int16_t target;
    int16_t duty;
    bool slewing;
    /* All that follows is in the direction of the target. */
    int16_t error;
    int32_t sum;             /* integral, duty in 1/32768/256 */
    int32_t reference;       /* speed of the reference model, 1/65536 rad/s */
    int32_t reference_angle; /* of the reference model since `origin`, in the unit of `pitch` */
    int32_t target_angle;    /* since `origin` at the target */
    ticks_t origin;          /* the edge, or the start, from which the next measurement begins */
    ticks_t last_edge;
    uint16_t origin_periods; /* since `origin` */
    uint16_t edges;          /* since `origin` */
    uint16_t overdue;        /* periods since an edge was overdue */
    uint8_t measured;        /* NOT_MEASURED, FIRST_EDGE or MEASURED */
    uint8_t hold;            /* periods for which the error is still integrated */
    bool kicked;
    uint8_t halvings;      /* of the weight of a measurement */
    uint8_t stall_periods; /* with drive and without an edge */
    uint8_t stall_excess;  /* of them since the wheel should have turned by 2.2 pitches */
    int32_t stall_angle;   /* that the wheel should have turned meanwhile, in the unit of `pitch` */
} speed_t;

/* Angle of one slot in the unit of `pitch`, for `slots` counts per turn. */
int32_t speed_pitch(uint16_t slots);

void speed_stop(speed_t *speed);

/* Sets a new target and the duty for it. A target that starts, stops or reverses the wheel resets the
   loop. */
void speed_command(speed_t *speed, int16_t target, ticks_t now);

/* Records edges; `last` is the time of the last of them. */
void speed_edges(speed_t *speed, uint16_t count, ticks_t last);

/* Computes the duty at the end of a period. */
void speed_step(speed_t *speed, ticks_t now);

/* To be called once a period: true when the wheel should have turned at its target, or with raw duty at
   the speed that the duty gives, and gave no edge for too long. */
bool speed_stalled(speed_t *speed, bool raw_duty);

#endif
