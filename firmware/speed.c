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
#define STALL_PERIODS (500 / SPEED_PERIOD_MS)

uint32_t speed_pitch(uint16_t slots)
{
    return TURN / slots;
}

void speed_stop(speed_t *speed)
{
    *speed = (speed_t){0};
}

static int32_t within(int32_t value, int32_t limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

/* Speed that the wheel lacks, in the direction of its target; 0 while its speed is not known. */
static int16_t lack(int16_t target, uint32_t pitch, const speed_edges_t *edges)
{
    if (edges->edges < 2 || edges->period > AGE_UNKNOWN)
        return 0;
    uint32_t measured = pitch / (edges->period | 1);
    return (int16_t)(target - (measured > INT16_MAX ? INT16_MAX : (int16_t)measured));
}

/* All in the direction of the target, so that signs need no care: the loop is symmetric. */
static void drive(speed_t *speed, const speed_own_t *own, const speed_common_t *common,
                  const speed_edges_t *edges, bool step)
{
    bool backwards = speed->target < 0;
    int16_t target = backwards ? (int16_t)-speed->target : speed->target;
    if (target == 0)
        return;
    int16_t error = lack(target, common->pitch, edges);
    int32_t wanted = own->start + (int32_t)((uint32_t)own->gain * (uint16_t)target >> 8);
    wanted += ((int32_t)common->proportional * error) / 256 + speed->sum / INTEGRATOR_ONE;
    int32_t duty = wanted > DUTY_FULL ? DUTY_FULL : wanted < 0 ? 0 : wanted;
    if (step && (within(wanted, DUTY_FULL) == wanted || (wanted > 0) != (error > 0))) {
        int32_t more = within((int32_t)common->integral * error, INTEGRATOR_LIMIT);
        speed->sum = within(speed->sum + more, INTEGRATOR_LIMIT);
    }
    if (backwards)
        duty = -duty;
    if (speed->slewing) {
        int32_t change = within(duty - speed->duty, step ? SLEW : 0);
        speed->slewing = speed->duty + change != duty;
        duty = speed->duty + change;
    }
    speed->duty = (int16_t)duty;
}

void speed_command(speed_t *speed, const speed_own_t *own, const speed_common_t *common,
                   speed_edges_t *edges, int16_t target)
{
    int16_t before = speed->target;
    bool turned = (before < 0) != (target < 0);
    if (before == 0 || target == 0 || turned)
        edges->edges = 0;
    if (target == 0) {
        speed_stop(speed);
        return;
    }
    if (before != 0 && turned) {
        speed->sum = 0;
        speed->slewing = speed->duty != 0 && (speed->duty < 0) != (target < 0);
    }
    speed->target = target == INT16_MIN ? -INT16_MAX : target;
    drive(speed, own, common, edges, false);
}

void speed_step(speed_t *speed, const speed_own_t *own, const speed_common_t *common,
                const speed_edges_t *edges)
{
    drive(speed, own, common, edges, true);
}

bool speed_stalled(speed_t *speed, bool edge)
{
    if (edge || (speed->duty <= STALL_DUTY && speed->duty >= -STALL_DUTY))
        speed->stalled = 0;
    else
        speed->stalled++;
    return speed->stalled >= STALL_PERIODS;
}
