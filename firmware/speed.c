#include "speed.h"

/* Time between edges above which the wheel's speed is unknown: 300 ms. */
#define PERIOD_LONGEST (TICKS_PER_SECOND * 3 / 10)
/* 2 pi * 256 * 250000: one turn in the unit of pitch. */
#define TURN 402123860UL
/* Full duty in the fixed point of `wanted` and `sum`, with 8 bits of fraction. */
#define FULL ((int32_t)DUTY_FULL << 8)
/* The integrator may add a quarter of full duty. */
#define INTEGRATOR_LIMIT (FULL / 4)
/* After a reversal the duty grows by at most 0.05 per period, to protect the gear. */
#define SLEW 1638
/* Duty above 0.3 for 500 ms must give an edge. */
#define STALL_DUTY 9830
#define STALL_PERIODS (500 / SPEED_PERIOD_MS)

uint32_t speed_pitch(uint16_t slots)
{
    return TURN / slots;
}

void speed_stop(speed_t *speed)
{
    speed->target = 0; /* the next target clears the integrator */
    speed->duty = 0;
    speed->stalled = 0;
}

bool speed_command(speed_t *speed, int16_t target)
{
    int16_t before = speed->target;
    if (target == INT16_MIN)
        target++; /* its negative does not fit */
    speed->target = target;
    if (before != 0 && target != 0 && (before ^ target) >= 0)
        return false;
    speed->sum = 0;
    speed->slewing = false;
    if (target == 0)
        speed_stop(speed);
    return true;
}

/* Speed error in the direction of the target; 0 while the speed is unknown. */
static int16_t lack(int16_t target, uint32_t pitch, ticks_t period)
{
    if (period > PERIOD_LONGEST)
        return 0;
    uint32_t measured = pitch / (period | 1);
    if (measured > INT16_MAX)
        measured = INT16_MAX;
    return target - (int16_t)measured;
}

static void gather(speed_t *speed, int32_t more)
{
    more += speed->sum;
    if (more > INTEGRATOR_LIMIT)
        more = INTEGRATOR_LIMIT;
    if (more < -INTEGRATOR_LIMIT)
        more = -INTEGRATOR_LIMIT;
    speed->sum = more;
}

/* Limits the growth of the duty after a reversal. `was` is negative while it is that of the old
   direction. */
static int16_t slewed(speed_t *speed, int16_t was, int16_t duty, bool passed)
{
    if (was < 0)
        speed->slewing = true;
    if (!speed->slewing)
        return duty;
    if (passed) {
        if (was > DUTY_FULL - SLEW)
            was = DUTY_FULL - SLEW;
        was += SLEW;
    }
    speed->slewing = was < duty;
    return speed->slewing ? was : duty;
}

/* All values are in the direction of the target: the loop is symmetric. No gain exceeds GAIN_MAXIMUM,
   so the sum of the products and the other terms fits into 32 bits. */
void speed_step(speed_t *speed, ticks_t period, bool passed)
{
    bool backwards = speed->target < 0;
    int16_t target = backwards ? -speed->target : speed->target;
    int16_t was = backwards ? -speed->duty : speed->duty;
    if (target == 0)
        return;
    int16_t error = lack(target, speed->pitch, period);
    int32_t wanted = (int32_t)speed->gain * target + (int32_t)speed->proportional * error
        + ((int32_t)speed->start << 8) + speed->sum;
    bool winds = wanted > FULL ? error > 0 : wanted < 0 && error < 0;
    if (passed && !winds)
        gather(speed, (int32_t)speed->integral * error >> 8);
    int16_t duty = wanted > FULL ? DUTY_FULL : wanted < 0 ? 0 : (int16_t)(wanted >> 8);
    duty = slewed(speed, was, duty, passed);
    speed->duty = backwards ? -duty : duty;
}

bool speed_stalled(speed_t *speed, bool edge)
{
    if (edge || (speed->duty <= STALL_DUTY && speed->duty >= -STALL_DUTY))
        speed->stalled = 0;
    else
        speed->stalled++;
    return speed->stalled >= STALL_PERIODS;
}
