#include "gyro.h"

#include <stdbool.h>

#include "board.h"
#include "two_wire.h"

/* First of an MPU6050, 6500 and 9250 (their register maps): wake with the gyro's clock, a low pass of
   42 Hz against aliasing at 100 readings a second, a full scale of 500 deg/s. Then, in every period:
   read the full scale, read the acceleration along x, or the axes after it, and the rate about the same
   axis. Beside it of an LSM6DS3 and LSM6DSO (their data sheets): both bytes of a rate of one time, the
   accelerometer and a full scale of 500 deg/s at 104 Hz, with the low pass of that rate; the low byte
   comes first. Both accelerometers measure up to 2 g. */
typedef struct {
    uint8_t number, value;
} step_t;
static const step_t steps[][2] PROGMEM = {
    {{0x6B, 1}, {0x12, 0x44}},
    {{0x1A, 3}, {0x10, 0x40}},
    {{0x1B, 0x08}, {0x11, 0x44}},
    {{0x1B, WIRE_READS}, {0x11, WIRE_READS}},
    {{0x3B, WIRE_READS}, {0x28 - 2 * GYRO_LSM6, WIRE_READS}},
    {{0x43, WIRE_READS}, {0x22 - 2 * GYRO_LSM6, WIRE_READS}},
};
enum { SCALE = 2, CHECK, WEIGH, READ, DONE };

#define PERIOD_MS 10
#define UNITS_PER_256_READINGS 4 /* of TURN_NANODEGREES */
/* Readings: lost ones after which the gyro is silent; equal ones of a sensor that is stuck, since the
   noise of one that works changes its last bits; those without a fault after which it is trusted, more
   than the equal ones, so that a sensor that was always stuck is never trusted. */
#define LOST_MOST 10
#define EQUAL_MOST 25
#define GOOD_LEAST 30
/* Wrong directions of gravity in succession; a bump of the floor lasts less. */
#define TILTED_MOST 25
#define UPRIGHT_LEAST 0x20 /* high byte of 0.5 g: an axis is up to 60 degrees from the vertical */

static uint8_t address, axis; /* address 0: no gyro */
static uint8_t elapsed_ms, step;
static bool is_lsm6;
static uint8_t upward, tilted; /* UPWARD_... */
static uint8_t lost, equal;
static uint8_t doubtful; /* readings without a fault until the gyro is trusted */
static uint16_t faults;
static int16_t rate; /* the last reading */
static uint32_t sum;

static void fail(uint16_t flag)
{
    faults = flag;
    doubtful = GOOD_LEAST;
}

void gyro_configure(const settings_t *settings)
{
    address = settings->gyro_address;
    axis = settings->gyro_axis;
    is_lsm6 = axis >= GYRO_LSM6;
    upward = settings->gyro_upward;
    board_two_wire_release();
    step = DONE;
    faults = 0;
    if (address != 0)
        fail(FLAG_GYRO_SILENT); /* until it has answered */
}

static void add(int16_t reading)
{
    lost = 0;
    if (equal < EQUAL_MOST)
        equal++;
    if (reading != rate)
        equal = 0;
    rate = reading;
    uint16_t flag = 0; /* one of those that hold, or they would alternate */
    if (tilted == TILTED_MOST)
        flag = FLAG_GYRO_GRAVITY;
    if (equal == EQUAL_MOST)
        flag = FLAG_GYRO_STUCK;
    if ((uint16_t)((uint16_t)reading - INT16_MAX) <= 1) /* INT16_MAX or INT16_MIN */
        flag = FLAG_GYRO_RANGE;
    if (flag != 0)
        fail(flag);
    if (doubtful != 0 && --doubtful == 0)
        faults = 0;
}

/* `acceleration`: high byte of that along the axis; at rest the ground pushes an axis that points up. */
static void weigh(int8_t acceleration)
{
    if (upward == UPWARD_DOWN)
        acceleration = (int8_t)-acceleration;
    if (upward == UPWARD_UNCHECKED || acceleration >= UPRIGHT_LEAST)
        tilted = 0;
    else if (tilted < TILTED_MOST)
        tilted++;
}

__attribute__((noinline)) static void begin_step(void)
{
    uint8_t number = pgm_read_byte(&steps[step][is_lsm6].number);
    if (step >= WEIGH)
        number = (uint8_t)(number + 2 * axis);
    two_wire_begin(address, number, pgm_read_byte(&steps[step][is_lsm6].value));
}

/* After a period without a reading, in which the robot turned on as before. */
static void lose(void)
{
    if (++lost < LOST_MOST)
        return;
    lost = LOST_MOST;
    fail(two_wire_state() == TWO_WIRE_BUSY ? FLAG_GYRO_BUS : FLAG_GYRO_SILENT);
}

/* A sensor that was reset by a dip of its supply has lost its full scale: that is read every time. */
static void next_step(void)
{
    const volatile uint8_t *bytes = two_wire_bytes();
    if (step == WEIGH)
        weigh((int8_t)bytes[is_lsm6]);
    if (step == READ)
        add((int16_t)(bytes[is_lsm6] << 8 | bytes[!is_lsm6]));
    if (step == CHECK && bytes[0] != pgm_read_byte(&steps[SCALE][is_lsm6].value))
        step = 0;
    else
        step++;
    if (step != DONE)
        begin_step();
}

void gyro_tick(void)
{
    if (address == 0)
        return;
    if (++elapsed_ms == PERIOD_MS) {
        elapsed_ms = 0;
        if (step != DONE)
            lose();
        sum += (uint32_t)rate;
        step = CHECK;
        begin_step();
    } else if (step != DONE && two_wire_state() == TWO_WIRE_DONE) {
        next_step();
    }
}

uint16_t gyro_turn(void)
{
    return (uint16_t)(sum * UNITS_PER_256_READINGS >> 8); /* shifts of whole bytes are cheap */
}

uint16_t gyro_faults(void)
{
    return faults;
}
