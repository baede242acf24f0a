#include "speed.h"

/* 2 pi * 65536 / 0.01: one turn in the unit of `pitch`. */
#define TURN 41177484UL
#define PERIODS_PER_SECOND (1000 / SPEED_PERIOD_MS)
#define PERIOD_TICKS (TICKS_PER_MS * SPEED_PERIOD_MS)
/* The reference model has a lag of ten periods. */
#define REFERENCE_DIVISOR 11
/* Shortest span of the edges that give one measurement: 5 ms, many edges of a fine encoder. */
#define SPAN_SHORTEST (TICKS_PER_MS * 5)
/* A measurement is integrated for this many periods, and counts less with more than 40 ms from edge to
   edge. */
#define HOLD_PERIODS 4
#define FULL_WEIGHT_TICKS (TICKS_PER_MS * 40L)
#define FULL_WEIGHT_PERIODS 4
#define INTERVAL_ONE 16 /* a period in the unit of intervals */
/* After three periods of an overdue edge the duty rises, by 1.8e-3 a period and period. */
#define KICK_DELAY 3
#define KICK_RATE 15099 /* in the unit of `sum` */
#define RETURN_FACTOR 3 /* while the duty is below the feed-forward */
/* The weight of a measurement is halved when a turning wheel has to be kicked, down to an eighth. */
#define HALVINGS_MOST 3
/* Full duty in the unit of `sum`. */
#define FULL ((int32_t)DUTY_FULL << 8)
/* After a reversal the duty grows by at most 0.05 per period, to protect the gears. */
#define SLEW 1638
/* A stall: 0.95 s without an edge, or 0.6 s and the lag of a wheel that should have turned by ten
   pitches, 0.2 s less of one that was turning; and 0.25 s and the lag more than the time for 2.2 pitches
   at the target. The lag counts with at most 0.3 s; see speed_loop.py. */
#define STALL_PERIODS 95
#define STALL_PERIODS_CLEAR 60
#define STALL_PITCHES(pitch) ((pitch) / 5 * 11)
#define STALL_PITCHES_CLEAR 10
#define STALL_EXCESS 25
#define STALL_LAG_MOST 30
#define STALL_LAG_TURNING 20
#define STALL_DUTY 9830 /* of raw duty; above it a turning wheel gives edges */
/* Largest angle that is kept; no product with it overflows. */
#define ANGLE_MOST 0x10000000L

int32_t speed_pitch(uint16_t slots)
{
    return (int32_t)(TURN / slots);
}

static int16_t limited(int32_t value)
{
    if (value > INT16_MAX)
        return INT16_MAX;
    return value < -INT16_MAX ? -INT16_MAX : (int16_t)value;
}

static void reset_stall(speed_t *speed)
{
    speed->stall_periods = speed->stall_excess = 0;
    speed->stall_angle = 0;
}

static void begin(speed_t *speed, ticks_t now)
{
    speed->error = 0;
    speed->sum = speed->reference = speed->reference_angle = speed->target_angle = 0;
    speed->origin = speed->last_edge = now;
    speed->origin_periods = speed->edges = speed->overdue = 0;
    speed->measured = NOT_MEASURED;
    speed->hold = 0;
    speed->kicked = false;
    speed->halvings = 0;
    reset_stall(speed);
}

void speed_stop(speed_t *speed)
{
    speed->target = 0; /* the next target resets the loop */
    speed->duty = 0;
    speed->slewing = false;
    reset_stall(speed);
}

static int16_t magnitude(int16_t value)
{
    return value < 0 ? -value : value;
}

/* The duty before its limits, in the unit of `sum`. No gain exceeds GAIN_MAXIMUM, so the sum of the
   products and the other terms fits into 32 bits. */
static int32_t unlimited(const speed_t *speed)
{
    return (int32_t)speed->gain * magnitude(speed->target) + (int32_t)speed->proportional * speed->error
        + ((int32_t)speed->start << 8) + speed->sum;
}

/* Sets the duty; in a reversal it grows by at most `growth`. */
static void apply(speed_t *speed, int16_t growth)
{
    bool backwards = speed->target < 0;
    int32_t raw = unlimited(speed);
    int16_t duty = raw > FULL ? DUTY_FULL : raw < 0 ? 0 : (int16_t)(raw >> 8);
    int16_t before = backwards ? -speed->duty : speed->duty;
    if (speed->slewing) {
        int16_t most = before > DUTY_FULL - growth ? DUTY_FULL : before + growth;
        speed->slewing = duty > most;
        if (speed->slewing)
            duty = most;
    }
    speed->duty = backwards ? -duty : duty;
}

void speed_command(speed_t *speed, int16_t target, ticks_t now)
{
    int16_t before = speed->target;
    if (target == INT16_MIN)
        target++; /* its negative does not fit */
    if (target == 0) {
        speed_stop(speed);
        return;
    }
    speed->target = target;
    if (before == 0 || (before ^ target) < 0) {
        begin(speed, now);
        speed->slewing = speed->duty != 0 && (speed->duty ^ target) < 0;
    }
    apply(speed, 0);
}

void speed_edges(speed_t *speed, uint16_t count, ticks_t last)
{
    if (count == 0)
        return;
    speed->edges += count;
    speed->last_edge = last;
    reset_stall(speed);
}

/* The speed error over `span` ticks in which the reference model turned by `ahead` more than the wheel.
   An angle of 1 in a span of 1 tick is 2500/256, or 625/64, in 1/256 rad/s. */
static int16_t error_of(int32_t ahead, int32_t span)
{
    const int32_t exact = INT32_MAX / 625; /* beyond half a radian a coarser quotient is enough */
    const int32_t most = 2L * INT16_MAX;
    if (ahead < exact && ahead > -exact)
        return limited(ahead * 625 / span / 64);
    int32_t quotient = ahead / (span / 16);
    if (quotient > most)
        quotient = most;
    if (quotient < -most)
        quotient = -most;
    return limited(quotient * 625 / 1024);
}

/* Angle of the edges since `origin`. */
static int32_t turned(const speed_t *speed)
{
    return speed->edges < ANGLE_MOST / speed->pitch ? speed->edges * speed->pitch : ANGLE_MOST;
}

/* An angle by which the wheel is off, from those of the reference model and of the target: none between
   them, for a motor that is quicker than the model. */
static int32_t between(int32_t reference, int32_t target)
{
    if ((reference < 0) != (target < 0))
        return 0;
    bool nearer = reference < 0 ? target > reference : target < reference;
    return nearer ? target : reference;
}

/* Takes the edges since `origin` as a measurement of the speed; `target` in the unit of `reference`. */
static void measure(speed_t *speed, int32_t target, ticks_t now)
{
    int32_t since = (int32_t)(now - speed->last_edge);
    if (since > 2 * PERIOD_TICKS)
        since = 2 * PERIOD_TICKS; /* never, unless the main loop was late */
    int32_t angle_after = (speed->reference >> 8) * since / 625 * 64; /* since the last edge */
    int32_t target_after = (target >> 8) * since / 625 * 64;
    bool stuck = false;
    if (speed->measured != NOT_MEASURED) {
        int32_t span = (int32_t)(speed->last_edge - speed->origin);
        int32_t angle = turned(speed);
        int32_t ahead = between(speed->reference_angle - angle_after - angle,
                                speed->target_angle - target_after - angle);
        int32_t error = error_of(ahead, span);
        /* With more than one edge a period, a wheel at less than half its target still sticks. */
        stuck = speed->pitch < target && error > target / 512;
        int32_t interval = span / speed->edges;
        if (interval > FULL_WEIGHT_TICKS)
            error = error * (FULL_WEIGHT_TICKS / 16) / (interval / 16);
        if (speed->kicked && !stuck && speed->measured == MEASURED && speed->halvings < HALVINGS_MOST)
            speed->halvings++; /* it hunts: it turned, and stopped */
        speed->error = (int16_t)(error / (1 << speed->halvings));
        speed->hold = HOLD_PERIODS;
        speed->measured = MEASURED;
    } else {
        speed->error = 0;
        speed->measured = FIRST_EDGE;
    }
    if (speed->kicked && !stuck)
        speed->sum /= 2;
    speed->kicked = false;
    speed->overdue = speed->edges = 0;
    speed->origin = speed->last_edge;
    speed->origin_periods = 1;
    speed->reference_angle = angle_after;
    speed->target_angle = target_after;
}

/* Adds to the integral, unless the duty is limited on that side. */
static void integrate(speed_t *speed, int32_t change)
{
    int32_t raw = unlimited(speed);
    if (change > 0 ? raw > FULL : raw < 0)
        return;
    change += speed->sum;
    if (change > FULL)
        change = FULL;
    speed->sum = change < -FULL ? -FULL : change;
}

static int32_t change_of(const speed_t *speed)
{
    return ((int32_t)speed->integral * speed->error) >> 4;
}

/* Change of the integral while an edge is overdue by the angle `lag`. */
static int32_t overdue_change(speed_t *speed, int32_t lag)
{
    int32_t target = (int32_t)magnitude(speed->target) << 8;
    int32_t interval = speed->pitch / (target / INTERVAL_ONE); /* from edge to edge */
    int32_t error = lag / speed->origin_periods >> 8;
    if (interval > FULL_WEIGHT_PERIODS * INTERVAL_ONE)
        error = error * (FULL_WEIGHT_PERIODS * INTERVAL_ONE) / interval;
    if (error > speed->error)
        speed->error = limited(error);
    int32_t change = change_of(speed);
    if (speed->overdue < UINT16_MAX)
        speed->overdue++;
    int32_t late = ((int32_t)speed->overdue - KICK_DELAY) * INTERVAL_ONE;
    if (speed->measured == MEASURED) /* it was turning: perhaps only slower than its target */
        late -= interval / 4;
    if (late <= 0)
        return change;
    speed->kicked = true;
    int32_t kick = late > PERIODS_PER_SECOND * INTERVAL_ONE ? FULL : KICK_RATE * late / INTERVAL_ONE;
    if (speed->sum < 0)
        kick *= RETURN_FACTOR;
    return kick > change ? kick : change;
}

static void run_period(speed_t *speed, ticks_t now)
{
    int32_t target = (int32_t)magnitude(speed->target) << 8;
    speed->reference += (target - speed->reference) / REFERENCE_DIVISOR;
    speed->reference_angle += speed->reference;
    if (speed->reference_angle > ANGLE_MOST)
        speed->reference_angle = ANGLE_MOST;
    speed->target_angle += target;
    if (speed->target_angle > ANGLE_MOST)
        speed->target_angle = ANGLE_MOST;
    if (speed->origin_periods < UINT16_MAX)
        speed->origin_periods++;
    if (speed->edges != 0
        && (speed->measured == NOT_MEASURED
            || (int32_t)(speed->last_edge - speed->origin) >= SPAN_SHORTEST))
        measure(speed, target, now);
    int32_t lag = speed->reference_angle < speed->target_angle ? speed->reference_angle : speed->target_angle;
    lag -= speed->pitch + turned(speed);
    if (lag > 0) {
        integrate(speed, overdue_change(speed, lag));
    } else if (speed->hold != 0) {
        speed->hold--;
        integrate(speed, change_of(speed));
    }
}

void speed_step(speed_t *speed, ticks_t now)
{
    if (speed->target == 0)
        return;
    run_period(speed, now);
    apply(speed, SLEW);
}

/* Speed at which a raw duty turns the wheel, 1/256 rad/s. */
static int32_t speed_of(const speed_t *speed)
{
    int32_t beyond = (int32_t)magnitude(speed->duty) - speed->start;
    if (beyond <= 0)
        return 0;
    return speed->gain != 0 ? limited(beyond * 256 / speed->gain) : INT16_MAX;
}

bool speed_stalled(speed_t *speed, bool raw_duty)
{
    if (raw_duty ? magnitude(speed->duty) <= STALL_DUTY : speed->target == 0) {
        reset_stall(speed);
        return false;
    }
    if (speed->stall_periods < STALL_PERIODS)
        speed->stall_periods++;
    if (speed->stall_angle < STALL_PITCHES_CLEAR * speed->pitch)
        speed->stall_angle += (raw_duty ? speed_of(speed) : magnitude(speed->target)) << 8;
    uint8_t lag = speed->lag < STALL_LAG_MOST ? speed->lag : STALL_LAG_MOST;
    uint8_t excess = STALL_EXCESS + lag;
    if (speed->stall_angle >= STALL_PITCHES(speed->pitch) && speed->stall_excess < excess)
        speed->stall_excess++;
    bool has_turned = speed->measured == MEASURED;
    bool is_clear = has_turned || speed->stall_angle >= STALL_PITCHES_CLEAR * speed->pitch;
    uint8_t least = STALL_PERIODS;
    if (is_clear && !raw_duty) {
        least = STALL_PERIODS_CLEAR + (lag ? lag : STALL_LAG_MOST);
        if (has_turned && lag)
            least -= lag < STALL_LAG_TURNING ? lag : STALL_LAG_TURNING;
    }
    return speed->stall_periods >= least && speed->stall_excess >= excess;
}
