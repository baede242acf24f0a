/* The wheel-speed loop, in fixed point, for one wheel. Pure; also built for the host.
   Speeds in 1/256 rad/s, duty in 1/32768, time in timer ticks of 4 us. */
#ifndef SPEED_H
#define SPEED_H

#include <stdbool.h>
#include <stdint.h>

#include "ticks.h"

#define SPEED_PERIOD_MS 10
#define DUTY_FULL 32767

/* Of one wheel, as in the settings: duty that just moves it, and duty per rad/s, 1/32768. */
typedef struct {
    uint16_t start, gain;
} speed_own_t;

/* Of both: duty per rad/s and per rad of error, 1/32768, as in the settings; and one slot's angle in
   1/256 rad/s times ticks. */
typedef struct {
    uint16_t proportional, integral;
    uint32_t pitch;
} speed_common_t;

/* What the encoder knows: edges since the start from rest (0, 1, 2 for more), and the larger of the
   time between the last two and the time since the last. */
typedef struct {
    uint8_t edges;
    ticks_t period;
} speed_edges_t;

typedef struct {
    int16_t target;
    int16_t duty;
    int32_t sum; /* integrator, duty scaled by INTEGRATOR_ONE */
    bool slewing;
    uint8_t stalled; /* loop periods with power and without an edge */
} speed_t;

/* One slot's angle in the units of `pitch`, for `slots` counts a turn. */
uint32_t speed_pitch(uint16_t slots);

void speed_stop(speed_t *speed);

/* A new target; its feed-forward acts at once. When it starts the wheel or turns it round, the
   edges' history counts no more: `edges` is told so, and so must the encoder be. */
void speed_command(speed_t *speed, const speed_own_t *own, const speed_common_t *common,
                   speed_edges_t *edges, int16_t target);

/* One period of the loop. */
void speed_step(speed_t *speed, const speed_own_t *own, const speed_common_t *common,
                const speed_edges_t *edges);

/* To be called once a period: true when the wheel has had power for long and gave no edge. */
bool speed_stalled(speed_t *speed, bool edge);

#endif
