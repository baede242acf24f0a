#include "speed.h"

/* An age above which the wheel's speed is not known: 300 ms. */
#define AGE_UNKNOWN (TICKS_PER_SECOND * 3 / 10)
/* 2 pi * 256 * 250000: one turn in the units of pitch. */
#define TURN 402123860UL
/* A sum of gain * error over periods is duty times 256 (error) and 100 (periods a second). */
#define INTEGRATOR_ONE 25600L
/* The integrator may add a quarter of full duty. */
#define INTEGRATOR_LIMIT (32768L / 4 * INTEGRATOR_ONE)
/* A reversal changes duty by at most 0.05 a period, so that a gear is not slammed. */
#define SLEW 1638
/* Duty above 0.3 for 500 ms must give an edge. */
#define STALL_DUTY 9830
#define STALL_MS 500

uint32_t speed_pitch(uint16_t slots)
{
    return TURN / slots;
}

void speed_stop(speed_t *speed)
{
    speed->target = 0;
    speed->duty = 0;
    speed->sum = 0;
    speed->slewing = false;
    speed->stalled = 0;
}

static int8_t sign(int16_t value)
{
    return (int8_t)((value > 0) - (value < 0));
}

/* Target less measured speed; 0 while the speed is not known. */
static int16_t error(const speed_t *speed, const speed_gains_t *gains, speed_edges_t edges)
{
    if (edges.edges < 2 || edges.age > AGE_UNKNOWN)
        return 0;
    uint32_t period = edges.period > edges.age ? edges.period : edges.age;
    uint32_t measured = gains->pitch / (period ? period : 1);
    if (measured > INT16_MAX / 2)
        measured = INT16_MAX / 2;
    return (int16_t)(speed->target - sign(speed->target) * (int16_t)measured);
}

static int32_t wanted(const speed_t *speed, const speed_gains_t *gains, int16_t error)
{
    int32_t forward = sign(speed->target) * (int32_t)gains->start;
    forward += (int32_t)gains->gain * speed->target / 256;
    return forward + (int32_t)gains->proportional * error / 256 + speed->sum / INTEGRATOR_ONE;
}

static int16_t limited(int32_t duty, int16_t target)
{
    int32_t high = target > 0 ? DUTY_FULL : 0;
    int32_t low = target < 0 ? -DUTY_FULL : 0;
    return (int16_t)(duty > high ? high : duty < low ? low : duty);
}

static void approach(speed_t *speed, int16_t duty)
{
    int32_t change = (int32_t)duty - speed->duty;
    if (change > SLEW)
        change = SLEW;
    else if (change < -SLEW)
        change = -SLEW;
    else
        speed->slewing = false;
    speed->duty = (int16_t)(speed->duty + change);
}

bool speed_command(speed_t *speed, const speed_gains_t *gains, speed_edges_t edges, int16_t target)
{
    int8_t before = sign(speed->target);
    bool changed = before != sign(target);
    speed->target = target;
    if (target == 0) {
        speed_stop(speed);
        return changed;
    }
    if (changed) {
        speed->sum = 0;
        speed->slewing = before != 0;
        edges.edges = 0;
    }
    if (!speed->slewing)
        speed->duty = limited(wanted(speed, gains, error(speed, gains, edges)), target);
    return changed;
}

void speed_step(speed_t *speed, const speed_gains_t *gains, speed_edges_t edges)
{
    if (speed->target == 0)
        return;
    int16_t miss = error(speed, gains, edges);
    int32_t ideal = wanted(speed, gains, miss);
    int16_t duty = limited(ideal, speed->target);
    if (speed->slewing)
        approach(speed, duty);
    else
        speed->duty = duty;
    if ((ideal > duty && miss > 0) || (ideal < duty && miss < 0))
        return; /* saturated, and the error would push further */
    /* gain times error fits 31 bits: 65535 * 32767; the sum is bounded before it can overflow */
    int32_t step = (int32_t)gains->integral * miss;
    if (step > INTEGRATOR_LIMIT)
        step = INTEGRATOR_LIMIT;
    if (step < -INTEGRATOR_LIMIT)
        step = -INTEGRATOR_LIMIT;
    int32_t sum = speed->sum + step;
    speed->sum = sum > INTEGRATOR_LIMIT ? INTEGRATOR_LIMIT
        : sum < -INTEGRATOR_LIMIT       ? -INTEGRATOR_LIMIT
                                        : sum;
}

bool speed_stalled(speed_t *speed, int16_t duty, bool edge)
{
    if (edge || (duty <= STALL_DUTY && duty >= -STALL_DUTY))
        speed->stalled = 0;
    else
        speed->stalled += SPEED_PERIOD_MS;
    return speed->stalled >= STALL_MS;
}
